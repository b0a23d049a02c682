#pragma once

#include <reference/smooth_labels.h>

#include <vector>

namespace palpate::reference {

/// Lines that a mesh has to follow: on the body's flat sides, where two of these meet, and where regions meet, or the body
/// ends. Each runs from one point where lines meet to another, or around to where it began [m].
/// @param shortest  lines that are shorter become a point [voxels]
std::vector<std::vector<Vec3>> sharpEdges(const SmoothLabels& labels, double shortest);

}  // namespace palpate::reference
