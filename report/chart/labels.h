#pragma once

#include <glm/vec2.hpp>

#include <span>
#include <vector>

namespace palpate::report {

/// A text beside a point of a chart [px]; y grows upwards.
struct PointLabel {
    glm::dvec2 point{0.0};
    glm::dvec2 size{0.0};  // of the text
};

/// Places texts beside their points, one after the other, each where it covers the least of the texts before it and of
/// markers. A text with room above and to the right of its point stands there.
///
/// @param markers  middles of all markers [px]
/// @return where the left end of each text's middle line goes, from its point [px]
std::vector<glm::dvec2> placedLabels(std::span<const PointLabel> labels, std::span<const glm::dvec2> markers);

}  // namespace palpate::report
