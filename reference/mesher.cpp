#include <reference/mesher.h>

#include <base/error.h>
#include <reference/label_pieces.h>
#include <reference/mesh_domain.h>
#include <reference/mesh_parts.h>
#include <reference/mesh_quality.h>
#include <reference/refill.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

namespace palpate::reference {

namespace {

constexpr double whole = 0.98;              // share from which on a tetrahedron is one tissue
constexpr double rounding = 0.05;           // of the logarithm of Young's modulus
constexpr int samples = 64;                 // points at which a tetrahedron is looked into
constexpr std::size_t mostMaterials = 256;  // that TetMesh::tissue can number

// Points spread evenly over a tetrahedron, in barycentric coordinates: an additive sequence in the unit cube, sorted.
// Source: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018.
std::vector<std::array<double, 4>> samplePoints()
{
    constexpr double phi = 1.2207440846057596;  // phi^4 = phi + 1
    std::vector<std::array<double, 4>> points;
    for (int n = 1; n <= samples; ++n) {
        std::array<double, 3> cut{};
        for (int i = 0; i < 3; ++i) {
            cut[static_cast<std::size_t>(i)] = std::fmod(0.5 + n / std::pow(phi, i + 1), 1.0);
        }
        std::ranges::sort(cut);
        points.push_back({cut[0], cut[1] - cut[0], cut[2] - cut[1], 1.0 - cut[2]});
    }
    return points;
}

// Fraction of each region in a tetrahedron.
std::vector<double> sharesIn(const SmoothLabels& all, const TetMesh& mesh, std::size_t tet)
{
    static const auto points = samplePoints();
    std::vector<double> fractions(all.rows.size(), 0.0);
    for (const auto& weight : points) {
        Vec3 p(0.0);
        for (std::size_t i = 0; i < 4; ++i) {
            p += weight[i] * mesh.points[mesh.tets[tet][i]];
        }
        if (const int region = regionAt(all, p); region >= 0) {
            fractions[static_cast<std::size_t>(region)] += 1.0;
        }
    }
    const double sum = std::accumulate(fractions.begin(), fractions.end(), 0.0);
    std::ranges::transform(fractions, fractions.begin(), [&](double s) { return sum > 0.0 ? s / sum : 0.0; });
    return fractions;
}

Material mixed(const SmoothLabels& labels, const volume::TissueTable& table, const std::vector<double>& fractions)
{
    double stiffness = 0.0, compliance = 0.0;
    Material m;
    for (std::size_t r = 0; r < fractions.size(); ++r) {
        const auto& row = table.rows[labels.rows[r]];
        stiffness += fractions[r] * row.youngsModulus;
        compliance += fractions[r] / row.youngsModulus;
        m.poisson += fractions[r] * row.poissonRatio;
        m.stiffening += fractions[r] * row.stiffening;
    }
    m.youngsModulus = std::sqrt(stiffness / compliance);
    return m;
}

// Tetrahedra of about one stiffness.
struct Bucket {
    std::vector<std::size_t> tets;
    Material sum;  // of log E, Poisson's ratio and stiffening, times volume
    double volume = 0;
};

bool leavesOut(const SmoothLabels& labels, const TetMesh& mesh, std::size_t tet)
{
    const auto& t = mesh.tets[tet];
    return std::ranges::any_of(t, [&](std::uint32_t p) {
        const double distance = distanceToLine(mesh.points[p], labels.from, labels.to);
        return std::ranges::any_of(labels.within, [&](double w) { return distance > w; });
    });
}

constexpr double volumeTolerance = 2e-3;  // of a region, below which it is not corrected
constexpr double minSeed = 0.5;           // volume of a piece worth a seed, in cubes of the edge length there

// How many times as long as a tissue is thick the edges around it may become, before it is left out: tried in turn.
constexpr std::array<double, 5> resolutions{12.0, 6.0, 4.0, 3.0, 2.0};

// Of a facet's middle from the surface, fraction of the thickness of what it bounds, times the resolution: facets get
// coarser where thin tissues are left out sooner.
constexpr double layerDistance = 1.2;

// Where each region is thick enough for the edges around it.
std::vector<double> reachOf(const std::vector<double>& thickness, double resolution, const MeshOptions& options)
{
    std::vector<double> within;
    for (const double t : thickness) {
        const double edge = resolution * t;
        const double reach = options.radius + (edge - options.size) / options.growth;
        within.push_back(edge >= options.largest ? std::numeric_limits<double>::infinity() : std::max(reach, 0.0));
    }
    return within;
}

// Volumes that the regions have by the labels, at eight points of every voxel [m^3].
std::vector<double> volumesIn(const SmoothLabels& labels)
{
    const double fraction = labels.affine.voxelVolume() / 8.0;
    std::vector<double> volume(labels.rows.size(), 0.0);
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        for (int i = 0; i < 8; ++i) {
            const Vec3 index = Vec3(n + labels.low) + countedAt(n, i);
            if (const int region = regionAt(labels, labels.affine.toPatient(index)); region >= 0) {
                volume[static_cast<std::size_t>(region)] += fraction;
            }
        }
    });
    return volume;
}

