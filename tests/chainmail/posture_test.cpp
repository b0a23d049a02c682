#include "elastic_bodies.h"

#include <chainmail/loaded_body.h>
#include <chainmail/posture.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <functional>
#include <string>

namespace palpate::chainmail {
namespace {

using tests::errorOf;
using volume::LabelImage;
using volume::Tissue;

constexpr double g = 9.81;          // [m/s^2]
constexpr double voxel = 1e-3;      // [m]
constexpr double density = 1000.0;  // [kg/m^3]
enum Label : std::uint16_t { air, soft, bone, grain };

volume::TissueTable table(double youngsModulus, double poisson)
{
    volume::TissueTable out;
    out.name = "test";
    const auto row = [&](const char* name, volume::Role role, double e, bool fixed) {
        volume::TissueRow r;
        r.name = name;
        r.role = role;
        r.youngsModulus = e;
        r.poissonRatio = poisson;
        r.density = density;
        r.fixed = fixed;
        r.compress = 0.5;
        r.stretch = 2;
        out.rows.push_back(r);
    };
    row("air", volume::Role::air, 0, false);
    row("soft", volume::Role::plain, youngsModulus, false);
    row("bone", volume::Role::bone, 1e6, true);
    row("grain", volume::Role::tumour, youngsModulus, false);
    return out;
}

// Voxels with their middles at half-odd millimetres from `low` to `high` [voxels], labelled by their middle [m].
Tissue volumeOf(Index3 low, Index3 high, const volume::TissueTable& rows, const std::function<Label(Vec3)>& labelAt)
{
    LabelImage image;
    image.size = high - low;
    image.affine = {Mat3(voxel), voxel * (Vec3(low) + 0.5)};
    image.values.reserve(image.offset({0, 0, image.size.z}));
    volume::forEachIndex(Index3(0), image.size - 1,
                         [&](Index3 n) { image.values.push_back(labelAt(image.affine.toPatient(Vec3(n)))); });
    const std::vector<volume::LabelName> names{
        {air, "air", "air"}, {soft, "soft", "soft"}, {bone, "bone", "bone"}, {grain, "grain", "grain"}};
    return Tissue::fromLabels(image, rows, names, {});
}

bool within(Vec3 p, Vec3 low, Vec3 high)
{
    return glm::all(glm::greaterThan(p, low)) && glm::all(glm::lessThan(p, high));
}

// A bar of 16 x 16 mm below a plate of bone; z up. In place of z it lies along `axis`.
constexpr double barLength = 0.06;
Tissue bar(double youngsModulus, double poisson, double length = barLength, int axis = 2)
{
    const auto turned = [axis](Index3 v) { return Index3(v[(2 - axis) % 3], v[(3 - axis) % 3], v[(4 - axis) % 3]); };
    const Index3 low(-14, -14, -30 - static_cast<int>(std::lround(length / voxel)));
    return volumeOf(turned(low), turned({14, 14, 12}), table(youngsModulus, poisson), [=](Vec3 q) {
        const Vec3 p(q[(axis + 1) % 3], q[(axis + 2) % 3], q[axis]);
        if (within(p, {-0.008, -0.008, -length}, {0.008, 0.008, 0.0})) {
            return soft;
        }
        return within(p, {-0.012, -0.012, 0.0}, {0.012, 0.012, 0.008}) ? bone : air;
    });
}
const Vec3 down(0, 0, -g), up(0, 0, g);

double largestShift(const PostureMap& map)
{
    double most = 0.0;
    volume::forEachIndex(Index3(0), map.nodes.size - 2, [&](Index3 c) {
        if (map.filled[map.nodes.offset(c)] == 2) {
            volume::forEachIndex(c, c + 1, [&](Index3 n) {
                const std::size_t at = map.nodes.offset(n);
                most = std::max(most, glm::length(map.now[at] - map.taken[at]));
            });
        }
    });
    return most;
}

std::uint64_t voxelsOf(const Tissue& tissue, std::string_view name)
{
    for (const volume::Structure& s : tissue.structures()) {
        if (s.name == name) {
            return s.voxels;
        }
    }
    return 0;
}

// Lateral contraction aside (nu = 0), a section at depth z below the clamp sinks by rho g (L z - z^2 / 2) / E.
TEST(Posture, AHangingBarStretchesByRhoGLSquaredOverTwoE)
{
    constexpr double e = 60e3;
    const Tissue tissue = bar(e, 0.0);
    const Posture posture = postureOf(tissue, {Vec3(0.0), down});
    for (const double z : {0.02, 0.04, 0.06}) {
        const double sinks = density * g * (barLength * z - 0.5 * z * z) / e;
        const Vec3 to = posture.map.moved({0, 0, -z}).value();
        EXPECT_NEAR(-to.z - z, sinks, 0.02 * sinks) << z;
        EXPECT_NEAR(to.x, 0.0, 5e-6);
    }
    EXPECT_NEAR(posture.figures.weight, density * g * barLength * 0.016 * 0.016, 0.05 * posture.figures.weight);
}

// A bar that points sideways bends by q L^4 / 8 E I + q L^2 / 2 k G A (S. Timoshenko, Phil. Mag. 41, 1921; k = 5/6), along
// each axis. Where it is slender, displacements in single precision shake the nodes by more than a thousandth of their
// weight.
TEST(Posture, ASlenderBarBendsAlongEachAxis)
{
    constexpr double e = 1e6, nu = 0.45, side = 0.016, slender = 0.1;
    const double q = density * g * side * side, inertia = std::pow(side, 4) / 12.0;
    const double bends = q * std::pow(slender, 4) / (8.0 * e * inertia) +
                         q * slender * slender / (2.0 * 5.0 / 6.0 * e / (2.0 * (1.0 + nu)) * side * side);
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 tip(0.0), sideways(0.0);
        tip[axis] = -slender;
        sideways[(axis + 1) % 3] = g;
        const Posture posture = postureOf(bar(e, nu, slender, axis), {Vec3(0.0), sideways});
        EXPECT_NEAR(posture.map.moved(tip).value()[(axis + 1) % 3], bends, 0.08 * bends) << axis;
    }
}

// Standing on the plate it is compressed by as much.
TEST(Posture, ZeroGravityMovesNothingAndTheOtherWayUpIsTheOtherWay)
{
    const Tissue tissue = bar(60e3, 0.0);
    EXPECT_LT(largestShift(postureOf(tissue, {Vec3(0.0), Vec3(0.0)}).map), 1e-12);
    const double hangs = -postureOf(tissue, {Vec3(0.0), down}).map.moved({0, 0, -barLength})->z;
    const double stands = -postureOf(tissue, {Vec3(0.0), up}).map.moved({0, 0, -barLength})->z;
    EXPECT_NEAR(hangs - barLength, barLength - stands, 0.02 * (hangs - barLength));
}

TEST(LoadedBody, WhatHoldsTheFixedNodesCarriesTheLoad)
{
    constexpr double e = 20e3, h = 2e-3, force = 2e-3;
    const auto block = tests::heldBlock({6, 10, 6}, h, e, 0.0);
    const ElasticBody body = tests::bodyOf(block);
    LoadedBody loaded(body);
    Vec3 sum(0.0);
    volume::forEachIndex(Index3(0), body.levels[0].nodes.size - 1, [&](Index3 n) {
        if (body.levels[0].diagonal[body.levels[0].nodes.offset(n)] > 0.0F &&
            body.levels[0].fixed[body.levels[0].nodes.offset(n)] == 0) {
            loaded.load(n, {force, 2 * force, -force});
            sum += Vec3(force, 2 * force, -force);
        }
    });
    const auto outcome = loaded.solve(1e-8, 200);
    EXPECT_TRUE(outcome.balanced);
    EXPECT_LT(glm::length(loaded.reaction() + sum), 5e-3 * glm::length(sum));
}

// The unloaded shape, loaded again as the volume was taken, is the volume; though its tip is 9 mm away.
TEST(Posture, UnloadedAndLoadedAgainIsTheVolumeWithinATenthOfAVoxel)
{
    const Tissue tissue = bar(2.5e3, 0.45);
    const Posture again = postureOf(tissue, {down, down});
    EXPECT_GT(again.figures.rounds, 1);
    EXPECT_LE(again.figures.residual, 0.1 * voxel);
    for (double z = -barLength; z < 0.0; z += 5e-3) {
        for (const double x : {-0.008, 0.0, 0.008}) {
            const Vec3 p(x, 0.5 * x, z);
            EXPECT_LE(glm::length(again.map.moved(p).value() - p), 0.1 * voxel) << z;
        }
    }
    const Posture unloaded = postureOf(tissue, {down, Vec3(0.0)});
    EXPECT_LT(unloaded.map.moved({0, 0, -barLength})->z + barLength, 9e-3);
    EXPECT_GT(unloaded.map.moved({0, 0, -barLength})->z + barLength, 4e-3);
}

// Sagged as voxels and taken back, the bar is what it was before: to half a voxel, which its labels are good for.
TEST(Posture, WhatSaggedAsVoxelsComesBack)
{
    const Tissue tissue = bar(5e3, 0.45);
    const Posture sagged = postureOf(tissue, {Vec3(0.0), down});
    const Vec3 tip = sagged.map.moved({0, 0, -barLength}).value();
    EXPECT_LT(tip.z, -barLength - 2.5e-3);
    const Tissue taken = inPosture(tissue, sagged.map, "test");
    constexpr double halfVoxelOfItsSurface = 0.5 * (4 * 16 * 60 + 16 * 16);
    EXPECT_NEAR(static_cast<double>(voxelsOf(taken, "soft")), static_cast<double>(voxelsOf(tissue, "soft")),
                halfVoxelOfItsSurface);
    EXPECT_EQ(voxelsOf(taken, "bone"), voxelsOf(tissue, "bone"));
    const Posture back = postureOf(taken, {down, Vec3(0.0)});
    EXPECT_NEAR(back.map.moved(tip)->z, -barLength, 0.5 * voxel);
}

// An arm that sticks out to one side, turned with its gravity by a quarter about z.
TEST(Posture, ATurnedBodyUnderTurnedGravityIsTheTurnedShape)
{
    const auto arm = [](Vec3 p) {
        if (within(p, {-0.008, -0.008, -0.012}, {0.04, 0.008, 0.0})) {
            return soft;
        }
        return within(p, {-0.008, -0.012, 0.0}, {0.008, 0.008, 0.008}) ? bone : air;
    };
    const auto turned = [](Vec3 p) { return Vec3(-p.y, p.x, p.z); };
    const auto back = [](Vec3 p) { return Vec3(p.y, -p.x, p.z); };
    const auto rows = table(10e3, 0.45);
    const Tissue straight = volumeOf({-50, -50, -40}, {50, 50, 16}, rows, arm);
    const Tissue other = volumeOf({-50, -50, -40}, {50, 50, 16}, rows, [&](Vec3 p) { return arm(back(p)); });
    const Vec3 aslant(3.0, 2.0, -9.0);
    const Posture a = postureOf(straight, {Vec3(0.0), aslant}), b = postureOf(other, {Vec3(0.0), turned(aslant)});
    double largest = 0.0;
    for (const Vec3 p : {Vec3(0.039, 0.0, -0.006), Vec3(0.03, 0.006, -0.01), Vec3(0.01, 0.0, -0.011)}) {
        const Vec3 moved = a.map.moved(p).value();
        largest = std::max(largest, glm::length(moved - p));
        EXPECT_LT(glm::length(b.map.moved(turned(p)).value() - turned(moved)), 0.02 * voxel);
    }
    EXPECT_GT(largest, 3 * voxel);
}

// At nu = 0.49 the bulk modulus is 16 E: a pressure of some tenths of E takes a percent.
TEST(Posture, TissueThatIsNearlyIncompressibleKeepsItsVolume)
{
    const Tissue tissue = bar(2.5e3, 0.49);
    const PostureMap map = postureOf(tissue, {Vec3(0.0), down}).map;
    double before = 0.0, after = 0.0;
    const auto volumeOfCell = [&](const std::vector<Vec3>& at, Index3 c) {
        double sum = 0.0;  // by the slopes at the eight Gauss points
        volume::forEachIndex(Index3(0), Index3(1), [&](Index3 q) {
            const Vec3 x = 0.5 + (Vec3(q) - 0.5) / std::sqrt(3.0);
            Mat3 slope(0.0);
            for (int k = 0; k < 8; ++k) {
                const Index3 side(k & 1, k >> 1 & 1, k >> 2);
                for (int axis = 0; axis < 3; ++axis) {
                    double w = side[axis] != 0 ? 1.0 : -1.0;
                    for (int other = 0; other < 3; ++other) {
                        w *= other == axis ? 1.0 : side[other] != 0 ? x[other] : 1.0 - x[other];
                    }
                    slope[axis] += w * at[map.nodes.offset(c + side)];
                }
            }
            sum += 0.125 * glm::determinant(slope);
        });
        return sum;
    };
    volume::forEachIndex(Index3(0), map.nodes.size - 2, [&](Index3 c) {
        if (map.filled[map.nodes.offset(c)] == 2 &&
            within(map.nodes.position(c), {-0.0081, -0.0081, -barLength - 1e-4}, {0.0039, 0.0039, -1e-4})) {
            before += volumeOfCell(map.taken, c);
            after += volumeOfCell(map.now, c);
        }
    });
    EXPECT_GT(largestShift(map), 5 * voxel);
    EXPECT_NEAR(after / before, 1.0, 0.01);
}

// Tissue that runs to the border of the volume on all sides goes on beyond it, held: only its middle sags.
TEST(Posture, WhatTheBorderCutsIsHeld)
{
    const Tissue sheet = volumeOf({-40, -40, -20}, {40, 40, 20}, table(5e3, 0.45),
                                  [](Vec3 p) { return std::abs(p.z) < 0.008 ? soft : air; });
    const Posture posture = postureOf(sheet, {Vec3(0.0), down});
    const double middle = posture.map.moved({0, 0, 0})->z;
    EXPECT_LT(middle, -0.5e-3);
    EXPECT_GT(posture.map.moved({0.0395, 0, 0})->z, 0.1 * middle);
    const Tissue moved = inPosture(sheet, posture.map, "test");
    EXPECT_EQ(moved.size().x, sheet.size().x);
}

// An image whose value is the height [mm] has after the move, where tissue is now, the height that it comes from.
TEST(Posture, TheImageMovesWithTheTissue)
{
    const Tissue plain = bar(5e3, 0.45);
    LabelImage labels = plain.labels();
    volume::CompanionImage image;
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        image.values.push_back(static_cast<float>(1e3 * labels.affine.toPatient(Vec3(n)).z));
    });
    const std::vector<volume::LabelName> names{{air, "air", "air"}, {soft, "soft", "soft"}, {bone, "bone", "bone"}};
    const Tissue tissue = Tissue::fromLabels(labels, plain.table(), names, {}, &image);
    const Posture posture = postureOf(tissue, {Vec3(0.0), down});
    const Tissue moved = inPosture(tissue, posture.map, "test");
    const LabelImage after = moved.labels();
    const auto values = moved.companion().value().values;
    for (const double z : {-0.01, -0.03, -0.05}) {
        const Vec3 to = posture.map.moved({0.0005, 0.0005, z}).value();
        const Index3 n(glm::floor(after.affine.toIndex(to) + 0.5));
        EXPECT_NEAR(static_cast<double>(values[after.offset(n)]), 1e3 * z, 0.6) << z;
        EXPECT_LT(to.z, z - 0.5e-3);
    }
}

