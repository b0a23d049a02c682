#include <render/deformation.h>
#include <tests/render/body.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

namespace palpate::render {
namespace {

// A cube of tissue 1 up to its border of air, and the displacement u(X) = gradient (X - corner) at every lattice node.
struct Cube {
    explicit Cube(int voxels = 40) : labels(static_cast<std::size_t>(voxels * voxels * voxels), 1)
    {
        scenery.labels = {{voxels, voxels, voxels}, 0, {0, 0, 0}, 1e-3};
        scenery.lattice = {{voxels / 2, voxels / 2, voxels / 2}, 0, {0, 0, 0}, 2e-3};
        scenery.tissues = 3;
    }
    template <class Field>
    void displace(Field field)
    {
        const auto n = static_cast<std::uint32_t>(scenery.lattice.size[0]);
        for (std::uint32_t i = 0; i < n * n * n; ++i) {
            const glm::dvec3 rest = 2e-3 * glm::dvec3(i % n, i / n % n, i / n / n);
            const glm::vec3 u(field(rest));
            displaced->nodes[displaced->count++] = {i, {u.x, u.y, u.z}};
        }
        displaced->tick = 1;
    }

    channel::Scenery scenery;
    std::vector<std::uint8_t> labels;
    std::unique_ptr<channel::Displaced> displaced = std::make_unique<channel::Displaced>();
};

glm::dvec3 restOf(const Deformation& d, glm::dvec3 x)
{
    glm::vec3 shift(0);
    return d.rest(x, shift);
}

std::uint8_t tissueOf(const Deformation& d, glm::dvec3 x)
{
    glm::vec3 shift(0);
    return d.restLabel(d.rest(x, shift)) & channel::rowBits;
}

// x = X + g X gives X = x / (1 + g); trilinear interpolation is exact on it.
TEST(Deformation, RestInvertsAUniformStretch)
{
    for (const double g : {-0.3, -0.1, 0.15, 0.3}) {
        Cube cube;
        cube.displace([g](glm::dvec3 rest) { return g * rest; });
        Deformation d(cube.scenery, cube.labels);
        d.apply(*cube.displaced);
        std::mt19937 random(2);
        std::uniform_real_distribution<double> inside(0.002, 0.02);
        for (int i = 0; i < 200; ++i) {
            const glm::dvec3 x(inside(random), inside(random), inside(random));
            EXPECT_NEAR(glm::distance(restOf(d, x), x / (1 + g)), 0, 0.05 * 2e-3) << g;
        }
    }
}

TEST(Deformation, TissueMovesWithItsNodes)
{
    Cube cube;
    const auto at = [](int x, int y, int z) { return static_cast<std::size_t>((z * 40 + y) * 40 + x); };
    for (int z = 18; z <= 21; ++z)
        for (int y = 18; y <= 21; ++y)
            for (int x = 18; x <= 21; ++x)
                cube.labels[at(x, y, z)] = 2;
    cube.displace([](glm::dvec3) { return glm::dvec3(5e-3, 0, 0); });
    Deformation d(cube.scenery, cube.labels);
    const glm::dvec3 before(19.5e-3, 19.5e-3, 19.5e-3), after = before + glm::dvec3(5e-3, 0, 0);
    EXPECT_EQ(tissueOf(d, before), 2);
    EXPECT_EQ(tissueOf(d, after), 1);
    d.apply(*cube.displaced);
    EXPECT_EQ(tissueOf(d, before), 1);
    EXPECT_EQ(tissueOf(d, after), 2);
}

TEST(Deformation, NoTissueAppearsThatIsNotThere)
{
    Cube cube;
    for (std::size_t i = 0; i < cube.labels.size(); ++i)
        cube.labels[i] = i % 40 < 20 ? 1 : 5;
    cube.displace([](glm::dvec3 rest) { return glm::dvec3(1e-3 * std::sin(300 * rest.y), 0, 0); });
    Deformation d(cube.scenery, cube.labels);
    d.apply(*cube.displaced);
    for (int i = 0; i < 3500; ++i) {
        const int tissue = tissueOf(d, {2e-3 + 9e-6 * i, 15e-3, 11e-3});
        EXPECT_TRUE(tissue == 1 || tissue == 5) << "a blend of labels 1 and 5: " << tissue;
    }
}

// All that differs from rest, now or a moment ago, must lie in the box that apply() returns.
TEST(Deformation, TheBoxHoldsEverythingThatChanged)
{
    const auto scenery = bodyScenery(64, 1.6e-3);
    const auto labels = bodyLabels(scenery);
    Deformation now(scenery, labels), before(scenery, labels);
    const auto displaced = std::make_unique<channel::Displaced>();
    for (const double t : {0.9, 1.4, 1.95, 2.1, 0.1}) {
        storyDisplaced(scenery, t, *displaced);
        const VoxelBox box = now.apply(*displaced);
        int outside = 0;
        for (int z = 0; z < 64; ++z)
            for (int y = 0; y < 64; ++y)
                for (int x = 0; x < 64; ++x) {
                    const bool in = x >= box.low.x && y >= box.low.y && z >= box.low.z && x < box.high.x &&
                                    y < box.high.y && z < box.high.z;
                    const glm::dvec3 p = vec(scenery.labels.origin) + scenery.labels.spacing * glm::dvec3(x, y, z);
                    outside += !in && tissueOf(now, p) != tissueOf(before, p);
                }
        EXPECT_EQ(outside, 0) << t;
        before.apply(*displaced);
    }
}

// The needle has pushed the skin 9 mm along its axis: in front of its tip there is air, and air only.
TEST(Deformation, ADimpleIsFreeOfTissueDownToItsBottom)
{
    const auto scenery = bodyScenery();
    Deformation d(scenery, bodyLabels(scenery));
    const auto displaced = std::make_unique<channel::Displaced>();
    storyDisplaced(scenery, punctureAt - 1e-3, *displaced);
    d.apply(*displaced);
    const glm::dvec3 entry = vec(scenery.entry), axis = glm::normalize(vec(scenery.aim) - entry);
    for (double way = -20e-3; way < 7.5e-3; way += 0.1e-3)
        EXPECT_EQ(tissueOf(d, entry + way * axis), 0) << way;
    EXPECT_EQ(tissueOf(d, entry + 10.2e-3 * axis), 1) << "skin under the tip";
    d.apply(*std::make_unique<channel::Displaced>());
    EXPECT_EQ(tissueOf(d, entry + 5e-3 * axis), 2) << "back at rest: fat";
}

TEST(Deformation, NodesThatMakeNoSenseAreLeftOut)
{
    Cube cube;
    cube.displaced->count = 3;
    cube.displaced->nodes[0] = {4000000000U, {1, 1, 1}};
    cube.displaced->nodes[1] = {5, {NAN, 0, 0}};
    cube.displaced->nodes[2] = {6, {0, INFINITY, 0}};
    Deformation d(cube.scenery, cube.labels);
    EXPECT_TRUE(d.apply(*cube.displaced).empty());
}

}  // namespace
}  // namespace palpate::render
