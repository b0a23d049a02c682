#pragma once

#include <render/canvas.h>
#include <render/channel/layout.h>
#include <render/deformation.h>
#include <render/view_frame.h>

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

namespace palpate::render {

/// A rectangle of the window [pixels], from the lower left.
struct Area {
    int x = 0, y = 0, width = 0, height = 0;
};

/// The deformed anatomy in the plane through the tool, as a flat picture in the window.
class SlicePicture {
public:
    explicit SlicePicture(vtkRenderer& renderer);

    /// Computes the anatomy anew in `changed`, and everywhere after a turn of the plane or with another area.
    void update(const channel::Scenery& scenery, const Deformation& deformation, const ViewFrame& frame, const Area& area,
                const VoxelBox& changed);
    /// Tool, planned line, aim, scale bar and the sides of the patient.
    void annotate(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state, double font) const;
    void hide();

private:
    Point2 pixel(glm::dvec3 p) const;
    void drawTool(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state) const;

    vtkNew<vtkImageData> image_;
    vtkNew<vtkActor2D> actor_;
    ViewFrame frame_;
    Area area_;
    bool drawn_ = false;
};

}  // namespace palpate::render
