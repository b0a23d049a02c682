#pragma once

#include <reference/smooth_labels.h>
#include <reference/solve.h>
#include <reference/tet_mesh.h>

#include <vector>

namespace palpate::reference {

/// How fine a mesh is, and where.
struct MeshOptions {
    Vec3 from{0.0}, to{0.0};    // where the contact begins and ends, on the surface at rest [m]
    double radius = 10e-3;      // around the line between them edges are as long as `size` [m]
    double size = 1.5e-3;       // [m]
    double growth = 0.25;       // how much longer edges are per metre further away [m/m]
    double largest = 10e-3;     // [m]
    double inside = 0;          // edges away from surfaces [m]; 0: as above
    double layer = 2.0;         // edges in a region are at most so many times as long as it is thick
    double resolution = 12.0;   // edges may be so many times as long as a tissue is thick before it is left out, or less
    std::size_t most = 50000;   // tetrahedra: more, and thin tissues far from the contact are mixed with what they lie in;
                                // with `surfacesOnly` points
    int volumePasses = 2;       // meshes made anew to keep the regions' volumes
    bool surfacesOnly = false;  // tetrahedra are good for nothing but their faces between regions: those are not refined
};

/// A body as tetrahedra, and what was kept of it.
struct BodyMesh {
    TetMesh mesh;
    std::vector<Material>
        mixtures;  // of tetrahedra that are no single tissue: TetMesh::tissue goes on with them after the table
    std::vector<std::uint8_t> rows;  // tissues                                            (regions x 1)
    std::vector<double> voxels;      // volume of each in voxels [m^3]                     (regions x 1)
    std::vector<double> volume;      // in tetrahedra [m^3]                                (regions x 1)
    double sharpest = 0;             // smallest dihedral angle [degrees]
    double dropped = 0;              // volume of pieces apart from the body [m^3]
};

/// Meshes the soft tissue of a volume. The same volume and options give the same mesh, bit for bit. Throws
/// std::runtime_error where there is no soft tissue, or nothing holds it.
///
/// CGAL's Mesh_3 samples the surfaces of all regions at once, from the function that says which region a point is in
/// (restricted Delaunay refinement). So neighbours share their border by construction, and nothing can cross itself: that
/// is what a mesher of given facets, as TetGen, leaves to the one who extracts them, who has to be careful at every line
/// where three tissues meet.
BodyMesh meshBody(const volume::Tissue& tissue, const MeshOptions& options);

/// Tetrahedra of all regions of `labels`, whose biases and reaches are changed so that volumes are kept; what lies on a
/// flat side is exactly there. Faces are left out.
TetMesh meshLabels(SmoothLabels& labels, const MeshOptions& options);

/// Edge length wanted at `p` [m], without regard to layers.
double edgeLength(const MeshOptions& options, Vec3 p) noexcept;

}  // namespace palpate::reference
