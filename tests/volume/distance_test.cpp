#include "bodies.h"

#include <volume/blurred_surface.h>
#include <volume/tissue.h>
#include <volume/voxel_distance.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

namespace palpate::volume {
namespace {

using namespace bodies;

Affine straight(Vec3 spacing)
{
    return {Mat3(spacing.x, 0, 0, 0, spacing.y, 0, 0, 0, spacing.z), Vec3(0.0)};
}

struct SphereCase {
    const char* name;
    Affine affine;
    Index3 size;
    double voxel;    // coarsest edge [m]
    double spacing;  // of the nodes [m]
};

std::vector<SphereCase> sphereCases()
{
    return {{"nodes as fine as voxels", centred(straight(Vec3(1e-3)), {80, 80, 80}), {80, 80, 80}, 1e-3, 1e-3},
            {"nodes twice as coarse", centred(straight(Vec3(1e-3)), {80, 80, 80}), {80, 80, 80}, 1e-3, 2e-3},
            {"nodes twice as fine", centred(straight(Vec3(2e-3)), {40, 40, 40}), {40, 40, 40}, 2e-3, 1e-3},
            {"oblique and left-handed",
             centred(oblique(Vec3(1e-3), Vec3(0.0), true), {80, 80, 80}),
             {80, 80, 80},
             1e-3,
             1.3e-3},
            {"oblique and anisotropic",
             centred(oblique({0.8e-3, 0.8e-3, 2.4e-3}, Vec3(0.0), false), {96, 96, 34}),
             {96, 96, 34},
             2.4e-3,
             1.5e-3}};
}

constexpr double radius = 0.0203;
const Vec3 centre(0.0011, -0.0007, 0.0004);

DistanceField sphereField(const SphereCase& c, const NodeGrid& grid)
{
    const LabelImage image = voxelise(c.size, c.affine, [](Vec3 p) { return glm::length(p - centre) < radius ? 7 : 1; });
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    return tissue.distanceTo(std::vector<std::uint16_t>{7}, grid);
}

// d(p) = |p - c| - R. Where the sphere is parallel to a face of the voxels, no reader of them can know it to better than
// half a voxel (or half a node spacing where that is more), and that stays so however far away; over all directions near
// the surface the root mean square is a fifth of it.
TEST(Distance, OfAVoxelisedSphereIsTheAnalyticOne)
{
    for (const SphereCase& c : sphereCases()) {
        const NodeGrid grid = coveringGrid({Vec3(-0.1), Vec3(0.1)}, c.spacing, 0);
        const DistanceField field = sphereField(c, grid);
        double near = 0;
        double squares = 0;
        double far = 0;
        double relative = 0;
        int count = 0;
        for (std::size_t i = 0; i < grid.count(); ++i) {
            const double d = glm::length(grid.position(grid.node(i)) - centre) - radius;
            const double error = std::abs(static_cast<double>(field.values[i]) - d);
            if (std::abs(d) < 5 * c.voxel) {
                near = std::max(near, error / c.voxel);
                squares += error * error / c.voxel / c.voxel;
                ++count;
            } else if (d > 0) {
                far = std::max(far, error / c.voxel);
                relative = std::max(relative, d > 2 * radius ? error / d : 0.0);
            }
        }
        const double rms = std::sqrt(squares / count);
        const double half = 0.5 * std::max(c.voxel, c.spacing) / c.voxel;
        // At the poles the voxels end in a flat cap, and know the ball to half of one: 0.518 is found.
        EXPECT_LT(near, 1.04 * half) << c.name;
        EXPECT_LT(rms, 0.09) << c.name;
        EXPECT_LT(far, half) << c.name;
        EXPECT_LT(relative, 0.025) << c.name;
    }
}

// Error of the body's surface [m], on places of a shape that voxels of edge `voxel` were filled with.
struct SurfaceError {
    double bias = 0, rms = 0, max = 0;
    double normal = 0;  // root mean square [rad]
};

// A box that is turned about z, far from its edges: planes that voxels cross obliquely.
SurfaceError errorOfTurnedBox(double degrees, double voxel, double spacing)
{
    constexpr double half = 18e-3;
    const double angle = degrees * std::numbers::pi / 180.0;
    const Vec3 n(std::sin(angle), std::cos(angle), 0.0), along(std::cos(angle), -std::sin(angle), 0.0);
    const auto inBox = [&](Vec3 p) {
        return std::max({std::abs(glm::dot(p, n)), std::abs(glm::dot(p, along)), std::abs(p.z)}) < half ? 1 : 0;
    };
    const Index3 size(static_cast<int>(std::lround(60e-3 / voxel)));
    const Tissue tissue =
        Tissue::fromLabels(voxelise(size, centred(straight(Vec3(voxel)), size), inBox), table(), names(), {});
    const DistanceField field = tissue.distanceToBody(coveringGrid(tissue.box(), spacing, 2 * spacing));
    SurfaceError error;
    std::mt19937 random(5);
    std::uniform_real_distribution<double> within(-0.6 * half, 0.6 * half);
    constexpr int count = 2000;
    for (int i = 0; i < count; ++i) {
        const Vec3 p = half * n + within(random) * along + Vec3(0.0, 0.0, within(random));
        const double e = field.at(p);
        const double lean = std::acos(std::min(1.0, glm::dot(field.normal(p), n)));
        error.bias += e / count;
        error.rms += e * e / count;
        error.max = std::max(error.max, std::abs(e));
        error.normal += lean * lean / count;
    }
    error.rms = std::sqrt(error.rms);
    error.normal = std::sqrt(error.normal);
    return error;
}

// A plane at any angle, and that of a body with sharp edges, which smoothing rounds: its faces stay where they are. Voxels
// of a quarter of a spacing leave steps of 0.5 mm, of which a twentieth may be felt, those of 1 mm in cells of 1 mm a
// ninth.
TEST(Distance, OfATurnedBoxIsThatOfItsPlanes)
{
    for (const double degrees : {0.0, 10.0, 17.0, 30.0, 40.0}) {
        const SurfaceError fine = errorOfTurnedBox(degrees, 0.5e-3, 2e-3);
        EXPECT_LT(std::abs(fine.bias), 0.025e-3) << degrees;
        EXPECT_LT(fine.rms, 0.04e-3) << degrees;
        EXPECT_LT(fine.max, 0.12e-3) << degrees;
        EXPECT_LT(fine.normal, 0.015) << degrees;
        const SurfaceError coarse = errorOfTurnedBox(degrees, 1e-3, 1e-3);
        EXPECT_LT(std::abs(coarse.bias), 0.03e-3) << degrees;
        EXPECT_LT(coarse.rms, 0.11e-3) << degrees;
        EXPECT_LT(coarse.normal, 0.05) << degrees;
    }
}

// A face along the faces of voxels is where these are, wherever it lies between the nodes: the tenth of a millimetre by
// which it was off there was a quarter of the force at first touch.
TEST(Distance, OfAFaceAlongVoxelsIsThereWhereverItLiesInTheGrid)
{
    constexpr double half = 18e-3;
    const auto inBox = [](Vec3 p) { return std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) < half ? 1 : 0; };
    for (const auto& [voxel, spacing] : {std::pair(1e-3, 1e-3), {1e-3, 2e-3}, {0.5e-3, 1.5e-3}, {2e-3, 1.5e-3}}) {
        const Index3 size(static_cast<int>(std::lround(60e-3 / voxel)));
        LabelImage image = voxelise(size, centred(straight(Vec3(voxel)), size), inBox);
        const Vec3 origin = image.affine.origin;
        const NodeGrid grid = coveringGrid({Vec3(-half), Vec3(half + 2e-3)}, spacing, 2 * spacing);
        for (double shift = 0.0; shift <= 2e-3; shift += 0.27e-3) {
            for (int axis = 0; axis < 3; ++axis) {
                Vec3 n(0.0);
                n[axis] = 1.0;
                image.affine.origin = origin + shift * n;
                const DistanceField field = Tissue::fromLabels(image, table(), names(), {}).distanceToBody(grid);
                const Vec3 p = (half + shift) * n + 0.3 * half * Vec3(n.y + n.z, n.z - n.x, n.x - n.y);
                EXPECT_NEAR(field.at(p), 0.0, 0.01 * spacing) << voxel << " " << spacing << " " << shift << " " << axis;
                EXPECT_GT(glm::dot(field.normal(p), n), 0.99999) << voxel << " " << spacing << " " << shift << " " << axis;
            }
        }
    }
}

// To the nearest of random voxels, by trying all of them: the same with a short and a long reach, up to that.
TEST(VoxelDistance, IsThatOfTheNearestMarkedVoxel)
{
    const VoxelGrid grid{{31, 24, 17}, oblique({0.7e-3, 1e-3, 2.2e-3}, Vec3(0.0), true)};
    std::mt19937 random(4);
    std::vector<std::uint8_t> marked(base::countOf(grid.size), 0);
    std::vector<Vec3> places;
    for (int i = 0; i < 12; ++i) {
        const Index3 n(random() % 31, random() % 24, random() % 17);
        marked[base::offsetOf(grid.size, n)] = 1;
        places.push_back(grid.affine.toPatient(Vec3(n)));
    }
    for (const double reach : {1e-3, 5e-3, 12e-3, std::numeric_limits<double>::infinity()}) {
        const std::vector<float> squares = squaredDistance(grid, marked, reach);
        forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
            double nearest = std::numeric_limits<double>::infinity();
            for (const Vec3& place : places) {
                nearest = std::min(nearest, glm::length(place - grid.affine.toPatient(Vec3(n))));
            }
            const auto found = static_cast<double>(squares[base::offsetOf(grid.size, n)]);
            if (nearest <= reach) {
                ASSERT_NEAR(std::sqrt(found), nearest, 1e-8) << reach;
            } else {
                ASSERT_GT(std::sqrt(found), reach * (1 - 1e-6));
            }
        });
    }
}

