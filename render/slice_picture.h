#pragma once

#include <render/canvas.h>
#include <render/channel/layout.h>
#include <render/deformation.h>
#include <render/screen_plan.h>
#include <render/view_frame.h>

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

namespace palpate::render {

/// The deformed anatomy in a plane, as a flat picture in the window.
class SlicePicture {
public:
    explicit SlicePicture(vtkRenderer& renderer);

    /// Computes the anatomy anew in `changed`, and everywhere after a turn of the plane or with another area. `step`:
    /// pixels from one that is computed to the next.
    void update(const channel::Scenery& scenery, const Deformation& deformation, const ViewFrame& frame, const Area& area,
                const VoxelBox& changed, int step);
    /// Tool, planned line, `aim` where it lies now [m], scale bar and the sides of the patient. What is off the plane is
    /// drawn thinner and darker.
    void annotate(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state, glm::dvec3 aim,
                  double font) const;
    void hide();

private:
    Point2 pixel(glm::dvec3 p) const;
    void drawTool(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state) const;

    vtkNew<vtkImageData> image_;
    vtkNew<vtkActor2D> actor_;
    ViewFrame frame_;
    Area area_;
    int step_ = 0;  // of what is drawn; 0: nothing
};

}  // namespace palpate::render