class BodyMesher {
public:
    BodyMesher(SmoothLabels& labels, const MeshOptions& options)
        : labels_(labels), options_(options), thickness_(thicknesses(labels))
    {
        std::ranges::transform(thickness_, std::back_inserter(bounds_.edge), [&](double t) { return options.layer * t; });
        labels_.from = options.from;
        labels_.to = options.to;
    }

    // Resolves thin tissues as far from the contact as the number of tetrahedra allows.
    TetMesh mesh()
    {
        std::optional<TetMesh> out;
        for (const double resolution : resolutions) {
            if (resolution > options_.resolution) {
                continue;
            }
            labels_.within = reachOf(thickness_, resolution, options_);
            bounds_.distance.clear();
            std::ranges::transform(thickness_, std::back_inserter(bounds_.distance),
                                   [&](double t) { return layerDistance / resolution * t; });
            out = once(resolution == resolutions.back() ? 0 : options_.most);
            if (out && (options_.surfacesOnly || out->tets.size() <= options_.most)) {
                break;
            }
        }
        return corrected(*std::move(out));
    }

private:
    std::optional<TetMesh> once(std::size_t maxPoints)
    {
        std::vector<RegionSeed> seeds = regionSeeds(labels_, 0.0);
        std::erase_if(
            seeds, [&](const RegionSeed& s) { return s.volume < minSeed * std::pow(edgeLength(options_, s.point), 3.0); });
        return meshRegions(labels_, seeds, options_, bounds_, maxPoints);
    }

    // Chords make regions that bulge too small: asks for as much more, and meshes again; the best mesh counts. Not for
    // those that are left out somewhere.
    TetMesh corrected(TetMesh best)
    {
        const std::vector<double> target = volumesIn(labels_);
        std::vector<double> wanted = labels_.volume, volume = volumesOf(best, labels_.rows);
        double least = squaredErrors(volume, target);
        for (int pass = 0; pass < options_.volumePasses; ++pass) {
            bool off = false;
            for (std::size_t r = 0; r < wanted.size(); ++r) {
                if (std::isinf(labels_.within[r]) && volume[r] > 0.0 &&
                    std::abs(volume[r] / target[r] - 1.0) > volumeTolerance) {
                    wanted[r] *= std::clamp(target[r] / volume[r], 0.8, 1.25);
                    off = true;
                }
            }
            if (!off) {
                break;
            }
            fitVolumes(labels_, wanted);
            TetMesh next = *once(0);
            volume = volumesOf(next, labels_.rows);
            if (const double error = squaredErrors(volume, target); error < least) {
                least = error;
                best = std::move(next);
            }
        }
        return best;
    }

    // Of the regions that are left out nowhere.
    double squaredErrors(const std::vector<double>& volume, const std::vector<double>& target) const
    {
        double sum = 0.0;
        for (std::size_t r = 0; r < volume.size(); ++r) {
            const double error = target[r] > 0.0 ? volume[r] / target[r] - 1.0 : 0.0;
            sum += std::isinf(labels_.within[r]) ? error * error : 0.0;
        }
        return sum;
    }