// Two layers with a gap between them, turned in the grid: faces that look the same way, 6 mm apart, know nothing of each
// other.
TEST(Distance, OfLayersIsThatOfEach)
{
    const double angle = 0.2;
    const Vec3 n(std::sin(angle), std::cos(angle), 0.0), along(std::cos(angle), -std::sin(angle), 0.0);
    const auto layers = [&](Vec3 p) {
        const double up = glm::dot(p, n);
        const bool inside = std::max(std::abs(glm::dot(p, along)), std::abs(p.z)) < 16e-3;
        return inside && ((up > -3.5e-3 && up < -1.5e-3) || (up > 1.5e-3 && up < 4.5e-3)) ? 1 : 0;
    };
    const Index3 size(96);
    const Tissue tissue =
        Tissue::fromLabels(voxelise(size, centred(straight(Vec3(0.5e-3)), size), layers), table(), names(), {});
    const DistanceField field = tissue.distanceToBody(coveringGrid(tissue.box(), 0.75e-3, 3e-3));
    for (const auto& [height, outwards] : {std::pair(-3.5e-3, -1.0), {-1.5e-3, 1.0}, {1.5e-3, -1.0}, {4.5e-3, 1.0}}) {
        for (double x = -8e-3; x <= 8e-3; x += 0.7e-3) {
            const Vec3 p = height * n + x * along + Vec3(0.0, 0.0, 0.5 * x);
            EXPECT_NEAR(field.at(p), 0.0, 0.15e-3) << height << " " << x;
            EXPECT_GT(glm::dot(field.normal(p), outwards * n), 0.99) << height << " " << x;
        }
    }
}

