#pragma once

#include <render/channel/layout.h>

#include <vtkActor.h>
#include <vtkNew.h>
#include <vtkRenderer.h>
#include <vtkTransform.h>

namespace palpate::render {

/// Colours that mean the same in the 3-D view, on the slice and in the legend.
inline constexpr std::array<double, 3> toolColour{0.25, 0.85, 1.0};
inline constexpr std::array<double, 3> planColour{1.0, 1.0, 1.0};
inline constexpr std::array<double, 3> proxyColour{1.0, 0.9, 0.2};

/// The tool, the point on the surface that it would be at without penetration, the planned line and its aim.
class ToolPicture {
public:
    ToolPicture(const channel::Scenery& scenery, vtkRenderer& renderer);
    void update(const channel::State& state);

private:
    void addPlan(const channel::Scenery& scenery, vtkRenderer& renderer);

    bool turns_ = false;  // with the axis: no sphere
    vtkNew<vtkTransform> pose_;
    vtkNew<vtkActor> proxy_;
};

}  // namespace palpate::render
