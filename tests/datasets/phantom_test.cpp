#include <datasets/phantom.h>
#include <datasets/scene.h>
#include <datasets/tables.h>
#include <tests/datasets/voxels.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

namespace palpate::datasets {
namespace {

using volume::Role;
using volume::Tissue;

PhantomSpec breast(std::uint64_t seed, double voxel = 1e-3)
{
    return {.name = "breast", .seed = seed, .voxel = voxel};
}

// Several tests look at one breast.
const Tissue& breastTissue(std::uint64_t seed, double voxel)
{
    static std::map<std::pair<std::uint64_t, double>, Tissue> made;
    const std::pair key(seed, voxel);
    auto found = made.find(key);
    if (found == made.end()) {
        found = made.emplace(key, makePhantom(breast(seed, voxel), defaultTissues())).first;
    }
    return found->second;
}

// FNV-1a over the labels.
std::uint64_t hashOf(const Voxels& voxels)
{
    std::uint64_t hash = 0xCBF29CE484222325U;
    for (const std::uint16_t v : voxels.values) {
        hash = (hash ^ v) * 0x100000001B3U;
    }
    return hash;
}

double volumeOf(const Voxels& voxels, std::uint16_t label)
{
    return static_cast<double>(std::count(voxels.values.begin(), voxels.values.end(), label)) * std::pow(voxels.edge, 3);
}

// Faces between the label and anything else, in voxel faces.
double facesOf(const Voxels& voxels, std::uint16_t label)
{
    double faces = 0;
    voxels.forEach([&](Index3 n, std::uint16_t value) {
        if (value == label) {
            voxels.forEachNeighbour(n, [&](Index3 next) { faces += voxels.at(next) != label ? 1 : 0; });
        }
    });
    return faces;
}

// Pieces that touch by faces.
int componentsOf(const Voxels& voxels, std::uint16_t label)
{
    std::vector<char> open(voxels.values.size());
    voxels.forEach([&](Index3 n, std::uint16_t value) { open[voxels.offset(n)] = value == label ? 1 : 0; });
    int components = 0;
    voxels.forEach([&](Index3 start, std::uint16_t) {
        if (open[voxels.offset(start)] == 0) {
            return;
        }
        ++components;
        std::vector<Index3> stack{start};
        open[voxels.offset(start)] = 0;
        while (!stack.empty()) {
            const Index3 n = stack.back();
            stack.pop_back();
            voxels.forEachNeighbour(n, [&](Index3 next) {
                if (open[voxels.offset(next)] != 0) {
                    open[voxels.offset(next)] = 0;
                    stack.push_back(next);
                }
            });
        }
    });
    return components;
}

TEST(BreastPhantom, ASeedGivesTheSameVolumeAndAnotherSeedAnother)
{
    const std::uint64_t first = hashOf(Voxels(makePhantom(breast(7), defaultTissues())));
    EXPECT_EQ(first, hashOf(Voxels(makePhantom(breast(7), defaultTissues()))));
    EXPECT_NE(first, hashOf(Voxels(makePhantom(breast(8), defaultTissues()))));
}

// Golden values: this code, GCC 12, x86-64, also at -O0. Another value means that a seed no longer names the same body.
TEST(BreastPhantom, ASeedMeansTheSameBodyOnEveryMachine)
{
    const std::pair<std::uint64_t, std::uint64_t> golden[] = {{1, 8491876285668676895U}, {2, 17665975316244394649U}};
    for (const auto& [seed, hash] : golden) {
        PhantomSpec spec = breast(seed);
        spec.numbers["voxels_per_side"] = 64;
        EXPECT_EQ(hashOf(Voxels(makePhantom(spec, defaultTissues()))), hash) << seed;
    }
}

TEST(BreastPhantom, HasEveryStructureWithItsRole)
{
    PhantomSpec spec = breast(1);
    spec.numbers["tumours"] = 2;
    const Tissue tissue = makePhantom(spec, defaultTissues());
    for (const char* name : {"skin", "fat", "gland", "ligament", "duct", "nipple", "artery", "vein", "muscle", "rib",
                             "chest_wall", "tumour", "tumour_2"}) {
        const volume::Structure* s = structureNamed(tissue, name);
        ASSERT_NE(s, nullptr) << name;
        EXPECT_GT(s->voxels, 100U) << name;
    }
    const volume::TissueRow& rib = tissue.table().rows[structureNamed(tissue, "rib")->tissue];
    EXPECT_TRUE(rib.fixed);
    EXPECT_EQ(rib.role, Role::bone);
    EXPECT_EQ(tissue.table().rows[structureNamed(tissue, "vein")->tissue].role, Role::vital);
}

class BreastPhantoms : public ::testing::TestWithParam<std::uint64_t> {};

TEST_P(BreastPhantoms, SkinIsClosed)
{
    for (const double voxel : {1e-3, 2e-3}) {
        const Tissue& tissue = breastTissue(GetParam(), voxel);
        const Voxels voxels(tissue);
        const std::uint16_t skin = structureNamed(tissue, "skin")->value, nipple = structureNamed(tissue, "nipple")->value;
        int holes = 0;
        voxels.forEach([&](Index3 n, std::uint16_t value) {
            if (value != 0 && value != skin && value != nipple) {
                voxels.forEachNeighbour(n, [&](Index3 next) { holes += voxels.at(next) == 0 ? 1 : 0; });
            }
        });
        EXPECT_EQ(holes, 0) << voxel;
    }
}

TEST_P(BreastPhantoms, TumourHasItsVolumeAndIsNoSphere)
{
    for (const char* kind : {"idc_high_grade", "fibroadenoma"}) {
        PhantomSpec spec = breast(GetParam(), 0.5e-3);
        spec.words["tumour_kind"] = kind;
        const Tissue tissue = makePhantom(spec, defaultTissues());
        const Voxels voxels(tissue);
        const std::uint16_t tumour = structureNamed(tissue, "tumour")->value;
        const double volume = volumeOf(voxels, tumour);
        const double sphere = std::numbers::pi / 6 * std::pow(0.015, 3);
        EXPECT_NEAR(volume, sphere, 0.25 * sphere);
        // Voxel faces of a sphere of the same volume: 3/2 of its area.
        const double radius = std::cbrt(volume * 3 / (4 * std::numbers::pi)) / voxels.edge;
        const double sphereFaces = 1.5 * 4 * std::numbers::pi * radius * radius;
        const double excess = facesOf(voxels, tumour) / sphereFaces - 1;
        EXPECT_GT(excess, std::string(kind) == "fibroadenoma" ? 0.02 : 0.1) << kind;
    }
}

TEST_P(BreastPhantoms, TumourLiesAsDeepAsAsked)
{
    for (const double depth : {8.0, 15.0}) {
        PhantomSpec spec = breast(GetParam());
        spec.numbers["tumour_depth_mm"] = depth;
        const Tissue tissue = makePhantom(spec, defaultTissues());
        const Voxels voxels(tissue);
        const std::uint16_t tumour = structureNamed(tissue, "tumour")->value;
        // Voxel faces between body and air, and the tumour's voxel faces: both surfaces within half a voxel.
        std::vector<Vec3> surface, lump;
        voxels.forEach([&](Index3 n, std::uint16_t value) {
            voxels.forEachNeighbour(n, [&](Index3 next) {
                const Vec3 face = 0.5 * Vec3(n + next);
                if (value != 0 && voxels.at(next) == 0) {
                    surface.push_back(face);
                } else if (value == tumour && voxels.at(next) != tumour) {
                    lump.push_back(face);
                }
            });
        });
        double nearest = std::numeric_limits<double>::max();
        for (const Vec3& a : lump) {
            for (const Vec3& b : surface) {
                nearest = std::min(nearest, glm::dot(a - b, a - b));
            }
        }
        EXPECT_NEAR(std::sqrt(nearest), depth, 1.5);
    }
}

TEST_P(BreastPhantoms, VesselsAreInOnePieceAndClearOfTheTumour)
{
    for (const double voxel : {1e-3, 2e-3}) {
        const Tissue& tissue = breastTissue(GetParam(), voxel);
        const Voxels voxels(tissue);
        const std::uint16_t tumour = structureNamed(tissue, "tumour")->value;
        for (const char* name : {"artery", "vein"}) {
            const std::uint16_t vessel = structureNamed(tissue, name)->value;
            EXPECT_EQ(componentsOf(voxels, vessel), 1) << name << " " << voxel;
            int contacts = 0;
            voxels.forEach([&](Index3 n, std::uint16_t value) {
                if (value == vessel) {
                    voxels.forEachNeighbour(n, [&](Index3 next) { contacts += voxels.at(next) == tumour ? 1 : 0; });
                }
            });
            EXPECT_EQ(contacts, 0) << name;
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, BreastPhantoms, ::testing::Values(1, 2, 3, 42));

// Gland fills the asked fraction of what lies between skin and muscle.
TEST(BreastPhantom, DensityIsTheShareOfGland)
{
    for (const double density : {0.15, 0.3, 0.5}) {
        PhantomSpec spec = breast(5);
        spec.numbers = {{"density", density}, {"tumours", 0}, {"vessels", 0}};
        const Tissue tissue = makePhantom(spec, defaultTissues());
        double all = 0;
        for (const char* name : {"fat", "gland", "ligament", "duct"}) {
            all += structureNamed(tissue, name)->volume;
        }
        // Fat beside the breast belongs to the sum, so the share seen is a little smaller.
        const double fraction = structureNamed(tissue, "gland")->volume / all;
        EXPECT_TRUE(fraction > 0.75 * density && fraction < 1.05 * density) << density << " " << fraction;
    }
}

TEST(BreastPhantom, TheBodyIsTheSameOnEveryCubicGrid)
{
    std::vector<double> gland, body;
    for (const int side : {64, 128}) {
        PhantomSpec spec = breast(3);
        spec.numbers["voxels_per_side"] = side;
        const Tissue tissue = makePhantom(spec, defaultTissues());
        EXPECT_EQ(tissue.size(), Index3(side));
        gland.push_back(structureNamed(tissue, "gland")->volume);
        body.push_back(glm::length(tissue.box().high - tissue.box().low));
    }
    EXPECT_NEAR(gland[0] / gland[1], 1.0, 0.05);
    EXPECT_NEAR(body[0], body[1], 6e-3);
}

// The block of the accuracy figures: 100 x 60 x 100 mm, sphere of 20 mm with its centre 25 mm deep.
TEST(BlockPhantom, HasTheVolumesOfItsShapes)
{
    const Tissue tissue = makePhantom({.name = "block"}, defaultTissues());
    const double sphere = std::numbers::pi / 6 * 8e-6;
    EXPECT_NEAR(structureNamed(tissue, "tumour")->volume, sphere, 0.02 * sphere);
    EXPECT_NEAR(structureNamed(tissue, "fat")->volume + structureNamed(tissue, "tumour")->volume, 6e-4, 1e-9);
    const volume::Tissue::Reader reader(tissue);
    EXPECT_EQ(reader.label(Vec3(0, 0.025, 0)), structureNamed(tissue, "tumour")->value);
    EXPECT_TRUE(tissue.table().rows[reader.tissue(Vec3(0, 0.062, 0))].fixed);
}

// Two spheres of 12 mm, their centres 14 mm deep and 15 mm apart: the gap of 3 mm is as wide on the grid.
TEST(BlockPhantom, TwoTumoursHaveTheirVolumesTheirDepthAndTheirGap)
{
    const Scene scene = *builtInScene("pair");
    const Tissue tissue = sceneVolume(scene);
    const Voxels voxels(tissue);
    const double sphere = std::numbers::pi / 6 * std::pow(0.012, 3);
    const std::pair<const char*, double> expected[] = {{"tumour", -7.5e-3}, {"tumour_2", 7.5e-3}};
    std::vector<double> inner;  // of each tumour, its face nearest to the other
    for (const auto& [name, x] : expected) {
        const volume::Structure* tumour = structureNamed(tissue, name);
        ASSERT_NE(tumour, nullptr) << name;
        EXPECT_NEAR(tumour->volume, sphere, 0.02 * sphere);
        Vec3 sum(0.0);
        double count = 0, nearest = 1;
        voxels.forEach([&](Index3 n, std::uint16_t value) {
            if (value == tumour->value) {
                const Vec3 p = tissue.affine().toPatient(Vec3(n));
                sum += p;
                ++count;
                nearest = std::min(nearest, std::abs(p.x) - voxels.edge / 2);
            }
        });
        EXPECT_LT(glm::length(sum / count - Vec3(x, 14e-3, 0)), 1e-6) << name;
        inner.push_back(nearest);
    }
    EXPECT_NEAR(inner[0] + inner[1], 3e-3, 1e-9);
    EXPECT_NEAR(structureNamed(tissue, "fat")->volume + 2 * structureNamed(tissue, "tumour")->volume, 0.08 * 0.08 * 0.04,
                1e-9);
}

TEST(BlockPhantom, OneTumourTakesNoNoticeOfTheGap)
{
    PhantomSpec spec{.name = "block", .voxel = 2e-3};
    const std::uint64_t hash = hashOf(Voxels(makePhantom(spec, defaultTissues())));
    spec.numbers["gap_mm"] = 40;
    EXPECT_EQ(hashOf(Voxels(makePhantom(spec, defaultTissues()))), hash);
    EXPECT_EQ(structureNamed(makePhantom(spec, defaultTissues()), "tumour_2"), nullptr);
}

// The block's plate: 10 mm of fat, 100 x 100 mm, on 6 mm of bone, and nothing else.
TEST(BlockPhantom, ThePlateIsALayerOnBone)
{
    const Tissue tissue = sceneVolume(*builtInScene("plate"));
    EXPECT_NEAR(structureNamed(tissue, "fat")->volume, 0.1 * 0.1 * 0.01, 1e-9);
    EXPECT_NEAR(structureNamed(tissue, "base")->volume, 0.1 * 0.1 * 0.006, 1e-9);
    double body = 0;
    for (const volume::Structure& s : tissue.structures()) {
        body += tissue.table().rows[s.tissue].role == Role::air ? 0.0 : s.volume;
    }
    EXPECT_NEAR(body, 0.1 * 0.1 * 0.016, 1e-9);
    const volume::Tissue::Reader reader(tissue);
    const std::pair<double, const char*> expected[] = {{-0.5, "air"},  {0.5, "fat"},   {9.5, "fat"},
                                                       {10.5, "bone"}, {15.5, "bone"}, {16.5, "air"}};
    for (const auto& [depth, name] : expected) {
        EXPECT_EQ(tissue.table().rows[reader.tissue(Vec3(0.0105, depth * 1e-3, 0.0205))].name, name) << depth;
    }
    EXPECT_TRUE(tissue.table().rows[structureNamed(tissue, "base")->tissue].fixed);
}

TEST(LayeredPhantom, LayersLieWhereTheyAreAsked)
{
    PhantomSpec spec{.name = "layered"};
    spec.numbers = {{"skin_mm", 3}, {"fat_mm", 10}, {"gland_mm", 12}, {"muscle_mm", 8}, {"bone_mm", 5}, {"tumours", 0}};
    const Tissue tissue = makePhantom(spec, defaultTissues());
    const volume::Tissue::Reader reader(tissue);
    const std::pair<double, const char*> expected[] = {{-0.5, "air"},    {0.5, "skin"},   {2.5, "skin"},   {3.5, "fat"},
                                                       {12.5, "fat"},    {13.5, "gland"}, {24.5, "gland"}, {25.5, "muscle"},
                                                       {32.5, "muscle"}, {33.5, "bone"},  {37.5, "bone"}};
    for (const auto& [depth, name] : expected) {
        EXPECT_EQ(tissue.table().rows[reader.tissue(Vec3(0.0105, depth * 1e-3, 0.0205))].name, name) << depth;
    }
}

std::string errorOf(const PhantomSpec& spec)
{
    return tests::errorOf([&] { makePhantom(spec, defaultTissues()); });
}

// Said before anything is made. Where there is enough, it changes nothing.
TEST(Phantom, OneThatTakesMoreMemoryThanThereIsIsRefused)
{
    PhantomSpec spec{.name = "block", .voxel = 1e-3, .memory = 1e5};
    const std::string error = errorOf(spec);
    EXPECT_NE(error.find("GB of memory"), std::string::npos) << error;
    EXPECT_NE(error.find("--anyway"), std::string::npos) << error;
    spec.memory = 1e10;
    EXPECT_EQ(errorOf(spec), "");
}

TEST(Phantom, EveryParameterIsCheckedAgainstItsRange)
{
    for (const std::string& name : phantomNames()) {
        for (const PhantomParameter& p : phantomParameters(name)) {
            PhantomSpec spec{.name = name};
            if (!p.word.empty()) {
                spec.words[p.name] = "nothing";
                EXPECT_NE(errorOf(spec).find(p.name + " = \"nothing\""), std::string::npos);
                continue;
            }
            EXPECT_TRUE(p.standard >= p.low && p.standard <= p.high) << name << " " << p.name;
            for (const double bad : {p.low - 1, p.high + 1, std::numeric_limits<double>::quiet_NaN()}) {
                spec.numbers[p.name] = bad;
                const std::string error = errorOf(spec);
                EXPECT_NE(error.find(name), std::string::npos);
                EXPECT_NE(error.find(p.name + " = "), std::string::npos) << error;
                EXPECT_NE(error.find("must be"), std::string::npos) << error;
            }
        }
    }
    const PhantomSpec wide{.name = "block", .numbers = {{"tumours", 2}, {"gap_mm", 65}, {"tumour_diameter_mm", 20}}};
    EXPECT_NE(errorOf(wide).find("finds no room"), std::string::npos) << errorOf(wide);
    EXPECT_NE(errorOf({.name = "knee"}).find("breast, layered, block"), std::string::npos);
    EXPECT_NE(errorOf({.name = "block", .numbers = {{"depth", 1.0}}}).find("no such parameter 'depth'"), std::string::npos);
    EXPECT_EQ(errorOf({.name = "block", .words = {{"width_mm", "abc"}}}), "phantom 'block': width_mm: must be a number");
    EXPECT_EQ(errorOf({.name = "block", .numbers = {{"tissue", 3.0}}}),
              "phantom 'block': tissue: must be a name, as \"fat\" is");
}

// Layers are where the centres of voxels are: one that has none would be missing without a word.
TEST(Phantom, APartThatNoVoxelHoldsIsRefused)
{
    const std::pair<PhantomSpec, std::string> lost[] = {
        {{.name = "layered", .voxel = 5e-3}, "skin_mm = 2 mm: no voxel of 5 mm"},
        {{.name = "layered", .voxel = 4e-3, .numbers = {{"skin_mm", 1.5}}}, "skin_mm = 1.5 mm: no voxel of 4 mm"},
        {{.name = "layered", .voxel = 2e-3, .numbers = {{"skin_mm", 0.5}}}, "skin_mm = 0.5 mm: no voxel of 2 mm"},
        {{.name = "layered", .voxel = 3e-3, .numbers = {{"fat_mm", 0.1}}}, "fat_mm = 0.1 mm: no voxel of 3 mm"},
        {{.name = "block", .voxel = 5e-3, .numbers = {{"base_mm", 1}}}, "base_mm = 1 mm: no voxel of 5 mm"},
        {{.name = "block", .voxel = 5e-3, .numbers = {{"tumour_diameter_mm", 2}, {"tumour_centre_mm", 20}}},
         "tumour_diameter_mm = 2 mm: no voxel of 5 mm"}};
    for (const auto& [spec, words] : lost) {
        EXPECT_NE(errorOf(spec).find(words), std::string::npos) << errorOf(spec);
    }
    const PhantomSpec none{.name = "layered", .voxel = 2e-3, .numbers = {{"fat_mm", 0}, {"tumours", 0}}};
    EXPECT_EQ(errorOf(none), "") << "what has no size needs no voxel";
}

}  // namespace
}  // namespace palpate::datasets
