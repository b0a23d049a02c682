#include <datasets/approach.h>
#include <datasets/tables.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace palpate::datasets {
namespace {

using volume::CompanionImage;
using volume::LabelImage;
using volume::LabelName;
using volume::Tissue;

constexpr double voxel = 2e-3;
const std::vector<LabelName> names{
    {1, "skin", "skin"},   {2, "soft tissue", "soft_tissue"}, {3, "left lung", "lung"}, {4, "right lung", "lung"},
    {5, "colon", "bowel"}, {6, "mass", "idc_high_grade"},     {7, "kidney", "kidney"},  {8, "liver", "liver"}};

double ball(Vec3 p, Vec3 middle)
{
    return glm::length(p - middle);
}

// A trunk of skin and soft tissue in the middle of air, and what `inside` puts into it (0: nothing).
LabelImage trunk(const std::function<int(Vec3)>& inside, bool skin = true)
{
    LabelImage image{{90, 80, 60}, {Mat3(voxel), -0.5 * voxel * Vec3(89, 79, 59)}, {}};
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const Vec3 p = image.affine.toPatient(Vec3(n));
        const double r = std::hypot(p.x / 0.07, p.y / 0.055);
        const int own = r < 0.9 ? inside(p) : 0;
        image.values.push_back(static_cast<std::uint16_t>(r > 1 ? 0 : own != 0 ? own : r > 0.95 && skin ? 1 : 2));
    });
    return image;
}

Tissue tissueOf(const LabelImage& image, const CompanionImage* companion = nullptr)
{
    return Tissue::fromLabels(image, defaultTissues(), names, {}, companion);
}

Scene sceneFor(const Tissue& tissue)
{
    return sceneForVolume("trunk.vdb", tissue, "mass");
}

std::string errorOf(const Scene& scene, const Tissue& tissue)
{
    return tests::errorOf([&] { proposeApproaches(scene, tissue, 3); });
}

int lungs(Vec3 p)
{
    return ball(p, {0.036, 0, 0}) < 0.022 ? 3 : ball(p, {-0.036, 0, 0}) < 0.022 ? 4 : 0;
}

// A mass between the lungs: every way in goes through what is between them, or through a lung.
TEST(WayJudge, RefusesTheMediastinumWithTheReason)
{
    const Tissue tissue = tissueOf(trunk([](Vec3 p) { return ball(p, Vec3(0.0)) < 6e-3 ? 6 : lungs(p); }));
    const std::string error = errorOf(sceneFor(tissue), tissue);
    EXPECT_NE(error.find("through the mediastinum, between the lungs"), std::string::npos) << error;
}

// In a liver between the lungs, labelled as one, it is reached.
TEST(WayJudge, TakesNoOrganOfTheAbdomenForTheMediastinum)
{
    const Tissue tissue = tissueOf(trunk([](Vec3 p) {
        return ball(p, Vec3(0.0)) < 6e-3 ? 6 : lungs(p) != 0 ? lungs(p) : std::abs(p.x) < 0.013 ? 8 : 0;
    }));
    EXPECT_EQ(errorOf(sceneFor(tissue), tissue), "");
}

// A mass in a lung is reached through that lung, and through no other.
TEST(WayJudge, GoesThroughTheOrganOfTheTarget)
{
    const Vec3 mass(0.036, 0, 0);
    const Tissue tissue = tissueOf(trunk([&](Vec3 p) { return ball(p, mass) < 6e-3 ? 6 : lungs(p); }));
    const auto ways = proposeApproaches(sceneFor(tissue), tissue, 5);
    for (const Proposal& way : ways) {
        bool lung = false;
        for (const Crossing& c : way.verdict.crossings) {
            lung = lung || c.structure == "left lung";
            EXPECT_NE(c.structure, "right lung");
        }
        EXPECT_TRUE(lung);
        EXPECT_GT(way.approach.entry.x, 0.0);
    }
}

// Bowel in front of a mass: the ways come from elsewhere. The lengths of what they cross add up to the way.
TEST(WayJudge, GoesAroundBowel)
{
    const auto inside = [](Vec3 p) {
        const bool front = p.y < -0.016 && p.y > -0.036 && std::abs(p.x) < 0.045;
        return ball(p, Vec3(0.0)) < 8e-3 ? 6 : front ? 5 : 0;
    };
    const Tissue tissue = tissueOf(trunk(inside));
    const auto ways = proposeApproaches(sceneFor(tissue), tissue, 5);
    for (const Proposal& way : ways) {
        double sum = 0;
        for (const Crossing& c : way.verdict.crossings) {
            EXPECT_NE(c.structure, "colon");
            sum += c.length;
        }
        EXPECT_TRUE(way.verdict.warnings.empty());
        EXPECT_GT(sum, way.length - 8e-3 - 3e-3);
        EXPECT_EQ(way.verdict.crossings.front().structure, "skin");
    }
}

