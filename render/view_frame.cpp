#include <render/view_frame.h>

#include <render/deformation.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::render {
namespace {

struct Standard {
    glm::dvec3 right, up, towards;
};

// Axial from below, sagittal from the left, coronal from the front.
constexpr std::array<Standard, 3> standards{
    {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}, {{0, 1, 0}, {0, 0, 1}, {1, 0, 0}}, {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}}};

// `v` without its part along the unit vector `n`.
glm::dvec3 acrossOf(glm::dvec3 v, glm::dvec3 n)
{
    return v - glm::dot(v, n) * n;
}

}  // namespace

ViewFrame viewFrame(const channel::Scenery& scenery)
{
    const glm::dvec3 entry = vec(scenery.entry), aim = vec(scenery.aim);
    const channel::Grid& grid = scenery.labels;
    const glm::dvec3 size = grid.spacing * glm::dvec3(channel::sizeOf(grid));
    const double length = glm::distance(entry, aim);
    ViewFrame frame;
    const bool planned = length > 1e-4;
    const glm::dvec3 line = planned ? (aim - entry) / length : glm::dvec3(0, 1, 0);
    frame.centre = planned ? entry + 0.6 * (aim - entry) : vec(grid.origin) + 0.5 * size;
    frame.extent = planned ? std::max(1.7 * length + 0.02, 0.06) : std::max({size.x, size.y, size.z});

    // A plane counts as axial (sagittal, coronal) when the line rises out of it by less than 40 degrees.
    const double steep = std::sin(40.0 / 180.0 * std::acos(-1.0));
    const Standard* chosen = &standards[2];
    for (const Standard& s : standards)
        if (std::abs(glm::dot(line, s.towards)) <= steep) {
            chosen = &s;
            break;
        }
    frame.towards = glm::normalize(acrossOf(chosen->towards, line));
    frame.up = glm::normalize(acrossOf(chosen->up, frame.towards));
    frame.right = glm::cross(frame.up, frame.towards);
    return frame;
}

std::array<ViewFrame, 3> orthogonalFrames(const ViewFrame& procedure, glm::dvec3 point)
{
    std::array<ViewFrame, 3> frames;
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const Standard& s = standards[i];
        const glm::dvec3 centre = procedure.centre + glm::dot(point - procedure.centre, s.towards) * s.towards;
        frames[i] = {s.right, s.up, s.towards, centre, procedure.extent};
    }
    return frames;
}

ViewFrame through(const ViewFrame& frame, glm::dvec3 tip, glm::dvec3 axis)
{
    ViewFrame turned = frame;
    const double length = glm::length(axis);
    const glm::dvec3 towards = length > 0 ? acrossOf(frame.towards, axis / length) : frame.towards;
    // Nearly end on there is no such plane: keep the planned one.
    constexpr double least = 0.3;
    if (glm::length(towards) > least) {
        turned.towards = glm::normalize(towards);
        turned.up = glm::normalize(acrossOf(frame.up, turned.towards));
        turned.right = glm::cross(turned.up, turned.towards);
    }
    turned.centre += glm::dot(tip - turned.centre, turned.towards) * turned.towards;
    return turned;
}

std::string side(glm::dvec3 d)
{
    std::array<std::pair<double, char>, 3> parts{
        {{std::abs(d.x), d.x > 0 ? 'L' : 'R'}, {std::abs(d.y), d.y > 0 ? 'P' : 'A'}, {std::abs(d.z), d.z > 0 ? 'S' : 'I'}}};
    std::sort(parts.begin(), parts.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
    std::string letters(1, parts[0].second);
    constexpr double oblique = 0.42;  // 25 degrees
    if (parts[1].first > oblique)
        letters += parts[1].second;
    return letters;
}

glm::dvec3 cameraDirection(const channel::Scenery& scenery, const ViewFrame& frame)
{
    const glm::dvec3 line = vec(scenery.aim) - vec(scenery.entry);
    if (glm::length(line) < 1e-4)
        return glm::normalize(frame.towards + 0.35 * frame.up + 0.30 * frame.right);
    const glm::dvec3 across = glm::normalize(glm::cross(glm::normalize(line), frame.towards));
    const bool flipped = glm::dot(across, frame.right + frame.up) < 0;
    return glm::normalize(frame.towards + (flipped ? -0.30 : 0.30) * across);
}

}  // namespace palpate::render