// Along an axis the fraction is linear between known corners. At any normal it is the volume of the blurred cell that is
// behind the plane: counted.
TEST(Distance, PlaneDepthInvertsTheFractionOfABlurredHalfSpace)
{
    const PlaneDepth planes(Blur{Vec3(1.0), Vec3(1.0), Index3(1), 0.5});
    const auto box = [](double d) { return std::clamp(0.5 + d, 0.0, 1.0); };
    for (double depth = -1.2; depth <= 1.2; depth += 0.05) {
        const double fraction = 0.25 * box(depth - 1.0) + 0.5 * box(depth) + 0.25 * box(depth + 1.0);
        for (int axis = 0; axis < 3; ++axis) {
            Vec3f normal(0.0F);
            normal[axis] = 1.0F;
            EXPECT_NEAR(planes.at(static_cast<float>(fraction), normal), depth, 0.02) << axis;
        }
    }
    const Vec3f oblique = glm::normalize(Vec3f(0.3F, -0.8F, 0.5F));
    std::mt19937 random(3);
    std::uniform_real_distribution<float> inCell(-0.5F, 0.5F);
    std::uniform_int_distribution<int> step(0, 1);
    const auto blur = [&] { return inCell(random) + static_cast<float>(step(random) + step(random) - 1); };
    for (const float depth : {-0.8F, -0.3F, 0.1F, 0.6F}) {
        constexpr int count = 200000;
        int behind = 0;
        for (int i = 0; i < count; ++i) {
            const Vec3f place(blur(), blur(), blur());
            behind += glm::dot(place, oblique) < depth ? 1 : 0;
        }
        EXPECT_NEAR(planes.at(static_cast<float>(behind) / count, oblique), depth, 0.01);
    }
}

