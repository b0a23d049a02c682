#pragma once

#include <glm/vec3.hpp>

#include <vector>

namespace palpate::render {

/// Where the tool of another session in the same anatomy was: an expert's, beside one's own.
struct GhostPose {
    double time = 0;        // of that session [s]
    glm::dvec3 tip{0.0};    // [m]
    glm::dvec3 axis{0.0};   // unit vector, from the shaft to the tip
    bool inserted = false;  // into the body
};

/// All of them, in order of time.
using Ghost = std::vector<GhostPose>;

/// The pose at a time; the last one after the end. @pre  not empty
const GhostPose& at(const Ghost& ghost, double time) noexcept;

}  // namespace palpate::render
