#pragma once

#include <channel/layout.h>
#include <render/canvas.h>
#include <render/deformation.h>
#include <render/grey_image.h>
#include <render/palette.h>
#include <render/screen_plan.h>
#include <render/view_frame.h>

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

#include <optional>
#include <vector>

namespace palpate::render {

/// What there is to see in a slice, and how.
struct Anatomy {
    const channel::Scenery& scenery;
    const Deformation& deformation;
    const GreyImage& grey;
    SliceLook look = SliceLook::tissue;
    Palette palette = Palette::standard;

    bool imageShown() const noexcept { return look != SliceLook::tissue && !grey.empty(); }
};

/// The deformed anatomy in a plane, as a flat picture in the window.
class SlicePicture {
public:
    explicit SlicePicture(vtkRenderer& renderer);

    /// Finds what of the anatomy has to be computed anew: what is in `changed`, and all after a turn of the plane, with
    /// another area and another look. `step`: pixels from one that is computed to the next. Returns whether paint() has
    /// work.
    bool update(const Anatomy& anatomy, const ViewFrame& frame, const Area& area, const VoxelBox& changed, int step);
    /// Computes it. Uses nothing of VTK's, so that it may run beside the drawing of what is not this slice.
    void paint(const Anatomy& anatomy);
    /// Tool, planned line, `aim` where it lies now [m]. What is off the plane is drawn thinner and darker.
    void annotate(Canvas& canvas, const Anatomy& anatomy, const channel::State& state, glm::dvec3 aim, double font) const;
    /// The sides of the patient, scale bar and the window of the image (null: none is shown), as far as there is room, and
    /// nothing above `below` [pixels from the lower edge of the window].
    void label(Canvas& canvas, const GreyImage* grey, double font, double below) const;
    void hide();

private:
    Point2 pixel(glm::dvec3 p) const;
    /// Not in the plane, but before or behind it.
    bool isAway(glm::dvec3 p) const;
    void drawMarks(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state, double font) const;
    void drawFingertip(Canvas& canvas, Point2 from, Point2 to, double radius, bool away) const;
    void drawTool(Canvas& canvas, const channel::Scenery& scenery, const channel::State& state) const;
    void drawWindow(Canvas& canvas, const GreyImage& grey, double font, double above, double below) const;

    vtkNew<vtkImageData> image_;
    vtkNew<vtkActor2D> actor_;
    ViewFrame frame_;
    Area area_;
    std::optional<VoxelBox> due_;  // to be computed anew; empty: everything
    // Of what is drawn; step 0: nothing.
    int step_ = 0;
    SliceLook look_ = SliceLook::tissue;
    std::uint32_t window_ = 0;
};

/// Corners of the outline of a stick with round ends, counterclockwise; a circle where both ends are one point.
/// @param radius  of the stick, and of its ends [as the points]
std::vector<Point2> stickOutline(Point2 from, Point2 to, double radius);

}  // namespace palpate::render
