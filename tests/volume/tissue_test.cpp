#include "bodies.h"

#include <tests/error_of.h>
#include <volume/tissue.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

namespace palpate::volume {
namespace {

using namespace bodies;
namespace fs = std::filesystem;

class TissueFile : public ::testing::Test {
protected:
    void SetUp() override { fs::create_directories(folder); }
    void TearDown() override { fs::remove_all(folder); }

    fs::path folder = fs::temp_directory_path() / fmt::format("palpate-tissue-{}", ::getpid());
};

// Blobs, single voxels and homogeneous regions on a size that no leaf divides.
LabelImage randomImage(unsigned seed)
{
    std::mt19937 random(seed);
    LabelImage image{{41, 29, 23}, oblique({0.9e-3, 1.1e-3, 2.3e-3}, {0.01, -0.02, 1.0 / 3.0}, true), {}};
    image.values.assign(image.offset({0, 0, 23}), 0);
    const std::vector<std::uint16_t> labels = {0, 1, 7, 300};
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        image.values[i] = i < 14000 ? 1 : labels[random() % 50 < 4 ? random() % 4 : 0];
    }
    return image;
}

void expectSameVoxels(const LabelImage& image, const Tissue& tissue)
{
    const Tissue::Reader reader(tissue);
    for (int z = 0; z < image.size.z; ++z) {
        for (int y = 0; y < image.size.y; ++y) {
            for (int x = 0; x < image.size.x; ++x) {
                ASSERT_EQ(reader.label(image.affine.toPatient(Vec3(x, y, z))), image.values[image.offset({x, y, z})]);
            }
        }
    }
}

TEST_F(TissueFile, SaveAndLoadGiveBackEverythingExactly)
{
    const LabelImage image = randomImage(3);
    const Provenance provenance = {{"source", "a \"file\".nrrd"}, {"voxels", "ä\n\t"}};
    const Tissue saved = Tissue::fromLabels(image, table(), names(), provenance);
    saved.save(folder / "a.vdb");
    const Tissue loaded = Tissue::load(folder / "a.vdb");

    expectSameVoxels(image, loaded);
    EXPECT_EQ(loaded.size(), image.size);
    EXPECT_EQ(loaded.affine().linear, image.affine.linear);
    EXPECT_EQ(loaded.affine().origin, image.affine.origin);
    EXPECT_EQ(loaded.provenance(), provenance);
    EXPECT_EQ(loaded.box().low, saved.box().low);
    EXPECT_EQ(loaded.box().high, saved.box().high);
    ASSERT_EQ(loaded.structures().size(), saved.structures().size());
    for (std::size_t i = 0; i < saved.structures().size(); ++i) {
        const Structure& a = saved.structures()[i];
        const Structure& b = loaded.structures()[i];
        EXPECT_EQ(std::tie(a.value, a.name, a.tissue, a.voxels, a.volume),
                  std::tie(b.value, b.name, b.tissue, b.voxels, b.volume));
    }
    const auto all = [](const TissueRow& r) {
        return std::tie(r.name, r.role, r.youngsModulus, r.poissonRatio, r.density, r.compress, r.stretch, r.shear,
                        r.punctureForce, r.cuttingForce, r.frictionPerMetre, r.fixed, r.colour.x, r.colour.y, r.colour.z,
                        r.opacity, r.source, r.acoustics.soundSpeed, r.acoustics.attenuation, r.acoustics.attenuationPower,
                        r.acoustics.echo, r.acoustics.echoVariation, r.acoustics.pattern, r.acoustics.source);
    };
    ASSERT_EQ(loaded.table().rows.size(), table().rows.size());
    EXPECT_EQ(loaded.table().name, "test");
    for (std::size_t i = 0; i < table().rows.size(); ++i) {
        EXPECT_EQ(all(loaded.table().rows[i]), all(table().rows[i]));
    }
}

TEST_F(TissueFile, EveryTruncatedFileIsRefused)
{
    const Tissue tissue = Tissue::fromLabels(randomImage(4), table(), names(), {});
    const fs::path file = folder / "cut.vdb";
    tissue.save(file);
    const auto whole = fs::file_size(file);
    for (int percent = 0; percent < 100; percent += 3) {
        tissue.save(file);
        fs::resize_file(file, whole * static_cast<std::uintmax_t>(percent) / 100);
        EXPECT_THROW(Tissue::load(file), std::runtime_error) << percent << " %";
    }
    tissue.save(file);
    fs::resize_file(file, whole - 1);
    EXPECT_THROW(Tissue::load(file), std::runtime_error);
}

TEST_F(TissueFile, WhatIsNotOursIsRefusedInOneLine)
{
    std::ofstream(folder / "text.vdb") << "not a volume at all";
    for (const fs::path& file : {folder / "text.vdb", folder / "missing.vdb", folder}) {
        try {
            Tissue::load(file);
            ADD_FAILURE() << file << " was taken";
        } catch (const std::runtime_error& e) {
            const std::string what = e.what();
            EXPECT_EQ(what.rfind(file.string() + ": ", 0), 0U) << what;
            EXPECT_EQ(what.find('\n'), std::string::npos) << what;
        }
    }
}

// A limit on the size of files stands for a full disk: the write fails in the middle.
// Numbers of a file that was changed: forces were computed from them, or places outside of the voxels read.
TEST_F(TissueFile, NumbersThatNoTextMayHaveAreRefusedInOneLine)
{
    const fs::path good = folder / "good.vdb", bad = folder / "bad.vdb";
    Tissue::fromLabels(randomImage(3), table(), names(), {}).save(good);
    std::ifstream in(good, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    struct Change {
        std::string key, value, words;
    };
    for (const auto& [key, value, words] :
         std::vector<Change>{{"poisson", "0.9", "Poisson's ratio is 0.9"},
                             {"youngs_pa", "-9", "Young's modulus"},
                             {"puncture_n", "-1", "force of puncture"},
                             {"opacity", "9.", "opacity is 9: must be a number of 0 to 1"},
                             {"compress", "-1", "shortest link"},
                             {"size", "[0", "is empty"},
                             {"high", "[99", "lies outside of the voxels"}}) {
        // The number behind the last such key, in as many bytes.
        std::string changed = bytes;
        const std::size_t at = changed.rfind("\"" + key + "\":") + key.size() + 3;
        ASSERT_NE(at, std::string::npos + key.size() + 3) << key;
        const std::size_t end = changed.find_first_of(",}]", at);
        ASSERT_GE(end - at, value.size()) << key << changed.substr(at, 20);
        std::string number = value;
        number.insert(value.size(), end - at - value.size(), value.find('.') == std::string::npos ? ' ' : '0');
        changed.replace(at, end - at, number);
        std::ofstream(bad, std::ios::binary) << changed;
        const std::string why = tests::errorOf([&] { Tissue::load(bad); });
        EXPECT_TRUE(why.starts_with(bad.string() + ": ") && why.find(words) != std::string::npos) << key << why;
        EXPECT_EQ(why.find('\n'), std::string::npos);
    }
}

TEST_F(TissueFile, AFullDiskLeavesTheOldFile)
{
    const fs::path file = folder / "kept.vdb";
    const LabelImage old = randomImage(5);
    Tissue::fromLabels(old, table(), names(), {}).save(file);
    const Tissue larger = Tissue::fromLabels(randomImage(6), table(), names(), {});
    std::signal(SIGXFSZ, SIG_IGN);
    rlimit before{};
    ::getrlimit(RLIMIT_FSIZE, &before);
    for (const rlim_t bytes : {rlim_t{0}, rlim_t{1000}, rlim_t{9000}, static_cast<rlim_t>(fs::file_size(file) - 1000)}) {
        const rlimit full{bytes, before.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &full);
        std::string what;
        try {
            larger.save(file);
        } catch (const std::runtime_error& e) {
            what = e.what();
        }
        ::setrlimit(RLIMIT_FSIZE, &before);
        EXPECT_NE(what.find("cannot be written"), std::string::npos) << what;
        expectSameVoxels(old, Tissue::load(file));
        EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 1) << "something is left behind";
    }
}

TEST_F(TissueFile, AFolderThatIsNotThereIsNamed)
{
    const Tissue tissue = Tissue::fromLabels(randomImage(7), table(), names(), {});
    EXPECT_THROW(tissue.save(folder / "no" / "a.vdb"), std::runtime_error);
}

TEST(Tissue, HomogeneousRegionsCostNothing)
{
    LabelImage image{{256, 256, 256}, {Mat3(1e-3), Vec3(0.0)}, {}};
    image.values.assign(image.offset({0, 0, 256}), 1);
    const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
    const MemoryUse use = tissue.memory();
    EXPECT_LT(use.label + use.stiffness + use.occupancy, 4U << 20U);  // dense: 152 MB
    EXPECT_EQ(tissue.structures().size(), 1U);
    EXPECT_EQ(tissue.structures()[0].voxels, 256U * 256U * 256U);
    EXPECT_NEAR(tissue.structures()[0].volume, 256e-3 * 256e-3 * 256e-3, 1e-12);
}

TEST(Tissue, NamesFindStructuresFirstAndTissuesNext)
{
    LabelImage image = randomImage(8);
    const std::vector<LabelName> labels = {{1, "breast", "fat"}, {7, "fat pad", "fat"}, {300, "bone", "bone"}};
    const Tissue tissue = Tissue::fromLabels(image, table(), labels, {});
    EXPECT_EQ(tissue.labelsNamed("breast"), std::vector<std::uint16_t>{1});
    EXPECT_EQ(tissue.labelsNamed("fat"), (std::vector<std::uint16_t>{1, 7}));
    EXPECT_EQ(tissue.labelsNamed("bone"), std::vector<std::uint16_t>{300});
    EXPECT_TRUE(tissue.labelsNamed("liver").empty());
}

TEST(Tissue, LabelsWithoutNameOrTissueAreRefused)
{
    const LabelImage image = randomImage(9);
    const auto refused = [&](const std::vector<LabelName>& labels, const char* why) {
        try {
            Tissue::fromLabels(image, table(), labels, {});
            ADD_FAILURE() << why << " was taken";
        } catch (const std::runtime_error& e) {
            EXPECT_NE(std::string(e.what()).find(why), std::string::npos) << e.what();
        }
    };
    refused({{1, "breast", "fat"}, {7, "lump", "tumour"}}, "label 300");
    refused({{1, "breast", "fat"}, {7, "lump", "cheese"}, {300, "rib", "bone"}}, "cheese");
    refused({{1, "breast", "fat"}, {7, "lump", ""}, {300, "rib", "bone"}}, "'lump' has no tissue");
}

// A named 0 is tissue like any other; outside the volume there is still air.
TEST(Tissue, LabelMapsThatCanBeNoBodyAreRefused)
{
    const double infinite = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
    const auto refused = [](Vec3 spacing, Vec3 origin) {
        LabelImage image{{2, 2, 2}, {}, std::vector<std::uint16_t>(8, 1)};
        for (int axis = 0; axis < 3; ++axis) {
            image.affine.linear[axis] *= spacing[axis];
        }
        image.affine.origin = origin;
        try {
            Tissue::fromLabels(image, table(), names(), {});
            return false;
        } catch (const std::runtime_error&) {
            return true;
        }
    };
    EXPECT_FALSE(refused(Vec3(1e-3), Vec3(0.0)));
    EXPECT_FALSE(refused(Vec3(1e-3), Vec3(9.9, 0.0, 0.0)));
    EXPECT_TRUE(refused(Vec3(1e-3), Vec3(10.1, 0.0, 0.0))) << "no pose is there";
    for (const double wrong : {nan, infinite}) {
        EXPECT_TRUE(refused(Vec3(1e-3), Vec3(0.0, wrong, 0.0)));
        EXPECT_TRUE(refused(Vec3(1e-3, wrong, 1e-3), Vec3(0.0)));
    }
    for (const double wrong : {0.0, 1e-9, 11.0, 1e19, 1e200}) {
        EXPECT_TRUE(refused(Vec3(1e-3, 1e-3, wrong), Vec3(0.0))) << wrong;
    }
}

TEST(Tissue, TablesThatGiveNoForceAreRefused)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    struct Bad {
        double TissueRow::*member;
        std::vector<double> values;
        const char* words;
    };
    const std::vector<Bad> all{{&TissueRow::youngsModulus, {nan, 0, -1e3, 1 / 0.0}, "Young's modulus"},
                               {&TissueRow::poissonRatio, {nan, -0.1, 0.5}, "Poisson's ratio"},
                               {&TissueRow::stiffening, {nan, -0.26}, "stiffening"}};
    LabelImage image;
    image.size = {4, 4, 4};
    image.affine.linear = Mat3(1e-3);
    image.values.assign(64, 1);
    for (const Bad& bad : all) {
        for (const double value : bad.values) {
            TissueTable table = bodies::table();
            table.rows[1].*bad.member = value;
            const std::string why = tests::errorOf([&] { Tissue::fromLabels(image, table, bodies::names(), {}); });
            EXPECT_TRUE(why.starts_with("tissue table 'test': tissue 'fat': ") && why.find(bad.words) != std::string::npos)
                << why;
        }
    }
}

