#pragma once

#include <reference/label_pieces.h>
#include <reference/mesher.h>
#include <reference/smooth_labels.h>
#include <reference/solve.h>
#include <reference/tet_mesh.h>

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

/// Tetrahedra that stand for more than one tissue.
struct Mixtures {
    std::vector<Material> materials;  // numbered on from the rows of the tissue table
    std::vector<double> volume;       // of each region in all tetrahedra, by share [m^3] (regions x 1)
};

/// Gives every tetrahedron with regions in it that were left out there (SmoothLabels::within) a material between theirs:
/// the root of the arithmetic times the harmonic mean of Young's modulus, and the means of the rest, by volume. Rounded to
/// 5 % of Young's modulus, so that there are few.
Mixtures mixTissues(const SmoothLabels& labels, const volume::TissueTable& table, TetMesh& mesh);

}  // namespace palpate::reference
