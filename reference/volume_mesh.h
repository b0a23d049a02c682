#pragma once

#include <reference/mesh_quality.h>
#include <reference/tet_mesh.h>
#include <reference/tetgen_mesh.h>
#include <volume/tissue.h>

#include <functional>
#include <string>

namespace palpate::reference {

/// Where the surfaces between tissues come from: CGAL's Mesh_3, or surface nets on voxels of the mesh's size.
enum class SurfaceKind : std::uint8_t { cgal, nets };

struct VolumeMeshOptions {
    double size = 3e-3;     // edges of facets [m]; shorter where a tissue is thin
    double largest = 7e-3;  // edges of tetrahedra away from facets [m]
    SurfaceKind surface = SurfaceKind::cgal;
    std::size_t most = 80000;  // points on surfaces by CGAL: more, and facets of thin tissues become coarser
    int volumePasses = 2;      // surfaces made anew to keep the tissues' volumes
    TetGenOptions tetgen;
    std::function<void(const std::string&)> progress = [](const std::string&) {};
};

struct VolumeMesh {
    TetMesh mesh;  // all tissue but air, bone too
    MeshQuality quality;
};

/// Tetrahedra of all tissues of a volume, one region per tissue. The same volume and options give the same mesh, bit for
/// bit. Throws std::runtime_error where there is no tissue, or TetGen fails.
VolumeMesh meshVolume(const volume::Tissue& tissue, const VolumeMeshOptions& options);

}  // namespace palpate::reference