    SmoothLabels& labels_;
    const MeshOptions& options_;
    std::vector<double> thickness_;  // [m] (regions x 1)
    RegionBounds bounds_;
};

}  // namespace

Mixtures mixTissues(const SmoothLabels& labels, const volume::TissueTable& table, TetMesh& mesh)
{
    SmoothLabels all = labels;
    all.within.clear();
    std::vector<double> ofRow(table.rows.size(), 0.0);
    std::map<long, Bucket> buckets;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const double volume = sixVolumes(mesh, t) / 6.0;
        const auto fractions = leavesOut(labels, mesh, t) ? sharesIn(all, mesh, t) : std::vector<double>();
        const auto most = std::ranges::max_element(fractions);
        if (most == fractions.end() || *most == 0.0) {
            ofRow[mesh.tissue[t]] += volume;
            continue;
        }
        if (*most >= whole) {
            mesh.tissue[t] = labels.rows[static_cast<std::size_t>(most - fractions.begin())];
            ofRow[mesh.tissue[t]] += volume;
            continue;
        }
        for (std::size_t r = 0; r < fractions.size(); ++r) {
            ofRow[labels.rows[r]] += fractions[r] * volume;
        }
        const Material m = mixed(labels, table, fractions);
        Bucket& bucket = buckets[std::lround(std::log(m.youngsModulus) / rounding)];
        bucket.tets.push_back(t);
        bucket.volume += volume;
        bucket.sum.youngsModulus += volume * std::log(m.youngsModulus);
        bucket.sum.poisson += volume * m.poisson;
        bucket.sum.stiffening += volume * m.stiffening;
    }
    const std::size_t materials = table.rows.size() + buckets.size();
    base::failIf(
        materials > mostMaterials,
        "volume: {} rows of the tissue table and {} mixtures of thin tissues are more than {} materials: leave out "
        "rows that the volume does not need",
        table.rows.size(), buckets.size(), mostMaterials);
    Mixtures out;
    for (const auto& [step, bucket] : buckets) {
        for (const std::size_t t : bucket.tets) {
            mesh.tissue[t] = static_cast<std::uint8_t>(table.rows.size() + out.materials.size());
        }
        out.materials.push_back({std::exp(bucket.sum.youngsModulus / bucket.volume), bucket.sum.poisson / bucket.volume,
                                 bucket.sum.stiffening / bucket.volume});
    }
    std::ranges::transform(labels.rows, std::back_inserter(out.volume), [&](std::uint8_t row) { return ofRow[row]; });
    return out;
}

double edgeLength(const MeshOptions& options, Vec3 p) noexcept
{
    const double beyond = std::max(0.0, distanceToLine(p, options.from, options.to) - options.radius);
    return std::min(options.largest, options.size + options.growth * beyond);
}

TetMesh meshLabels(SmoothLabels& labels, const MeshOptions& options)
{
    TetMesh mesh = BodyMesher(labels, options).mesh();
    snapToSides(labels, mesh);
    return mesh;
}

BodyMesh meshBody(const volume::Tissue& tissue, const MeshOptions& options)
{
    return meshBody(tissue, options, [](const TetMesh& mesh) { return mesh; });
}

BodyMesh meshBody(const volume::Tissue& tissue, const MeshOptions& options, const Refill& refill)
{
    SmoothLabels labels = smoothLabels(tissue);
    BodyMesh body;
    body.rows = labels.rows;
    body.voxels = labels.volume;
    const std::vector<double> bias = labels.bias;
    body.mesh = refill(meshLabels(labels, options));
    body.dropped = keepLargestPiece(body.mesh);
    body.sharpest = smallestDihedral(body.mesh);
    labels.bias = bias;  // chords are no matter to a mixture
    Mixtures mixtures = mixTissues(labels, tissue.table(), body.mesh);
    body.mixtures = std::move(mixtures.materials);
    body.volume = std::move(mixtures.volume);
    addFaces(tissue, labels, body.mesh);
    base::failIf(std::ranges::none_of(body.mesh.faces, &TetMesh::Face::held),
                 "volume: no tissue that holds the body touches it: mark bone or chest wall as fixed");
    return body;
}

}  // namespace palpate::reference