// Its spacing was sought with another margin: up to a tenth more nodes than there may be.
TEST(AffordableGrid, HasNoMoreNodesThanThereMayBe)
{
    const Box box{{-0.05, -0.02, -0.03}, {0.05, 0.06, 0.03}};
    for (std::size_t most = 216; most < 50000; most += 37) {
        ASSERT_LE(affordableGrid(box, 1e-3, most).count(), most);
    }
    const NodeGrid fits = affordableGrid(box, 2e-3, 1U << 22U), wanted = coveringGrid(box, 2e-3, 4e-3);
    EXPECT_EQ(fits.size, wanted.size);
    EXPECT_EQ(fits.origin, wanted.origin);
    EXPECT_THROW(affordableGrid(box, 1e-3, 215), std::runtime_error);
    EXPECT_THROW(affordableSpacing(box, 1e-3, 4e-3, 7), std::runtime_error);
    for (const double spacing : {0.0, -1e-3, std::numeric_limits<double>::quiet_NaN()}) {
        EXPECT_THROW(affordableSpacing(box, spacing, 4e-3, 1000), std::runtime_error);
    }
    EXPECT_LE(coveringGrid(box, affordableSpacing(box, 1e-3, 4e-3, 8), 4e-3).count(), 8U);
}

TEST(Tissue, ANamedZeroIsTissue)
{
    const LabelImage image = randomImage(10);
    std::vector<LabelName> labels = names();
    labels.push_back({0, "filling", "fat"});
    const Tissue tissue = Tissue::fromLabels(image, table(), labels, {});
    const Tissue::Reader reader(tissue);
    const auto at = static_cast<std::size_t>(std::find(image.values.begin(), image.values.end(), 0) - image.values.begin());
    const Index3 n(static_cast<int>(at) % 41, static_cast<int>(at) / 41 % 29, static_cast<int>(at) / 41 / 29);
    EXPECT_EQ(reader.tissue(image.affine.toPatient(Vec3(n))), 1);
    EXPECT_NEAR(reader.youngsModulus(image.affine.toPatient(Vec3(n))), 3.25e3, 1e-3);
    EXPECT_EQ(reader.tissue(image.affine.toPatient(Vec3(-1, 0, 0))), 0);
    EXPECT_EQ(reader.youngsModulus(image.affine.toPatient(Vec3(-1, 0, 0))), 0.0);
}

