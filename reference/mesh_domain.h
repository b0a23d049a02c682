#pragma once

#include <reference/label_pieces.h>
#include <reference/mesher.h>
#include <reference/smooth_labels.h>

#include <optional>
#include <span>
#include <vector>

namespace palpate::reference {

/// Bounds on the facets around each region, so that thin ones keep their shape [m] (regions x 1).
struct RegionBounds {
    std::vector<double> edge;      // longest
    std::vector<double> distance;  // of a facet's middle from the surface
};

/// Tetrahedra of all regions, in one mesh; faces are left out. Every piece that has a seed is in it.
/// @param maxPoints  gives up with nothing when there are more; 0: never
std::optional<TetMesh> meshRegions(const SmoothLabels& labels, std::span<const RegionSeed> seeds,
                                   const MeshOptions& options, const RegionBounds& bounds, std::size_t maxPoints);

}  // namespace palpate::reference
