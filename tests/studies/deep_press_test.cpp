#include <studies/accuracy/deep_press.h>

#include <tests/error_of.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <utility>

namespace palpate::studies {
namespace {

using tests::errorOf;

const std::string head = "# a comment\nscene,tool,radius_mm,length_mm,depth_mm,way,fx_n,fy_n,fz_n,edges_mm,elements\n";

std::vector<DeepCase> readCases(const std::string& text)
{
    std::istringstream in(text);
    return readDeepCases(in, "deep.csv");
}

TEST(DeepReferences, RowsOfOneToolAndSceneAreOneCase)
{
    const auto cases =
        readCases(head +
                  "block,sphere,10,0,0.5,in,0,-0.1,0.02,0.4,1000\r\nplate,capsule,6,30,1,in,0,-0.2,0,1,10\n\n"
                  "block,sphere, 10,0,2,out,0,-0.3,0,1.5,2000\n");
    ASSERT_EQ(cases.size(), 2U);
    EXPECT_EQ(cases[0].scene, "block");
    EXPECT_EQ(cases[0].tool.kind, TrialKind::sphere);
    ASSERT_EQ(cases[0].references.size(), 2U);
    const DeepReference& last = cases[0].references[1];
    EXPECT_EQ(last.way, PressWay::out);
    EXPECT_NEAR(last.depth, 2e-3, 1e-15);
    EXPECT_NEAR(cases[0].deepest(), 2e-3, 1e-15);
    EXPECT_EQ(cases[0].references[0].force, Vec3(0.0, -0.1, 0.02));
    EXPECT_NEAR(last.edges, 1.5e-3, 1e-15);
    EXPECT_EQ(last.elements, 2000U);
    EXPECT_EQ(cases[1].tool.kind, TrialKind::capsule);
    EXPECT_NEAR(cases[1].tool.length, 30e-3, 1e-15);
}

TEST(DeepReferences, WhatIsWrongIsSaidOnOneLineWithItsPlace)
{
    const auto refusal = [](const std::string& text) { return errorOf([&] { readCases(text); }); };
    EXPECT_EQ(refusal(head + "block,sphere,10,0,1,in,0,-0.1\n").find("deep.csv:3: 8 values: must be 11"), 0U);
    EXPECT_EQ(refusal(head + "block,cube,10,0,1,in,0,-0.1,0,1,9\n"),
              "deep.csv:3: tool = 'cube': must be sphere or capsule");
    EXPECT_EQ(refusal(head + "block,sphere,10,0,1,up,0,-0.1,0,1,9\n"), "deep.csv:3: way = 'up': must be in or out");
    EXPECT_EQ(refusal(head + "block,sphere,10,0,deep,in,0,-0.1,0,1,9\n"),
              "deep.csv:3: depth_mm = 'deep': must be a number from 0.01 to 200");
    EXPECT_EQ(refusal(head + "block,sphere,10,0,1,in,nan,-0.1,0,1,9\n").find("deep.csv:3: fx_n = 'nan'"), 0U);
    EXPECT_EQ(refusal(head + "block,sphere,10,5,1,in,0,-0.1,0,1,9\n"),
              "deep.csv:3: length_mm = '5': must be a number from 0 to 0");
    EXPECT_EQ(refusal("block,sphere,10,0,1,in,0,-0.1,0,1,9\n").find("deep.csv:1: no line of column names"), 0U);
    EXPECT_EQ(refusal(head), "deep.csv: holds no forces");
    EXPECT_NE(errorOf([] { loadDeepCases("nowhere.csv"); }).find("nowhere.csv: cannot be read"), std::string::npos);
    EXPECT_EQ(refusal(head + "block,sphere,10,0,1,in,0,-0.1\n").find('\n'), std::string::npos);
}

// The tissue pushes out, the more so the deeper the tool is.
TEST(DeepReferences, StoredForcesGrowWithTheDepth)
{
    for (const DeepCase& c : loadDeepCases(PALPATE_REFERENCES "/deep.csv")) {
        std::vector<DeepReference> sorted = c.references;
        std::ranges::stable_sort(sorted, {}, &DeepReference::depth);
        for (std::size_t i = 0; i < sorted.size(); ++i) {
            EXPECT_LT(sorted[i].force.y, 0.0);
            if (i > 0 && sorted[i].depth > sorted[i - 1].depth) {
                EXPECT_GT(glm::length(sorted[i].force), glm::length(sorted[i - 1].force)) << c.scene << ", " << c.tool.name;
            }
        }
    }
}

// A sphere of 10 mm on cells of 2 mm: a = 1 mm at 0.1 mm of depth, 3 mm at 0.9 mm.
TEST(DeepPress, ZonesGoByTheContactsRadiusAndThenByTheDepth)
{
    const auto zone = [](double depth) { return zoneOf(depth, 10e-3, 2e-3); };
    EXPECT_EQ(zone(0.09e-3), DeepZone::faint);
    EXPECT_EQ(zone(0.11e-3), DeepZone::touch);
    EXPECT_EQ(zone(0.89e-3), DeepZone::touch);
    EXPECT_EQ(zone(0.91e-3), DeepZone::middle);
    EXPECT_EQ(zone(10e-3), DeepZone::middle);
    EXPECT_EQ(zone(15e-3), DeepZone::deep);
    EXPECT_EQ(zone(20e-3), DeepZone::deepest);
    EXPECT_EQ(zoneOf(9e-3, 6e-3, 8e-3), DeepZone::deep);  // under 1.5 cells, but more than a radius deep
}

TEST(DeepPress, PlacesStandForAWholeCell)
{
    int sum = 0;
    for (const GridPlace& place : gridPlaces()) {
        sum += place.weight;
    }
    EXPECT_EQ(sum, 16);
}

haptics::SessionModel modelOf(const std::string& name)
{
    auto scene = datasets::builtInScene(name).value();
    scene.model.level = datasets::ModelLevel::spring;  // the press makes its own body
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

// 3 % at 1 and 1.5 radii, on the way in and out, and no pull in any tick. A surface that slips around the sphere pulls it
// inwards here, by more than a newton.
TEST(DeepPress, TheBlocksForceIsThatOfFiniteElementsToOneAndAHalfRadii)
{
    const haptics::SessionModel model = modelOf("block");
    auto cases = loadDeepCases(PALPATE_REFERENCES "/deep.csv");
    const auto block = std::ranges::find(cases, "block", &DeepCase::scene);
    ASSERT_NE(block, cases.end());
    std::erase_if(block->references, [](const DeepReference& r) {
        return r.way == PressWay::out || r.depth > 15.1e-3 || r.depth < 9.9e-3 || std::abs(r.depth - 12.5e-3) < 1e-4;
    });
    ASSERT_EQ(block->references.size(), 2U);
    const DeepPress press =
        pressDeep(model, *block, datasets::elasticSetting("default"), {.places = gridPlaces().first(1)});
    ASSERT_EQ(press.looks.size(), 4U);  // in and out at 10 mm, in and after the hold at 15 mm
    for (const DeepLook& look : press.looks) {
        EXPECT_LT(std::abs(look.errorPercent()), 3.0) << wayName(look.way) << ", " << 1e3 * look.depth << " mm";
        EXPECT_LT(look.directionDegrees(), 1.0) << wayName(look.way) << ", " << 1e3 * look.depth << " mm";
    }
    EXPECT_EQ(press.pull, 0.0);
    EXPECT_GT(press.ticks, 1600U);
}

// Over the lump cells under the ball are stretched to twice their width: 4.2 % too stiff at two radii, and 2 % more where
// bending grows with the square of the stretch.
TEST(DeepPress, OverTheLumpTheForceIsThatOfFiniteElementsToTwoRadii)
{
    const haptics::SessionModel model = modelOf("find-lump");
    auto cases = loadDeepCases(PALPATE_REFERENCES "/deep.csv");
    const auto ball =
        std::ranges::find_if(cases, [](const DeepCase& c) { return c.scene == "find-lump" && c.tool.length <= 0.0; });
    ASSERT_NE(ball, cases.end());
    const double radius = ball->tool.radius;
    std::erase_if(ball->references,
                  [&](const DeepReference& r) { return r.way == PressWay::out || r.depth < 1.45 * radius; });
    ASSERT_GE(ball->references.size(), 2U);
    const DeepPress press = pressDeep(model, *ball, datasets::elasticSetting("default"), {.places = gridPlaces().first(1)});
    for (const DeepLook& look : press.looks) {
        EXPECT_LT(std::abs(look.errorPercent()), look.depth > 1.55 * radius ? 5.0 : 2.0)
            << wayName(look.way) << ", " << 1e3 * look.depth << " mm";
    }
    EXPECT_EQ(press.pull, 0.0);
}

}  // namespace
}  // namespace palpate::studies