// Tissue 1 of a whole grid of cubic voxels from y = `from` on.
Tissue behindFace(double voxel, Index3 size, int from)
{
    LabelImage image{size, {Mat3(voxel), Vec3(0.0)}, {}};
    image.values.assign(image.offset({0, 0, size.z}), 0);
    forEachIndex({0, from, 0}, size - 1, [&](Index3 n) { image.values[image.offset(n)] = 1; });
    return Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
}

// A cell that the body's face cuts has the share of the modulus that lies behind the face, wherever samples fall among the
// voxels: exactly, but for the half voxel at the cell's own ends. By the nearest voxel half a voxel was missing on ties.
TEST(TissueCells, AreAsFullAsTheBodyIsInThem)
{
    constexpr double voxel = 1e-3;
    const Tissue tissue = behindFace(voxel, Index3(30), 10);
    const double whole = tissue.table().rows[1].youngsModulus, face = 9.5 * voxel;
    for (const double spacing : {1.5e-3, 2e-3, 3e-3, 4e-3}) {
        for (double shift = 0.0; shift < spacing; shift += 0.125e-3) {
            const NodeGrid cells{{2, 5, 2}, {15e-3, 4e-3 + shift, 15e-3}, spacing};
            const auto material = tissue.materialOn(cells);
            for (int j = 0; j < cells.size.y; ++j) {
                const double low = cells.position({0, j, 0}).y - 0.5 * spacing;
                const double full = std::clamp((low + spacing - face) / spacing, 0.0, 1.0);
                const double found = static_cast<double>(material[cells.offset({0, j, 0})].youngsModulus) / whole;
                EXPECT_NEAR(found, full, 0.13 * voxel / spacing) << spacing << " " << shift << " " << j;
            }
        }
    }
}