// A structure of one voxel moves by what its tissue moves by, and is not lost.
TEST(Posture, StructuresMoveWithTheTissueAndSmallOnesAreKept)
{
    const Vec3 at(0.0005, 0.0005, -0.0495);
    const Tissue tissue = volumeOf({-14, -14, -90}, {14, 14, 12}, table(5e3, 0.45), [&](Vec3 p) {
        if (glm::length(p - at) < 1e-6) {
            return grain;
        }
        if (within(p, {-0.008, -0.008, -barLength}, {0.008, 0.008, 0.0})) {
            return soft;
        }
        return within(p, {-0.012, -0.012, 0.0}, {0.012, 0.012, 0.008}) ? bone : air;
    });
    const Posture posture = postureOf(tissue, {Vec3(0.0), down});
    const Tissue moved = inPosture(tissue, posture.map, "by a test");
    ASSERT_GE(voxelsOf(moved, "grain"), 1U);
    const Vec3 to = posture.map.moved(at).value();
    EXPECT_LT(to.z, at.z - 1.5 * voxel);
    const LabelImage image = moved.labels();
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        if (image.values[image.offset(n)] == grain) {
            EXPECT_LT(glm::length(image.affine.toPatient(Vec3(n)) - to), 1.5 * voxel);
        }
    });
    EXPECT_EQ(moved.provenance().back(), (std::pair<std::string, std::string>("gravity", "by a test")));
    EXPECT_FALSE(posture.map.moved({0.1, 0, 0}).has_value());
}

