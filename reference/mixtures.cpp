#include <reference/mixtures.h>

#include <reference/mesh_parts.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>

namespace palpate::reference {

namespace {

constexpr double whole = 0.98;     // share from which on a tetrahedron is one tissue
constexpr double rounding = 0.05;  // of the logarithm of Young's modulus
constexpr int samples = 64;        // points at which a tetrahedron is looked into

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

}  // namespace palpate::reference