// Cells of any size hold as much of a slab as there is of it, wherever its faces lie in them. Samples lie between voxels,
// of which those beside a face gave cells outside of it up to a sixth of a voxel: plates were up to 23 % too stiff.
TEST(TissueCells, HoldASlabOfAnyVoxels)
{
    for (const auto& [voxel, layers] :
         {std::pair(0.7e-3, 9), {1e-3, 6}, {1.2e-3, 5}, {1.5e-3, 4}, {2.5e-3, 6}, {3e-3, 5}}) {
        const Index3 size(static_cast<int>(60e-3 / voxel));
        LabelImage image{size, bodies::centred({Mat3(voxel), Vec3(0.0)}, size), {}};
        image.values.assign(image.offset({0, 0, size.z}), 0);
        forEachIndex({0, 3, 0}, {size.x - 1, 2 + layers, size.z - 1}, [&](Index3 n) { image.values[image.offset(n)] = 1; });
        const Tissue tissue = Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
        const DistanceField surface = tissue.distanceToBody({size + 1, image.affine.origin - 0.5 * voxel, voxel});
        const double whole = tissue.table().rows[1].youngsModulus, face = image.affine.origin.y + 2.5 * voxel;
        for (const double spacing : {1.5e-3, 2e-3, 4e-3}) {
            for (double shift = 0.0; shift < spacing; shift += 0.25e-3) {
                const NodeGrid cells{{5, 18, 5}, Vec3(0.0, face + shift - 4.5 * spacing, 0.0), spacing};
                const auto material = tissue.materialOn(cells, surface);
                double thickness = 0.0;
                for (int j = 0; j < cells.size.y; ++j) {
                    thickness += spacing * static_cast<double>(material[cells.offset({0, j, 0})].youngsModulus) / whole;
                }
                const double bound = std::max(0.035 * spacing, 0.09 * voxel);
                EXPECT_NEAR(thickness, layers * voxel, bound) << voxel << " " << spacing << " " << shift;
            }
        }
    }
}

