#include "models.h"

#include <haptics/broadcast.h>
#include <haptics/display_image.h>
#include <haptics/scenery.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace palpate::haptics {
namespace {

constexpr float none = std::numeric_limits<float>::quiet_NaN();

// A grid with its middle at the aim, and a planned line to it.
struct Plan {
    explicit Plan(int side = 25, double spacing = 4e-3)
        : grid{Index3(side), Vec3(-0.5 * (side - 1) * spacing), spacing}, values(grid.count(), none)
    {
        scenery.entry = {0, -0.04, 0};
    }
    template <class Value>
    void fill(const Value& valueAt)
    {
        for (std::size_t i = 0; i < values.size(); ++i) {
            values[i] = static_cast<float>(valueAt(grid.position(grid.node(i))));
        }
    }
    std::vector<std::uint16_t> shown(const std::string& unit) { return displayImage(grid, values, unit, scenery); }
    std::string firstWindow() const { return scenery.window[0].name.data(); }

    volume::NodeGrid grid;
    std::vector<float> values;
    channel::Scenery scenery;
};

// The window that comes first is the first of soft tissue, lung and bone in which half of the tissue around the target is
// neither black nor white, whatever the rest of the body is.
TEST(DisplayImage, OfCtIsSeenThroughTheWindowForWhatIsAroundTheTarget)
{
    const auto first = [](double near, double far) {
        Plan plan;
        plan.fill([&](Vec3 p) { return glm::length(p) < 31e-3 ? near : far; });
        plan.shown("HU");
        EXPECT_EQ(plan.scenery.windows, 3U);
        std::vector<std::string> names;
        for (const auto& w : {plan.scenery.window[0], plan.scenery.window[1], plan.scenery.window[2]}) {
            names.emplace_back(w.name.data());
            EXPECT_LT(w.low, w.high);
        }
        std::sort(names.begin(), names.end());
        EXPECT_EQ(names, (std::vector<std::string>{"bone", "lung", "soft tissue"}));
        return plan.firstWindow();
    };
    EXPECT_EQ(first(40, -800), "soft tissue");
    EXPECT_EQ(first(-850, 40), "lung");
    EXPECT_EQ(first(900, 40), "bone");
    EXPECT_EQ(first(3000, -800), "soft tissue") << "none of them shows metal";
}

TEST(DisplayImage, OfCtWithoutAPlannedLineIsJudgedByTheWholeBody)
{
    Plan plan;
    plan.scenery.entry = plan.scenery.aim;
    plan.fill([](Vec3 p) { return glm::length(p) < 31e-3 ? 900.0 : -800.0; });
    plan.shown("HU");
    EXPECT_EQ(plan.firstWindow(), "lung");
    EXPECT_EQ(plan.scenery.window[0].low, -1350);
    EXPECT_EQ(plan.scenery.window[0].high, 150);
}

// The values 0, 1, .. n - 1 in any order have their 1st and 99th percentile at 1 % and 99 % of n - 1.
TEST(DisplayImage, OfAnotherUnitIsSeenBetweenPercentiles)
{
    Plan plan(21);
    const std::size_t n = 9001;
    std::mt19937 random(7);
    for (std::size_t i = 0; i < n; ++i) {
        plan.values[i] = static_cast<float>(i);
    }
    std::shuffle(plan.values.begin(), plan.values.end(), random);
    plan.shown("");
    EXPECT_EQ(plan.scenery.windows, 2U);
    EXPECT_EQ(plan.firstWindow(), "body");
    EXPECT_EQ(plan.scenery.window[0].low, 90);
    EXPECT_EQ(plan.scenery.window[0].high, 8910);
}

TEST(DisplayImage, OfAnotherUnitHasAWindowForWhatIsAroundTheTarget)
{
    Plan plan;
    plan.fill([](Vec3 p) { return glm::length(p) < 31e-3 ? 100 + 1e3 * p.x : 5000 + 1e5 * p.x; });
    plan.shown("");
    const auto& near = plan.scenery.window[1];
    EXPECT_STREQ(near.name.data(), "around the target");
    EXPECT_GE(near.low, 70);
    EXPECT_LE(near.high, 130);
    EXPECT_GT(near.high - near.low, 40);
}

// Codes give every value back to half a step of 65535 from the least to the most.
TEST(DisplayImage, CodesGiveTheValuesBack)
{
    Plan plan;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> any(-1024, 3071);
    plan.fill([&](Vec3) { return any(random); });
    const auto codes = plan.shown("HU");
    ASSERT_EQ(codes.size(), plan.values.size());
    const auto [least, most] = std::minmax_element(plan.values.begin(), plan.values.end());
    EXPECT_LE(plan.scenery.imageStep, 4095.0 / 65535);
    for (std::size_t i = 0; i < codes.size(); ++i) {
        ASSERT_NEAR(plan.scenery.imageLow + plan.scenery.imageStep * codes[i], static_cast<double>(plan.values[i]),
                    0.5001 * plan.scenery.imageStep);
    }
    EXPECT_EQ(codes[static_cast<std::size_t>(least - plan.values.begin())], 0);
    EXPECT_EQ(codes[static_cast<std::size_t>(most - plan.values.begin())], 65535);
}

// Half of the grid has values, the same in every layer across x; the layer beside it takes them over.
TEST(DisplayImage, GoesOnBesideTheBodyByAVoxel)
{
    Plan plan(8);
    for (std::size_t i = 0; i < plan.values.size(); ++i) {
        const Index3 n = plan.grid.node(i);
        plan.values[i] = n.x < 3 ? static_cast<float>(100 * n.x) : none;
    }
    const auto codes = plan.shown("");
    const auto valueAt = [&](Index3 n) {
        return plan.scenery.imageLow + plan.scenery.imageStep * codes[plan.grid.offset(n)];
    };
    EXPECT_NEAR(valueAt({2, 4, 4}), 200, 0.01);
    EXPECT_NEAR(valueAt({3, 4, 4}), 200, 0.01);
    EXPECT_NEAR(valueAt({3, 0, 7}), 200, 0.01);
    EXPECT_EQ(codes[plan.grid.offset({4, 4, 4})], 0);
}

// Outside the body the image goes on as it is, and the windows are those of the body.
TEST(DisplayImage, GoesOnOutsideTheBody)
{
    Plan plan(8);
    std::vector<float> beyond(plan.values.size());
    for (std::size_t i = 0; i < plan.values.size(); ++i) {
        const Index3 n = plan.grid.node(i);
        plan.values[i] = n.x < 3 ? static_cast<float>(100 * n.x) : none;
        beyond[i] = static_cast<float>(-1000 + 10 * n.y);
    }
    plan.shown("");
    const channel::GreyWindow window = plan.scenery.window[0];
    const auto codes = displayImage(plan.grid, plan.values, "", plan.scenery, beyond);
    const auto valueAt = [&](Index3 n) {
        return plan.scenery.imageLow + plan.scenery.imageStep * codes[plan.grid.offset(n)];
    };
    EXPECT_NEAR(valueAt({2, 4, 4}), 200, 0.02);
    EXPECT_NEAR(valueAt({3, 4, 4}), 200, 0.02) << "a voxel beside the body";
    EXPECT_NEAR(valueAt({5, 4, 4}), -960, 0.02);
    EXPECT_EQ(plan.scenery.window[0].low, window.low);
    EXPECT_EQ(plan.scenery.window[0].high, window.high);
}

TEST(DisplayImage, WithoutAValueThereIsNone)
{
    Plan plan;
    EXPECT_TRUE(plan.shown("HU").empty());
    EXPECT_EQ(plan.scenery.windows, 0U);
}

// All the same: mid-grey, no division by nothing.
TEST(DisplayImage, OfOneValueIsInTheMiddleOfItsWindow)
{
    Plan plan;
    plan.fill([](Vec3) { return 7.0; });
    const auto codes = plan.shown("");
    EXPECT_TRUE(std::all_of(codes.begin(), codes.end(), [](std::uint16_t c) { return c == 0; }));
    EXPECT_EQ(plan.scenery.imageLow, 7);
    EXPECT_EQ(plan.scenery.window[0].low + plan.scenery.window[0].high, 14);
    EXPECT_LT(plan.scenery.window[0].low, plan.scenery.window[0].high);
}

// A body 0.4 mm thick and 300 mm long, of voxels of 0.01 x 0.01 x 30 mm: in cubes of 0.01 mm it would have 30 000 along.
TEST(DisplayGrid, OfALongThinBodyIsOneThatViewersTake)
{
    const volume::Tissue block = datasets::sceneVolume(datasets::parseScene(tests::blockScene, "test.toml"));
    volume::LabelImage thin = block.labels();
    thin.size = {40, 40, 10};
    thin.affine = {Mat3(Vec3(1e-5, 0, 0), Vec3(0, 1e-5, 0), Vec3(0, 0, 30e-3)), Vec3(0)};
    const std::uint16_t value = block.structures().back().value;
    thin.values.assign(40U * 40U * 10U, value);
    const std::vector<volume::LabelName> names{{value, "all", block.table().rows.back().name}};
    const volume::Tissue tissue = volume::Tissue::fromLabels(thin, block.table(), names, block.provenance());
    const volume::NodeGrid grid = displayGrid(tissue);
    EXPECT_LE(std::max({grid.size.x, grid.size.y, grid.size.z}), 4096);
    EXPECT_GT(grid.size.z, 3000) << "as fine as it may be";
}

// A lump shown has its place and its size, wherever the volume begins and whichever way its axes go. Ties between two
// voxels went to the lower one, and the lump was half a voxel off along each axis, or a voxel smaller.
TEST(DisplayGrid, ShowsALumpWhereItIs)
{
    const volume::Tissue block = datasets::sceneVolume(datasets::parseScene(tests::blockScene, "test.toml"));
    const std::vector<volume::LabelName> names{{1, "fat", "fat"}, {2, "lump", "tumour"}};
    std::mt19937 random(11);
    std::uniform_real_distribution<double> any(-1, 1);
    for (const Vec3 spacing :
         {Vec3(1e-3), Vec3(2e-3), Vec3(3e-3), Vec3(0.8e-3, 0.8e-3, 1.6e-3), Vec3(0.5e-3, 1.5e-3, 2e-3)}) {
        for (int trial = 0; trial < 4; ++trial) {
            volume::LabelImage image{{24, 25, 26}, {Mat3(0.0), Vec3(any(random), any(random), any(random)) * 0.1}, {}};
            for (int k = 0; k < 3; ++k) {
                image.affine.linear[k][(k + trial) % 3] = (random() % 2 == 0 ? 1 : -1) * spacing[k];
            }
            image.values.assign(image.offset(image.size - 1) + 1, 1);
            const Index3 low(8, 7, 9), high(13, 15, 12);
            volume::forEachIndex(low, high, [&](Index3 n) { image.values[image.offset(n)] = 2; });
            const auto tissue = volume::Tissue::fromLabels(image, block.table(), names, block.provenance());
            const volume::NodeGrid grid = displayGrid(tissue);
            const auto rows = tissue.tissueOn(grid);
            Vec3 sum(0.0);
            double count = 0.0;
            for (std::size_t i = 0; i < rows.size(); ++i) {
                if (rows[i] == *block.table().find("tumour")) {
                    sum += grid.position(grid.node(i));
                    ++count;
                }
            }
            const Vec3 middle = image.affine.toPatient(0.5 * Vec3(low + high));
            const double volume = 6.0 * 9.0 * 4.0 * image.affine.voxelVolume();
            EXPECT_LT(glm::distance(sum / count, middle), 1e-6) << spacing.x << " " << trial;
            EXPECT_NEAR(count * std::pow(grid.spacing, 3), volume, 1e-2 * volume) << spacing.x << " " << trial;
        }
    }
}

// A ramp in the volume is the same ramp at the viewer, wherever a display voxel and those around it are all tissue: the
// mean of a ramp over a voxel is its value in the middle.
TEST(DisplayImage, OfTheVolumeReachesTheViewer)
{
    auto scene = datasets::parseScene(tests::blockScene, "test.toml");
    const volume::Tissue plain = datasets::sceneVolume(scene);
    const volume::LabelImage labels = plain.labels();
    volume::CompanionImage ramp{{}, "HU", {}};
    const auto valueAt = [](Vec3 p) { return 3e3 * p.x - 2e3 * p.z; };  // of p [m]
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        ramp.values.push_back(static_cast<float>(valueAt(labels.affine.toPatient(Vec3(n)))));
    });
    std::vector<volume::LabelName> names;
    for (const auto& s : plain.structures()) {
        names.push_back({s.value, s.name, plain.table().rows[s.tissue].name});
    }
    const auto model = buildModel(std::move(scene), std::make_shared<const volume::Tissue>(volume::Tissue::fromLabels(
                                                        labels, plain.table(), names, plain.provenance(), &ramp)));
    const std::string session = "test-display-image-" + std::to_string(getpid());
    const auto publisher = publisherOf(session, model);
    const auto viewer = channel::Subscriber::attach(session);
    ASSERT_TRUE(viewer);
    const channel::Scenery& s = viewer->scenery();
    const volume::NodeGrid grid{Index3(s.labels.size[0], s.labels.size[1], s.labels.size[2]),
                                Vec3(s.labels.origin[0], s.labels.origin[1], s.labels.origin[2]), s.labels.spacing};
    ASSERT_EQ(viewer->image().size(), grid.count());
    std::size_t compared = 0;
    for (std::size_t i = 0; i < grid.count(); ++i) {
        const Index3 n = grid.node(i);
        bool inside = true;
        volume::forEachIndex(glm::max(n - 2, 0), glm::min(n + 2, grid.size - 1), [&](Index3 at) {
            inside = inside && (viewer->labels()[grid.offset(at)] & channel::rowBits) != 0;
        });
        if (inside) {
            ASSERT_NEAR(s.imageLow + s.imageStep * viewer->image()[i], valueAt(grid.position(n)), 0.01 + s.imageStep);
            ++compared;
        }
    }
    EXPECT_GT(compared, 1000U);
    EXPECT_STREQ(s.imageUnit.data(), "HU");
}

}  // namespace
}  // namespace palpate::haptics
