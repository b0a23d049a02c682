#pragma once

#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <array>
#include <string>

namespace palpate::render {

/// How the session is looked at, the same in the 3-D view and on the slice: the planned line lies in the plane of `right`
/// and `up`, and `towards` points at the viewer. Unit vectors, right-handed, chosen so that the plane comes as near as it
/// can to an axial (else sagittal, else coronal) one, drawn as radiologists do.
struct ViewFrame {
    glm::dvec3 right{1, 0, 0}, up{0, -1, 0}, towards{0, 0, -1};
    glm::dvec3 centre{0.0};  // [m]
    double extent = 0.1;     // of the slice [m]
};

ViewFrame viewFrame(const channel::Scenery& scenery);

/// Axial, sagittal and coronal through `point` [m], as radiologists draw them, around the procedure.
std::array<ViewFrame, 3> orthogonalFrames(const ViewFrame& procedure, glm::dvec3 point);

/// `frame` turned by the least that brings `axis` into its plane, and moved along `towards` to hold `tip`.
ViewFrame through(const ViewFrame& frame, glm::dvec3 tip, glm::dvec3 axis);

/// "L", or "LA" when oblique: the side of the patient that `direction` points to (LPS).
std::string side(glm::dvec3 direction);

/// Where the camera looks from, a unit vector: turned about the planned line out of the slice's plane, so that the picture
/// has depth and the line still lies in the plane of the picture, in which the mouse moves the tool.
glm::dvec3 cameraDirection(const channel::Scenery& scenery, const ViewFrame& frame);

}  // namespace palpate::render