// A finger that slides over the sphere at constant distance must not feel voxels: there the gradient has length 1 and
// points away from the middle.
TEST(Distance, GradientIsTheUnitNormalAwayFromTheSphere)
{
    for (const SphereCase& c : sphereCases()) {
        const NodeGrid grid = coveringGrid({Vec3(-0.04), Vec3(0.04)}, c.spacing, 0);
        const DistanceField field = sphereField(c, grid);
        std::mt19937 random(11);
        std::normal_distribution<double> normal;
        double sum = 0;
        const int count = 2000;
        for (int i = 0; i < count; ++i) {
            const Vec3 n = glm::normalize(Vec3(normal(random), normal(random), normal(random)));
            const Vec3 p = centre + (radius + 1e-3) * n;
            const double angle = std::acos(std::min(1.0, glm::dot(field.normal(p), n)));
            sum += angle * angle;
            EXPECT_NEAR(glm::length(field.gradient(p)), 1.0, 0.25) << c.name;
        }
        EXPECT_LT(std::sqrt(sum / count), 0.12) << c.name;
    }
}

// Volume where the trilinear field is negative, by `s`^3 samples of every cell.
// A grid ends a few millimetres beside its structure, and a needle comes from further away.
TEST(Distance, BeyondTheGridIsThatOfTheNearestPoint)
{
    for (const SphereCase& c : sphereCases()) {
        const NodeGrid grid = coveringGrid({centre - radius, centre + radius}, c.spacing, 5e-3);
        const DistanceField field = sphereField(c, grid);
        std::mt19937 random(12);
        std::uniform_real_distribution<double> within(-0.08, 0.08);
        for (int i = 0; i < 5000; ++i) {
            const Vec3 p = centre + Vec3(within(random), within(random), within(random));
            const double d = glm::length(p - centre) - radius;
            if (d > 5e-3) {
                EXPECT_NEAR(field.distance(p), d, 0.6 * std::max(c.voxel, c.spacing)) << c.name;
                EXPECT_GT(glm::dot(field.normal(p), glm::normalize(p - centre)), 0.97) << c.name;
            }
        }
    }
}

double enclosedVolume(const DistanceField& field, int s)
{
    const NodeGrid& grid = field.grid;
    std::uint64_t inside = 0;
    for (int z = 0; z < (grid.size.z - 1) * s; ++z) {
        for (int y = 0; y < (grid.size.y - 1) * s; ++y) {
            for (int x = 0; x < (grid.size.x - 1) * s; ++x) {
                inside += field.at(grid.origin + (Vec3(x, y, z) + 0.5) * (grid.spacing / s)) < 0 ? 1U : 0U;
            }
        }
    }
    return static_cast<double>(inside) * std::pow(grid.spacing / s, 3);
}