// A kidney is reached from the back, though the way from the front is a little shorter.
TEST(WayJudge, TakesTheUsualCorridorOfAnOrgan)
{
    const Vec3 kidney(0, -0.004, 0);
    const Tissue tissue = tissueOf(trunk([&](Vec3 p) {
        return ball(p, kidney) < 6e-3 ? 6 : ball(p, kidney) < 0.016 ? 7 : 0;
    }));
    const auto ways = proposeApproaches(sceneFor(tissue), tissue, 1);
    EXPECT_EQ(ways.front().verdict.corridor, "from the back or flank");
    const Vec3 out = ways.front().approach.entry - ways.front().approach.aim;
    EXPECT_GT(out.y, -0.3 * glm::length(out));
}

// The CT of the trunk, with what `more` changes in it.
CompanionImage ctOf(const LabelImage& image, const std::function<std::optional<float>(Vec3)>& more)
{
    CompanionImage ct{{}, "HU", {}};
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const auto other = more(image.affine.toPatient(Vec3(n)));
        ct.values.push_back(other ? *other : image.values[image.offset(n)] != 0 ? 50.0F : -1000.0F);
    });
    return ct;
}

// A wall of contrast medium around the mass, in soft tissue by its label: the image says what it is.
TEST(WayJudge, SeesVesselsInTheImage)
{
    const LabelImage image = trunk([](Vec3 p) { return ball(p, Vec3(0.0)) < 6e-3 ? 6 : 0; });
    const CompanionImage ct = ctOf(image, [](Vec3 p) -> std::optional<float> {
        const double r = ball(p, Vec3(0.0));
        return r > 0.012 && r < 0.022 ? std::optional(250.0F) : std::nullopt;
    });
    const Tissue tissue = tissueOf(image, &ct);
    const std::string error = errorOf(sceneFor(tissue), tissue);
    EXPECT_NE(error.find("through what the image shows as a vessel or bone"), std::string::npos) << error;
}

// A segmentation of the mass and what is near it: the CT goes on where the labels end.
TEST(WayJudge, WarnsOfAnEntryInsideThePatient)
{
    LabelImage image = trunk([](Vec3 p) { return ball(p, Vec3(0.0)) < 8e-3 ? 6 : 0; }, false);
    const CompanionImage ct = ctOf(image, [](Vec3) { return std::nullopt; });
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        const auto n = static_cast<int>(i);
        const Index3 at(n % 90, n / 90 % 80, n / 7200);
        image.values[i] = ball(image.affine.toPatient(Vec3(at)), Vec3(0.0)) < 0.02 ? image.values[i] : std::uint16_t{0};
    }
    const Tissue tissue = tissueOf(image, &ct);
    const auto ways = proposeApproaches(sceneFor(tissue), tissue, 1);
    ASSERT_EQ(ways.front().verdict.warnings.size(), 2U);
    EXPECT_NE(ways.front().verdict.warnings[0].find("the entry lies inside the patient"), std::string::npos);
    EXPECT_NE(ways.front().verdict.warnings[1].find("nothing in the volume is skin"), std::string::npos);
}

// A pocket that no label has, in the middle of the way.
TEST(WayJudge, WarnsOfUnlabelledTissueOnTheWay)
{
    LabelImage image = trunk([](Vec3 p) { return ball(p, Vec3(0.0)) < 8e-3 ? 6 : 0; });
    const CompanionImage ct = ctOf(image, [](Vec3) { return std::nullopt; });
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        const auto n = static_cast<int>(i);
        const double r = ball(image.affine.toPatient(Vec3(n % 90, n / 90 % 80, n / 7200)), Vec3(0.0));
        image.values[i] = r > 0.012 && r < 0.02 ? std::uint16_t{0} : image.values[i];
    }
    const Tissue tissue = tissueOf(image, &ct);
    const auto ways = proposeApproaches(sceneFor(tissue), tissue, 1);
    ASSERT_EQ(ways.front().verdict.warnings.size(), 1U);
    EXPECT_NE(ways.front().verdict.warnings[0].find("are tissue by the image"), std::string::npos);
}

}  // namespace
}  // namespace palpate::datasets