// A crumb in air has nothing to hold it, and no equilibrium: it goes with the tissue beside it.
TEST(Posture, APieceThatNothingHoldsGoesWithWhatIsNearest)
{
    const Tissue tissue = volumeOf({-14, -14, -90}, {14, 14, 12}, table(5e3, 0.45), [&](Vec3 p) {
        if (within(p, {-0.004, -0.004, -barLength}, {0.004, 0.004, 0.0}) ||
            within(p, {-0.003, -0.003, -0.085}, {0.003, 0.003, -0.079})) {
            return soft;
        }
        return within(p, {-0.012, -0.012, 0.0}, {0.012, 0.012, 0.008}) ? bone : air;
    });
    const Posture posture = postureOf(tissue, {Vec3(0.0), down});
    const double tip = posture.map.moved({0, 0, -barLength})->z + barLength;
    EXPECT_LT(tip, -voxel);
    EXPECT_NEAR(posture.map.moved({0, 0, -0.082})->z + 0.082, tip, 0.1 * voxel);
}

TEST(Posture, TissueTooSoftForItsWeightIsRefusedInOneLine)
{
    const Tissue tissue = bar(60.0, 0.45);
    PostureSettings settings;
    settings.maxRounds = 4;
    const std::string error = errorOf([&] { postureOf(tissue, {down, Vec3(0.0)}, settings); });
    EXPECT_NE(error.find("weight"), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace palpate::chainmail