// A flap of a single layer of voxels, which the surface's blur does not know, stays as thick as its voxels say.
TEST(TissueCells, KeepAFlapOfOneVoxel)
{
    const Vec3 voxel(0.7e-3, 0.7e-3, 3e-3);
    const Index3 size(86, 86, 30);
    LabelImage image{size, bodies::centred({Mat3(voxel.x, 0, 0, 0, voxel.y, 0, 0, 0, voxel.z), Vec3(0.0)}, size), {}};
    image.values.assign(image.offset({0, 0, size.z}), 0);
    forEachIndex({14, 14, 5}, {42, 71, 24}, [&](Index3 n) { image.values[image.offset(n)] = 1; });
    forEachIndex({43, 43, 5}, {71, 43, 24}, [&](Index3 n) { image.values[image.offset(n)] = 1; });
    const Tissue tissue = Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
    const DistanceField surface = tissue.distanceToBody(coveringGrid(tissue.box(), 0.75e-3, 3e-3));
    for (const double spacing : {1.5e-3, 2e-3}) {
        for (const double beside : {3e-3, 6e-3, 15e-3}) {
            const NodeGrid cells{{2, 13, 2}, Vec3(beside, -6.5 * spacing, 0.0), spacing};
            const auto voxels = tissue.materialOn(cells), cut = tissue.materialOn(cells, surface);
            double all = 0.0, left = 0.0;
            for (int j = 0; j < cells.size.y; ++j) {
                all += static_cast<double>(voxels[cells.offset({0, j, 0})].youngsModulus);
                left += static_cast<double>(cut[cells.offset({0, j, 0})].youngsModulus);
            }
            EXPECT_GT(all, 0.0);
            EXPECT_NEAR(left, all, 0.1 * all) << spacing << " " << beside;
        }
    }
}

// Of voxels far larger than cells, too, the face is in the middle between the last full and the first empty one: a cell
// beyond it has nothing. Interpolated as they are, cells were partly full up to half a voxel outside.
TEST(TissueCells, NothingLiesOutsideOfCoarseVoxels)
{
    constexpr double voxel = 5e-3;
    const Tissue tissue = behindFace(voxel, Index3(8), 4);
    const double whole = tissue.table().rows[1].youngsModulus, face = 3.5 * voxel;
    for (const double spacing : {0.8e-3, 1.5e-3, 2e-3}) {
        for (double shift = 0.0; shift < spacing; shift += 0.125e-3) {
            const NodeGrid cells{{2, 13, 2}, {15e-3, face - 6.0 * spacing + shift, 15e-3}, spacing};
            const auto material = tissue.materialOn(cells);
            for (int j = 0; j < cells.size.y; ++j) {
                const double low = cells.position({0, j, 0}).y - 0.5 * spacing;
                const double full = std::clamp((low + spacing - face) / spacing, 0.0, 1.0);
                const double found = static_cast<double>(material[cells.offset({0, j, 0})].youngsModulus) / whole;
                EXPECT_NEAR(found, full, 0.17) << spacing << " " << shift << " " << j;
            }
        }
    }
}

