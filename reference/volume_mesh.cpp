#include <reference/volume_mesh.h>

#include <reference/label_pieces.h>
#include <reference/mesh_improve.h>
#include <reference/mesher.h>
#include <reference/smooth_labels.h>
#include <reference/surface_nets.h>

#include <algorithm>

#include <limits>

namespace palpate::reference {

namespace {

constexpr double resolution = 6.0;               // see MeshOptions
constexpr double maxLess = 0.8, maxMore = 1.25;  // of a volume that is asked for anew
constexpr double mendedAngle = 10.0;             // dihedral angles under it are mended where they can be [degrees]

Surfaces surfacesByCgal(SmoothLabels& labels, const VolumeMeshOptions& options)
{
    MeshOptions cgal;
    cgal.radius = std::numeric_limits<double>::infinity();  // as fine everywhere
    cgal.size = options.size;
    cgal.largest = options.largest;
    cgal.resolution = resolution;
    cgal.inside = options.largest;
    cgal.most = options.most;
    cgal.volumePasses = options.volumePasses;
    cgal.surfacesOnly = true;
    return surfacesOf(meshLabels(labels, cgal));
}

// Chords make what bulges too small: asks for as much more, and makes the nets again.
Surfaces surfacesByNets(SmoothLabels& labels, const VolumeMeshOptions& options)
{
    const auto crossing = [&](const Surfaces& s) { return crossingFacets(s, options.tetgen); };
    std::vector<double> wanted = labels.volume;
    for (int pass = 0; pass < options.volumePasses; ++pass) {
        // Where facets cross is a matter of the last one.
        const auto made = enclosedVolumes(
            surfaceNets(labels, options.size, [](const Surfaces&) { return std::vector<std::array<std::uint32_t, 3>>(); }));
        for (std::size_t r = 0; r < wanted.size(); ++r) {
            const double volume = made[labels.rows[r]];
            wanted[r] *= volume > 0.0 ? std::clamp(labels.volume[r] / volume, maxLess, maxMore) : 1.0;
        }
        fitVolumes(labels, wanted);
    }
    return surfaceNets(labels, options.size, crossing);
}

}  // namespace

VolumeMesh meshVolume(const volume::Tissue& tissue, const VolumeMeshOptions& options)
{
    options.progress("reading the volume");
    SmoothLabels labels = smoothLabels(tissue, Keep::all);
    std::vector<TissueQuality> tissues;
    const std::vector<double> thickness = thicknesses(labels);
    for (std::size_t r = 0; r < labels.rows.size(); ++r) {
        tissues.push_back({labels.rows[r], labels.volume[r], 0.0, thickness[r]});
    }
    options.progress("surfaces between tissues");
    const Surfaces surfaces =
        options.surface == SurfaceKind::nets ? surfacesByNets(labels, options) : surfacesByCgal(labels, options);
    options.progress("tetrahedra");
    TetGenOptions tetgen = options.tetgen;
    tetgen.largest = options.largest;
    VolumeMesh out;
    out.mesh = fillSurfaces(surfaces, tetgen);
    options.progress("small angles");
    improveAngles(out.mesh, mendedAngle, Moving::surfaces);
    out.quality = qualityOf(out.mesh, std::move(tissues), options.size);
    return out;
}

}  // namespace palpate::reference