// A duct one voxel thick and a skin one voxel thick keep their volume, although half of every cell's fraction is smoothed
// away.
TEST(Distance, ThinStructuresKeepTheirVolume)
{
    const Affine affine = centred(straight(Vec3(1e-3)), {40, 40, 40});
    const auto tube = [](Vec3 p) {
        return std::abs(p.x) < 15e-3 && p.y > 0 && p.y < 1e-3 && p.z > 0 && p.z < 1e-3 ? 7 : 1;
    };
    const auto sheet = [](Vec3 p) {
        return std::abs(p.x) < 15e-3 && std::abs(p.y) < 15e-3 && p.z > 0 && p.z < 1e-3 ? 7 : 1;
    };
    const auto expectVolume = [&](const LabelImage& image, double spacing) {
        const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
        const double volume = tissue.structures().back().volume;
        const NodeGrid grid = coveringGrid({Vec3(-18e-3), Vec3(18.1e-3)}, spacing, 0);
        const DistanceField field = tissue.distanceTo(tissue.labelsNamed("lump"), grid);
        EXPECT_NEAR(enclosedVolume(field, 6) / volume, 1.0, 0.2) << "spacing " << spacing;
    };
    for (const double spacing : {0.7e-3, 1e-3, 1.5e-3, 2e-3}) {
        expectVolume(voxelise({40, 40, 40}, affine, tube), spacing);
        expectVolume(voxelise({40, 40, 40}, affine, sheet), spacing);
    }
}

// The body is what is not air; value 0 without a name is air, and so is a named cavity of role air.
TEST(Distance, OfTheBodyIsToAir)
{
    std::vector<LabelName> labels = names();
    labels.push_back({9, "trachea", "air"});
    const Affine affine = centred(straight(Vec3(1e-3)), {48, 48, 48});
    const LabelImage image = voxelise({48, 48, 48}, affine, [](Vec3 p) {
        const double r = glm::length(p);
        return r < 6e-3 ? 9 : r < 12e-3 ? 7 : r < 20e-3 ? 1 : 0;
    });
    const Tissue tissue = Tissue::fromLabels(image, table(), labels, {});
    const DistanceField field = tissue.distanceToBody(coveringGrid(tissue.box(), 1e-3, 5e-3));
    EXPECT_NEAR(field.at(Vec3(2e-3, 0, 0)), 4e-3, 0.4e-3);
    EXPECT_NEAR(field.at(Vec3(11e-3, 0, 0)), -5e-3, 0.4e-3);
    EXPECT_NEAR(field.at(Vec3(24e-3, 0, 0)), 4e-3, 0.4e-3);
}

TEST(Distance, ToALabelThatNoVoxelHasIsRefused)
{
    const LabelImage image = voxelise({4, 4, 4}, straight(Vec3(1e-3)), [](Vec3) { return 1; });
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    EXPECT_THROW(tissue.distanceTo(std::vector<std::uint16_t>{7}, coveringGrid(tissue.box(), 1e-3, 1e-3)),
                 std::runtime_error);
}

// A cell half fat, half tumour: E = sqrt(mean(E) / mean(1/E)) = sqrt(E1 E2); air in a cell does not count.
TEST(Modulus, OfAHalfAndHalfCellIsTheRootOfArithmeticTimesHarmonicMean)
{
    LabelImage image = voxelise({8, 8, 8}, straight(Vec3(1e-3)), [](Vec3 p) { return p.x < 3.5e-3 ? 1 : 7; });
    for (int i = 0; i < 8; ++i) {
        for (int j = 0; j < 8; ++j) {
            image.values[image.offset({i, j, 7})] = 0;
        }
    }
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    // The node at x = 3.5 mm has two voxels of fat and two of tumour in its cell of 2 mm on every side.
    const NodeGrid grid{{3, 3, 4}, Vec3(1.5e-3), 2e-3};
    const ScalarField field = tissue.youngsModulusOn(grid);
    const auto at = [&](int x, int z) { return static_cast<double>(field.values[grid.offset({x, 1, z})]); };
    EXPECT_NEAR(at(0, 1), 3.25e3, 1e-3);
    EXPECT_NEAR(at(1, 1), std::sqrt(3.25e3 * 43.7e3), 1e-1);
    EXPECT_NEAR(at(2, 1), 43.7e3, 1e-2);
    EXPECT_NEAR(at(1, 3), std::sqrt(3.25e3 * 43.7e3), 1e-1) << "half of the cell is air";
}