// An eighth of a cell is tissue where a cell of its size would be; a full cell has all eight. Of bodies in any place and at
// any angle, with cells smaller and larger than voxels.
TEST(TissueCells, OctantsAreTheTissueOfCellsHalfAsWide)
{
    std::mt19937 random(11);
    std::uniform_real_distribution<double> shift(0.0, 1.0);
    for (const double spacing : {0.4e-3, 0.9e-3, 1.5e-3, 2e-3, 4e-3}) {
        const Index3 size(24);
        const Affine affine = bodies::centred(bodies::oblique({1.1e-3, 0.9e-3, 1e-3}, Vec3(0.0), false), size);
        LabelImage image{size, affine, {}};
        image.values.assign(image.offset({0, 0, size.z}), 0);
        forEachIndex({8, 8, 8}, {15, 15, 15}, [&](Index3 n) { image.values[image.offset(n)] = random() % 4 < 3 ? 1 : 0; });
        const auto tissue = Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
        const Vec3 from = spacing * Vec3(shift(random), shift(random), shift(random)) - 6.5e-3;
        const NodeGrid cells{Index3(static_cast<int>(13e-3 / spacing)), from, spacing};
        const NodeGrid halves{2 * cells.size, cells.origin - 0.25 * spacing, 0.5 * spacing};
        const auto rows = tissue.tissueOn(halves);
        int divided = 0;
        const auto materials = tissue.materialOn(cells);
        for (std::size_t i = 0; i < materials.size(); ++i) {
            if (materials[i].youngsModulus <= 0.0F) {
                continue;
            }
            for (int k = 0; k < 8; ++k) {
                const Index3 half = 2 * cells.node(i) + Index3(k & 1, k >> 1 & 1, k >> 2);
                ASSERT_EQ((materials[i].octants >> k & 1) != 0, rows[halves.offset(half)] != 0) << spacing << " " << i;
            }
            divided += materials[i].octants != 0 && materials[i].octants != 0xFF ? 1 : 0;
        }
        EXPECT_GT(divided, 10) << spacing;
    }
}

// Nothing fixed: the rear 5 % in whole layers, at least one, of the voxel axis that is nearest to y, on whichever side of
// it the back is. What is behind the plane is held in cells of any size. A bone holds the body, and there is no plane.
TEST(TissueSupport, ABodyThatNothingHoldsLiesOnItsBack)
{
    const Index3 size(16, 44, 20);
    for (const bool mirror : {false, true}) {
        for (const int deep : {40, 6}) {
            Affine affine = bodies::centred(bodies::oblique({1.1e-3, 0.9e-3, 1e-3}, Vec3(0.0), mirror), size);
            affine.linear[1] *= mirror ? -1.0 : 1.0;
            affine = bodies::centred(affine, size);
            LabelImage image{size, affine, {}};
            image.values.assign(image.offset({0, 0, size.z}), 0);
            forEachIndex({2, 2, 2}, {13, deep + 1, 17}, [&](Index3 n) { image.values[image.offset(n)] = 1; });
            const auto tissue = Tissue::fromLabels(image, bodies::table(), bodies::names(), {});
            ASSERT_TRUE(tissue.support());
            const int layers = deep == 40 ? 2 : 1;
            const double border = mirror ? 1.5 + layers : deep + 1.5 - layers;
            for (const double beside : {0.0, 9.0}) {
                EXPECT_NEAR(tissue.support()->height(affine.toPatient({beside, border, beside})), 0.0, 1e-12);
            }
            EXPECT_GT(tissue.support()->height(affine.toPatient({0, 0.5 * deep, 0})), 0.0);
            EXPECT_LT(tissue.support()->normal.y, -0.8);
            const NodeGrid cells = coveringGrid(tissue.box(), 3e-3, 6e-3);
            double held = 0.0;
            for (const CellMaterial& m : tissue.materialOn(cells)) {
                held += m.fixed > 0.0F ? 1.0 : 0.0;
            }
            EXPECT_GT(held, 10.0);
            image.values[image.offset({2, 2, 2})] = 300;
            EXPECT_FALSE(Tissue::fromLabels(image, bodies::table(), bodies::names(), {}).support());
        }
    }
}

}  // namespace
}  // namespace palpate::volume
