#include <render/picture.h>

#include <base/units.h>

#include <vtkCamera.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::render {
namespace {

using units::mm;

// How the camera looks into the part of the window that is the 3-D view.
struct Lens {
    glm::dvec3 eye, ahead, right, up;    // [mm], unit vectors
    double left, bottom, width, height;  // [pixels]
    double slope;                        // of the ray to the next pixel

    Lens(vtkRenderer& view, const int* size)
    {
        vtkCamera& camera = *view.GetActiveCamera();
        const auto triple = [](const double* v) { return glm::dvec3(v[0], v[1], v[2]); };
        eye = triple(camera.GetPosition());
        ahead = triple(camera.GetDirectionOfProjection());
        right = glm::normalize(glm::cross(ahead, triple(camera.GetViewUp())));
        up = glm::cross(right, ahead);
        const double* port = view.GetViewport();
        left = port[0] * size[0];
        bottom = port[1] * size[1];
        width = std::max(port[2] * size[0] - left, 1.0);
        height = std::max(port[3] * size[1] - bottom, 1.0);
        slope = std::tan(0.5 * camera.GetViewAngle() / 180.0 * std::acos(-1.0)) / (0.5 * height);
    }
};

}  // namespace

glm::dvec3 Picture::under(Point2 pixel, glm::dvec3 point) const
{
    const Lens lens(*view_, window_.GetSize());
    const glm::dvec3 ray = lens.ahead + lens.slope * ((pixel[0] - lens.left - 0.5 * lens.width) * lens.right +
                                                      (pixel[1] - lens.bottom - 0.5 * lens.height) * lens.up);
    return (lens.eye + glm::dot(point * mm - lens.eye, lens.ahead) * ray) / mm;
}

bool Picture::shows(glm::dvec3 point) const
{
    const Lens lens(*view_, window_.GetSize());
    const glm::dvec3 way = point * mm - lens.eye;
    const double depth = glm::dot(way, lens.ahead);
    return depth > 0 && std::abs(glm::dot(way, lens.right)) <= 0.5 * lens.width * lens.slope * depth &&
           std::abs(glm::dot(way, lens.up)) <= 0.5 * lens.height * lens.slope * depth;
}

}  // namespace palpate::render
