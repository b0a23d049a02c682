#include <datasets/tables.h>
#include <volume/prepare/steps.h>

#include <gtest/gtest.h>

#include <algorithm>

namespace palpate::prepare {
namespace {

using volume::LabelImage;
using volume::LabelName;

LabelImage block(Index3 size, std::uint16_t around)
{
    LabelImage image{size, {Mat3(1e-3), Vec3(0.0)}, {}};
    image.values.assign(base::countOf(size), around);
    return image;
}

void put(LabelImage& image, Index3 low, Index3 high, std::uint16_t value)
{
    volume::forEachIndex(low, high, [&](Index3 n) { image.values[image.offset(n)] = value; });
}

std::vector<PreparationStep> prepared(LabelImage& image, std::vector<LabelName>& names, const PreparationOptions& options)
{
    return prepare(image, names, datasets::defaultTissues(), options, [](const std::string&) {});
}

std::uint64_t countOf(const LabelImage& image, std::uint16_t value)
{
    return static_cast<std::uint64_t>(std::ranges::count(image.values, value));
}

// Voxels that a step adds are label 0: where that is tissue, it needs another value before.
TEST(Steps, TissueOfLabelZeroGetsAValueOfItsOwn)
{
    LabelImage image = block(Index3(10), 0);
    put(image, Index3(4), Index3(5), 3);
    std::vector<LabelName> names{{0, "background", "fat"}, {3, "lump", "idc_high_grade"}};
    const auto steps = separateOutside(image, names, datasets::defaultTissues());
    ASSERT_EQ(steps.size(), 1U);
    EXPECT_EQ(steps[0].voxels, 992U);
    EXPECT_EQ(names[0].value, 1);
    EXPECT_EQ(countOf(image, 1), 992U);
    EXPECT_EQ(countOf(image, 3), 8U);
    PreparationOptions options;
    options.pad = 2e-3;
    prepared(image, names, options);
    EXPECT_EQ(countOf(image, 0), 14U * 14 * 14 - 1000);
    EXPECT_EQ(countOf(image, 1), 992U);

    for (const char* tissue : {"air", ""}) {
        std::vector<LabelName> outside{{0, "background", tissue}};
        EXPECT_TRUE(separateOutside(image, outside, datasets::defaultTissues()).empty());
        EXPECT_EQ(outside[0].value, 0);
    }
}

// What came of skin is told as it is, and not as it was asked for.
TEST(Steps, SkinSaysHowThickItIsAndWarnsOfCoarseVoxels)
{
    const auto skinOf = [](double thickness) {
        LabelImage image = block(Index3(20), 0);
        put(image, Index3(4), Index3(15), 1);
        std::vector<LabelName> names{{1, "body", "fat"}};
        PreparationOptions options;
        options.addSkin = thickness;
        return prepared(image, names, options).at(0);
    };
    EXPECT_NE(skinOf(1.5e-3).text.find("it is 1 mm thick on average, 1.5 mm were asked for"), std::string::npos)
        << skinOf(1.5e-3).text;
    EXPECT_EQ(skinOf(1.5e-3).warning, "");
    EXPECT_EQ(skinOf(0.3e-3).voxels, 12U * 12 * 12 - 10 * 10 * 10);
    EXPECT_NE(skinOf(0.3e-3).warning.find("voxels are up to 1 mm wide"), std::string::npos);
}

// 27 structures of one voxel in the voxels around one, and another that lies in the middle one only: no room is left.
TEST(Steps, AStructureThatResamplingLosesIsWarnedOf)
{
    LabelImage image = block(Index3(60), 1);
    std::uint16_t label = 2;
    volume::forEachIndex(Index3(4), Index3(6), [&](Index3 n) { put(image, 5 * n, 5 * n + 3, label++); });
    put(image, Index3(29), Index3(29), 100);
    std::vector<LabelName> names{{1, "body", "fat"}, {100, "speck", "artery"}};
    PreparationOptions options;
    options.voxel = 5e-3;
    const auto steps = prepared(image, names, options);
    std::uint64_t warnings = 0;
    for (const PreparationStep& step : steps) {
        warnings += step.warning.empty() ? 0 : 1;
        if (step.structure == "speck") {
            EXPECT_EQ(step.volume, 0.0);
            EXPECT_NE(step.warning.find("'speck' (0.001 ml) is lost"), std::string::npos) << step.warning;
        }
    }
    EXPECT_EQ(warnings, 1U);
}

}  // namespace
}  // namespace palpate::prepare