// Where axes are parallel, each voxel of a cell is read once and weighed along each axis; else the cell's samples are read
// one by one. Axes that are turned by nothing worth naming give the same fields, whichever axes are parallel and wherever
// the grid is.
TEST(Modulus, OfParallelAxesIsThatOfAxesTurnedByAlmostNothing)
{
    std::mt19937 random(11);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const std::array<std::array<int, 3>, 3> orders{{{0, 1, 2}, {2, 0, 1}, {1, 0, 2}}};
    for (int run = 0; run < 12; ++run) {
        const auto& order = orders[static_cast<std::size_t>(run) % orders.size()];
        Affine affine{Mat3(0.0), {}};
        for (int k = 0; k < 3; ++k) {
            affine.linear[k][order[static_cast<std::size_t>(k)]] =
                (unit(random) < 0.0 ? -1.0 : 1.0) * std::exp(unit(random)) * 1.2e-3;
        }
        LabelImage image{{23, 19, 21}, affine, {}};
        image.affine = centred(image.affine, image.size);
        image.values.resize(image.offset({0, 0, image.size.z}));
        std::generate(image.values.begin(), image.values.end(), [&] {
            return std::array<std::uint16_t, 2>{1, 7}[random() % 3 / 2];
        });
        const Tissue parallel = Tissue::fromLabels(image, table(), names(), {});
        image.affine.linear = (Mat3(1.0) + Mat3(0, 1e-12, 0, 0, 0, 1e-12, 1e-12, 0, 0)) * image.affine.linear;
        const Tissue turned = Tissue::fromLabels(image, table(), names(), {});
        const Vec3 middle = 1e-3 * Vec3(unit(random), unit(random), unit(random));
        const NodeGrid grid{{5, 6, 4}, middle - 4e-3, 2e-3 * std::exp(0.6 * unit(random))};
        const ScalarField a = parallel.youngsModulusOn(grid), b = turned.youngsModulusOn(grid);
        for (std::size_t i = 0; i < a.values.size(); ++i) {
            EXPECT_NEAR(a.values[i], b.values[i], 1e-5 * static_cast<double>(b.values[i])) << run << " " << i;
        }
        const std::array<std::uint16_t, 1> lump{7};
        const DistanceField c = parallel.distanceTo(lump, grid), d = turned.distanceTo(lump, grid);
        for (std::size_t i = 0; i < c.values.size(); ++i) {
            EXPECT_NEAR(c.values[i], d.values[i], 1e-6) << run << " " << i;
        }
    }
}

// Cells that an oblique plane cuts are as full as it leaves them, and not as the steps of voxels do.
TEST(Material, OfCellsThatAnObliquePlaneCutsIsAsTheSurfaceSays)
{
    const Vec3 n = glm::normalize(Vec3(0.27, 1.0, 0.12));
    const Index3 size(48);
    const Affine affine = centred(straight(Vec3(1e-3)), size);
    const LabelImage image =
        voxelise(size, affine, [&](Vec3 p) { return glm::dot(p, n) < 0.0 && glm::length(p) < 22e-3 ? 1 : 0; });
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const NodeGrid grid = coveringGrid(tissue.box(), 2e-3, 4e-3);
    const DistanceField surface = tissue.distanceToBody(coveringGrid(tissue.box(), 1e-3, 4e-3));
    const auto voxels = tissue.materialOn(grid), cells = tissue.materialOn(grid, surface);
    double before = 0.0, after = 0.0;
    int count = 0;
    forEachIndex(Index3(0), grid.size - 1, [&](Index3 c) {
        const Vec3 middle = grid.position(c);
        if (std::abs(glm::dot(middle, n)) > 1e-3 || glm::length(middle) > 14e-3) {
            EXPECT_TRUE(voxels[grid.offset(c)].youngsModulus > 0.0F || cells[grid.offset(c)].youngsModulus == 0.0F);
            return;
        }
        double behind = 0.0;
        constexpr int side = 10;
        forEachIndex(Index3(0), Index3(side - 1), [&](Index3 part) {
            const Vec3 at = middle + 2e-3 * ((Vec3(part) + 0.5) / static_cast<double>(side) - 0.5);
            behind += glm::dot(at, n) < 0.0 ? 1.0 / (side * side * side) : 0.0;
        });
        const double whole = table().rows[1].youngsModulus;
        before += std::pow(static_cast<double>(voxels[grid.offset(c)].youngsModulus) / whole - behind, 2);
        after += std::pow(static_cast<double>(cells[grid.offset(c)].youngsModulus) / whole - behind, 2);
        ++count;
    });
    EXPECT_GT(count, 50);
    EXPECT_LT(std::sqrt(after / count), 0.06);
    EXPECT_LT(after, 0.6 * before);
}

