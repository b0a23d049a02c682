#pragma once

#include <reference/smooth_labels.h>
#include <reference/solve.h>
#include <reference/tet_mesh.h>

#include <vector>

namespace palpate::reference {

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
