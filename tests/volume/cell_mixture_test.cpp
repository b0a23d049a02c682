#include <volume/cell_mixture.h>

#include "bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <span>
#include <utility>
#include <vector>

namespace palpate::volume {
namespace {

struct Part {
    double fraction, modulus, b;
};

double meanOf(std::span<const Part> parts)
{
    StiffeningMean mean;
    for (const Part& p : parts) {
        mean.add(p.fraction, p.modulus, p.b);
    }
    return mean.mean();
}

// Strain of a part with the stress E e (1 + b e^2), e.g. of W = E/2 (e^2 + b/2 e^4).
double strainAt(const Part& part, double stress)
{
    double e = stress / part.modulus;
    for (int i = 0; i < 50; ++i) {
        e -= (part.modulus * e * (1.0 + part.b * e * e) - stress) / (part.modulus * (1.0 + 3.0 * part.b * e * e));
    }
    return e;
}

// Layers one upon the other: stress over strain is E_R (1 + b_R e^2), with E_R the harmonic mean and b_R what the mean is,
// times by how much more the softer layer is strained than the whole.
TEST(StiffeningMean, OfLayersInSeriesIsWhatTheirStressHas)
{
    for (const auto& parts : {std::array<Part, 2>{{{0.5, 3e3, 0.0}, {0.5, 42e3, 18.0}}},
                              std::array<Part, 2>{{{0.25, 3e3, 2.2}, {0.75, 10e3, 18.0}}},
                              std::array<Part, 2>{{{0.9, 5e3, -0.2}, {0.1, 6e3, 7.0}}}}) {
        double compliance = 0.0, more = 0.0;
        for (const Part& p : parts) {
            compliance += p.fraction / p.modulus;
        }
        for (const Part& p : parts) {
            more += p.fraction * std::pow(1.0 / (compliance * p.modulus), 3);
        }
        const double stress = 1e-3 / compliance;  // at a strain of about a thousandth
        double strain = 0.0;
        for (const Part& p : parts) {
            strain += p.fraction * strainAt(p, stress);
        }
        const double found = (stress * compliance / strain - 1.0) / (strain * strain);
        EXPECT_NEAR(found, more * meanOf(parts), 1e-3 * more * std::max(1.0, std::abs(meanOf(parts))));
    }
}

TEST(StiffeningMean, IsBetweenItsPartsAndTheSofterOneDecides)
{
    std::minstd_rand random(7);
    std::uniform_real_distribution<double> unit(0.01, 1.0);
    for (int trial = 0; trial < 1000; ++trial) {
        std::vector<Part> parts;
        double low = 1e9, high = -1e9;
        for (int i = 0; i < 1 + trial % 5; ++i) {
            parts.push_back({unit(random), 1e3 * std::pow(1e4, unit(random)), 20.0 * unit(random) - 0.25});
            low = std::min(low, parts.back().b);
            high = std::max(high, parts.back().b);
        }
        const double mean = meanOf(parts);
        EXPECT_GE(mean, low - 1e-9);
        EXPECT_LE(mean, high + 1e-9);
        std::ranges::reverse(parts);
        EXPECT_NEAR(meanOf(parts), mean, 1e-9);
    }
    // A tenth of fat in a cell of carcinoma: the cell's strain is the fat's.
    EXPECT_LT(meanOf(std::array<Part, 2>{{{0.1, 3e3, 0.0}, {0.9, 42e3, 18.0}}}), 0.1);
    EXPECT_NEAR(meanOf(std::array<Part, 2>{{{0.3, 3e3, 5.0}, {0.7, 42e3, 5.0}}}), 5.0, 1e-12);
    EXPECT_EQ(meanOf({}), 0.0);
}

// Layers side by side add their stiffness; what stands for the cell otherwise is the root of that times the harmonic mean.
// A part that is held counts in neither.
TEST(CellMixture, KnowsTheStiffnessOfItsLayersAlongTheirPlane)
{
    TissueRow soft, stiff;
    soft.youngsModulus = 2e3;
    stiff.youngsModulus = 80e3;
    for (const double share : {0.1, 0.5, 0.9}) {
        for (const double held : {0.0, 0.25}) {
            CellMixture mixture;
            mixture.add(soft, (1.0 - held) * (1.0 - share), 1.0, false);
            mixture.add(stiff, (1.0 - held) * share, 1.0, false);
            mixture.add(stiff, held, 1.0, true);
            const double arithmetic = share * 80e3 + (1.0 - share) * 2e3;
            const double harmonic = 1.0 / (share / 80e3 + (1.0 - share) / 2e3);
            const CellMaterial material = mixture.material();
            EXPECT_NEAR(material.along, std::sqrt(arithmetic / harmonic), 1e-5) << share;
            EXPECT_NEAR(material.fixed, held, 1e-6);
            if (held <= 0.0) {
                EXPECT_NEAR(material.youngsModulus * material.along, arithmetic, 1e-2);
            }
        }
    }
}

// A layer in a cell, by samples: its middle and its share, however much stiffer it is, and wherever it lies.
TEST(CellMixture, KnowsWhereItsLayerLies)
{
    TissueRow soft, stiff;
    soft.youngsModulus = 3e3;
    constexpr int samples = 64;
    for (const double modulus : {6e3, 60e3}) {
        stiff.youngsModulus = modulus;
        for (const auto& [low, high] : std::to_array<std::pair<double, double>>({{-1.0, -0.5}, {-1.0, 0.5}, {0.0, 0.25}})) {
            CellMixture mixture;
            for (int i = 0; i < samples; ++i) {
                const double y = (2.0 * i + 1.0) / samples - 1.0;
                mixture.add(y > low && y < high ? stiff : soft, 1.0 / samples, 1.0, false, Vec3(0.0, y, 0.0));
            }
            const CellMaterial material = mixture.material();
            EXPECT_NEAR(material.middle.y, 0.5 * (low + high), 1e-5) << modulus << " " << low;
            EXPECT_NEAR(material.share, 0.5 * (high - low), 1e-5) << modulus << " " << low;
            EXPECT_EQ(material.middle.x, 0.0F);
        }
    }
    CellMixture plain;
    plain.add(soft, 1.0, 1.0, false);
    EXPECT_EQ(plain.material().share, 0.0F);
    EXPECT_EQ(plain.material().along, 1.0F);
}

// A layer at any place and angle, thin or thick, stiff or soft, has its own normal; tissues that are mixed have none.
TEST(CellMixture, KnowsTheNormalOfItsLayers)
{
    TissueRow fat, stiff;
    fat.youngsModulus = 3e3;
    stiff.youngsModulus = 60e3;
    constexpr int perEdge = 8;
    const auto fill = [&](const auto& isStiff) {
        CellMixture mixture;
        forEachIndex(Index3(0), Index3(perEdge - 1), [&](Index3 n) {
            const Vec3 at = (2.0 * Vec3(n) + 1.0) / static_cast<double>(perEdge) - 1.0;
            mixture.add(isStiff(at) ? stiff : fat, std::pow(perEdge, -3.0), 1.0, false, at);
        });
        return Vec3(mixture.material().normal);
    };
    for (const Vec3 n : {Vec3(1, 0, 0), Vec3(0, 0, 1), glm::normalize(Vec3(1, 2, 0)), glm::normalize(Vec3(-1, 1, 2))}) {
        for (const double middle : {0.0, 0.3, -0.6}) {
            for (const double half : {0.2, 0.35}) {
                const auto isInside = [&](Vec3 at) { return std::abs(glm::dot(at, n) - middle) < half; };
                EXPECT_GT(std::abs(glm::dot(fill(isInside), n)), std::cos(0.15)) << middle << " " << half;
                const auto isOutside = [&](Vec3 at) { return !isInside(at); };
                EXPECT_GT(std::abs(glm::dot(fill(isOutside), n)), std::cos(0.15)) << middle << " " << half;
            }
        }
        EXPECT_GT(std::abs(glm::dot(fill([&](Vec3 at) { return glm::dot(at, n) > 0.1; }), n)), std::cos(0.15));
    }
    std::minstd_rand random(4);
    for (int i = 0; i < 20; ++i) {
        EXPECT_EQ(fill([&](Vec3) { return random() % 3 == 0; }), Vec3(0.0));
    }
    EXPECT_EQ(fill([](Vec3) { return true; }), Vec3(0.0));
    EXPECT_EQ(fill([](Vec3 at) { return glm::length(at) < 0.6; }), Vec3(0.0));
}

// A plate of bone through soft tissue, 0 to 2 mm along an axis, of voxels of 1 mm.
Tissue bonePlate(int axis)
{
    const Index3 size(24);
    LabelImage image{size, bodies::centred({Mat3(1e-3), Vec3(0.0)}, size), {}};
    image.values.assign(image.offset({0, 0, size.z}), 1);
    forEachIndex(Index3(0), size - 1,
                 [&](Index3 n) { image.values[image.offset(n)] = n[axis] == 12 || n[axis] == 13 ? 300 : 1; });
    return Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
}

// Which eighths of an edge have their middle in the plate. @param start  of the edge [m]
unsigned plateOn(Vec3 start, double spacing, int along, int axis)
{
    unsigned on = 0;
    for (int k = 0; k < 8; ++k) {
        Vec3 at = start;
        at[along] += spacing * (k + 0.5) / 8.0;
        on |= at[axis] > 0.0 && at[axis] < 2e-3 ? 1U << k : 0U;
    }
    return on;
}

TEST(CellMixture, BoneLiesOnTheEdgesThatItCrosses)
{
    for (int axis = 0; axis < 3; ++axis) {
        const NodeGrid cells{Index3(4), Vec3(-4.2e-3), 3e-3};
        const auto materials = bonePlate(axis).materialOn(cells);
        for (std::size_t i = 0; i < materials.size(); ++i) {
            const Vec3 low = cells.position(cells.node(i)) - 1.5e-3;
            for (int e = 0; e < HeldParts::edgeCount && materials[i].fixed > 0.0F; ++e) {
                const unsigned on = plateOn(low + 3e-3 * Vec3(HeldParts::startOf(e)), 3e-3, e / 4, axis);
                EXPECT_EQ(materials[i].held.edges[static_cast<std::size_t>(e)], on) << axis << " " << i << " " << e;
            }
            const double from = std::max(0.0, low[axis]), to = std::min(2e-3, low[axis] + 3e-3);
            if (to - from > 0.5e-3) {
                Vec3 middle(0.0);
                middle[axis] = (0.5 * (from + to) - low[axis]) / 1.5e-3 - 1.0;
                EXPECT_LT(glm::length(Vec3(materials[i].held.middle) - middle), 0.2) << axis << " " << i;
            }
        }
    }
}

}  // namespace
}  // namespace palpate::volume