// A cell with bone is a layer of what is not bone, as much stiffer as it is thinner.
TEST(Material, OfACellThatIsPartlyHeldIsAThinnerLayer)
{
    std::vector<LabelName> labels = names();
    labels.push_back({9, "rib", "bone"});
    const LabelImage image = voxelise({8, 8, 8}, straight(Vec3(1e-3)), [](Vec3 p) {
        return p.x < 2.5e-3 ? 1 : p.x < 4.5e-3 ? 9 : 0;
    });
    const Tissue tissue = Tissue::fromLabels(image, table(), labels, {});
    const NodeGrid grid{{3, 3, 3}, Vec3(0.5e-3, 1.5e-3, 1.5e-3), 2e-3};  // cells of two voxels
    const auto cells = tissue.materialOn(grid);
    const auto at = [&](int x) { return cells[grid.offset({x, 1, 1})]; };
    EXPECT_NEAR(at(0).youngsModulus, 3.25e3, 1e-2);
    EXPECT_EQ(at(0).fixed, 0.0F);
    EXPECT_NEAR(at(1).youngsModulus, 2.0 * 3.25e3, 1e-2);
    EXPECT_NEAR(at(1).fixed, 0.5, 1e-6);
    EXPECT_EQ(at(2).fixed, 1.0F) << "half of the cell is air, and all of its tissue is held";
}

TEST(Modulus, CellsWithoutTissueTakeTheNearestTissue)
{
    const LabelImage image = voxelise({20, 20, 20}, straight(Vec3(1e-3)), [](Vec3 p) {
        return p.y < 5e-3 || p.y > 15e-3 ? 0 : p.x < 9.5e-3 ? 1 : 7;
    });
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const NodeGrid grid{{20, 20, 20}, Vec3(0.0), 1e-3};
    const ScalarField field = tissue.youngsModulusOn(grid);
    for (int y = 0; y < 20; ++y) {
        EXPECT_NEAR(static_cast<double>(field.values[grid.offset({3, y, 10})]), 3.25e3, 1e-2) << y;
        EXPECT_NEAR(static_cast<double>(field.values[grid.offset({16, y, 10})]), 43.7e3, 1e-1) << y;
    }
}

// Most of a cell decides; less than half of it tissue is air.
TEST(TissueOn, IsTheMajorityOfTheCell)
{
    const LabelImage image = voxelise({12, 12, 12}, straight(Vec3(1e-3)), [](Vec3 p) {
        return p.x < 3.5e-3 ? 0 : p.x < 7.5e-3 ? 1 : 300;
    });
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const NodeGrid grid{{4, 3, 3}, Vec3(1e-3, 3e-3, 3e-3), 3e-3};  // cells of 3 voxels at x = 1, 4, 7, 10 mm
    const std::vector<std::uint8_t> rows = tissue.tissueOn(grid);
    EXPECT_EQ(rows[grid.offset({0, 1, 1})], 0);
    EXPECT_EQ(rows[grid.offset({1, 1, 1})], 1);  // voxels 3 (air), 4, 5 (fat)
    EXPECT_EQ(rows[grid.offset({2, 1, 1})], 1);  // voxels 6, 7 (fat), 8 (bone)
    EXPECT_EQ(rows[grid.offset({3, 1, 1})], 3);
}

}  // namespace
}  // namespace palpate::volume
