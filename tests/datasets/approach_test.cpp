#include <datasets/approach.h>
#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <datasets/tables.h>
#include <tests/datasets/voxels.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::datasets {
namespace {

using volume::Role;
using volume::Tissue;

std::uint16_t labelOf(const Tissue& tissue, const char* name)
{
    return structureNamed(tissue, name)->value;
}

// Places every 0.1 mm along the segment, voxel by voxel: the distance to the nearest box of anything vital, of bone or
// fixed [m].
double distanceToForbidden(const Tissue& tissue, const Voxels& voxels, Vec3 from, Vec3 to)
{
    std::vector<char> forbidden(65536, 0);
    for (const volume::Structure& s : tissue.structures()) {
        const volume::TissueRow& row = tissue.table().rows[s.tissue];
        forbidden[s.value] = row.role == Role::vital || row.role == Role::bone || row.fixed ? 1 : 0;
    }
    double least = 1.0;
    const Vec3 along = to - from;
    voxels.forEach([&](Index3 n, std::uint16_t value) {
        if (forbidden[value] == 0) {
            return;
        }
        const Vec3 p = tissue.affine().toPatient(Vec3(n));
        const double near = glm::clamp(glm::dot(p - from, along) / glm::dot(along, along), 0.0, 1.0);
        if (glm::length(p - from - near * along) > 12e-3) {
            return;
        }
        for (double t = 0.0; t <= glm::length(along); t += 0.1e-3) {
            const Vec3 away = glm::abs(p - from - t * glm::normalize(along)) - 0.5 * voxels.edge;
            least = std::min(least, glm::length(glm::max(away, Vec3(0.0))));
        }
    });
    return least;
}

TEST(PlanApproach, KeepsOffVitalStructuresAndStartsOnSkin)
{
    Scene scene = *builtInScene("breast");
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(seed);
        scene.source.phantom.seed = seed;
        const Tissue tissue = sceneVolume(scene);
        const Tissue::Reader reader(tissue);
        const Approach way = planApproach(scene, tissue);
        const Vec3 inward = glm::normalize(way.aim - way.entry);
        EXPECT_EQ(reader.label(way.entry + 0.3e-3 * inward), labelOf(tissue, "skin"));
        EXPECT_EQ(reader.label(way.entry - 0.3e-3 * inward), 0);
        EXPECT_EQ(reader.label(way.entry - 30e-3 * inward), 0);
        EXPECT_EQ(reader.label(way.aim), labelOf(tissue, "tumour"));
        const Vec3 fired = way.aim + scene.tool.notchLength / 2 * inward;
        EXPECT_GE(distanceToForbidden(tissue, Voxels(tissue), way.entry, fired), scene.tool.radius + 1.5e-3);
        const Approach again = planApproach(scene, tissue);
        EXPECT_EQ(again.entry, way.entry);
        EXPECT_EQ(again.aim, way.aim);
    }
}

// The deepest point of a sphere is its centre; the shortest way to it is straight from the front.
TEST(PlanApproach, AimsAtTheMiddleOfASphereByTheShortestWay)
{
    Scene scene = *builtInScene("block");
    scene.entry.reset();
    scene.aim.reset();
    const Tissue tissue = sceneVolume(scene);
    const Approach way = planApproach(scene, tissue);
    EXPECT_LT(glm::length(way.aim - Vec3(0, 0.025, 0)), 1e-3);
    EXPECT_LT(std::abs(way.entry.y), 0.3e-3);
    EXPECT_LT(glm::length(way.entry - way.aim), 0.0265);
    scene.entry = Vec3(0.01, 0, 0);
    EXPECT_EQ(planApproach(scene, tissue).entry, Vec3(0.01, 0, 0));
}

// Several ways, the best first, each as clear and as steep as it says, and no two alike.
TEST(ProposeApproaches, WaysDifferAndKeepTheirMargin)
{
    Scene scene = *builtInScene("breast");
    const Tissue tissue = sceneVolume(scene);
    const Voxels voxels(tissue);
    const std::vector<Proposal> ways = proposeApproaches(scene, tissue, 4, 3e-3);
    ASSERT_GE(ways.size(), 2U);
    EXPECT_EQ(proposeApproaches(scene, tissue, 4).front().approach.entry, planApproach(scene, tissue).entry);
    for (std::size_t i = 0; i < ways.size(); ++i) {
        SCOPED_TRACE(i);
        const Approach& way = ways[i].approach;
        const Vec3 inward = glm::normalize(way.aim - way.entry);
        EXPECT_DOUBLE_EQ(ways[i].length, glm::length(way.aim - way.entry));
        EXPECT_GE(ways[i].clearance, 3e-3);
        const Vec3 fired = way.aim + scene.tool.notchLength / 2 * inward;
        const double room = distanceToForbidden(tissue, voxels, way.entry, fired + 3e-3 * inward) - scene.tool.radius;
        EXPECT_NEAR(ways[i].clearance, std::min(room, 7e-3), 0.1e-3);
        EXPECT_LE(ways[i].angle, std::acos(0.5));
        for (std::size_t j = 0; j < i; ++j) {
            const Vec3 other = glm::normalize(ways[j].approach.aim - ways[j].approach.entry);
            const bool apart = glm::length(ways[j].approach.aim - way.aim) > 10e-3;
            EXPECT_TRUE(glm::dot(inward, other) < 0.941 || apart);
        }
    }
}

// The notch is 20 mm and the throw 22 mm: with 3 mm of tip in the skin the line must be 15 mm long for a centred notch. A
// tumour whose middle is nearer to the skin is reached at a slant.
TEST(PlanApproach, ReachesAShallowTargetAtASlant)
{
    Scene scene = *builtInScene("layered");
    scene.source.phantom.numbers["tumour_depth_mm"] = 4;
    const Tissue tissue = sceneVolume(scene);
    const Approach way = planApproach(scene, tissue);
    EXPECT_LT(way.aim.y, 0.0125);
    EXPECT_GT(glm::length(way.entry - way.aim), 0.0145);
}

/// A ball of fat in skin with a tumour in its middle, in a shell of bone when `shell`. 60 voxels of 1 mm.
Tissue ball(bool shell, const char* targetTissue)
{
    volume::LabelImage image;
    image.size = Index3(60);
    image.affine.linear = Mat3(1e-3);
    image.affine.origin = Vec3(-29.5e-3);
    for (int k = 0; k < 60; ++k) {
        for (int j = 0; j < 60; ++j) {
            for (int i = 0; i < 60; ++i) {
                const double r = glm::length(Vec3(i, j, k) - Vec3(29.5));
                const int bone = shell && r > 14 && r < 17 ? 4 : 1;
                image.values.push_back(static_cast<std::uint16_t>(r > 24 ? 0 : r > 22 ? 2 : r < 6 ? 3 : bone));
            }
        }
    }
    std::vector<volume::LabelName> names{
        {0, "air", "air"}, {1, "fat", "fat"}, {2, "skin", "skin"}, {3, "lump", targetTissue}, {4, "shell", "bone"}};
    return Tissue::fromLabels(image, defaultTissues(), names, {});
}

TEST(PlanApproach, SaysWhenThereIsNoWay)
{
    const Tissue open = ball(false, "ilc");
    const Scene scene = sceneForVolume("ball.vdb", open);
    EXPECT_EQ(scene.target, "lump");
    EXPECT_NEAR(glm::length(planApproach(scene, open).entry), 24e-3, 1.5e-3);
    try {
        planApproach(scene, ball(true, "ilc"));
        FAIL() << "went through bone";
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("no straight way to 'lump'"), std::string::npos) << e.what();
    }
}

// A cube of fat with a lump in its middle, so many voxels of air from the border on all sides.
Tissue cubeInAir(int air)
{
    volume::LabelImage image;
    image.size = Index3(20 + 2 * air);
    image.affine.linear = Mat3(2e-3);
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const int inside =
            std::min({n.x, n.y, n.z, image.size.x - 1 - n.x, image.size.y - 1 - n.y, image.size.z - 1 - n.z});
        image.values.push_back(static_cast<std::uint16_t>(inside < air ? 0 : inside < air + 7 ? 1 : 2));
    });
    return Tissue::fromLabels(image, defaultTissues(),
                              std::vector<volume::LabelName>{{1, "fat", "fat"}, {2, "lump", "ilc"}}, {});
}

TEST(PlanApproach, NeedsThreeVoxelsOfAirToTheBorderAndSaysSo)
{
    const Scene scene = sceneForVolume("cube.vdb", cubeInAir(3));
    EXPECT_NO_THROW(planApproach(scene, cubeInAir(3)));
    try {
        planApproach(scene, cubeInAir(2));
        FAIL() << "took a cut for skin";
    } catch (const std::runtime_error& e) {
        EXPECT_NE(std::string(e.what()).find("go out within 3 voxels of the volume's border"), std::string::npos)
            << e.what();
        EXPECT_NE(std::string(e.what()).find("add 4 voxels of air"), std::string::npos) << e.what();
        EXPECT_EQ(std::string(e.what()).find("bone"), std::string::npos) << e.what();
    }
}

TEST(SceneForVolume, NamesItsTargetAndVitalStructures)
{
    Scene breast = *builtInScene("breast");
    const Tissue tissue = sceneVolume(breast);
    const Scene scene = sceneForVolume("folder/patient.vdb", tissue);
    EXPECT_EQ(scene.target, "tumour");
    ASSERT_EQ(scene.vital.size(), 2U);
    const bool arteryFirst = structureNamed(tissue, "artery")->volume > structureNamed(tissue, "vein")->volume;
    EXPECT_EQ(scene.vital[0].name, arteryFirst ? "artery" : "vein");
    EXPECT_TRUE(scene.source.file.is_absolute());
    EXPECT_EQ(sceneText(parseScene(scene.text, "/elsewhere/record.db")), sceneText(scene));
    try {
        sceneForVolume("healthy.vdb", ball(false, "fat"));
        FAIL() << "chose a target";
    } catch (const std::runtime_error& e) {
        EXPECT_EQ(std::string(e.what()),
                  "healthy.vdb: no tumour or lesion to aim at: choose with --target NAME, one of fat, skin, lump");
    }
}

// After the throw the notch's middle is at the aim: tip = entry + depth + throw, middle half a notch behind the tip.
TEST(TraineeScript, TheFiredNotchIsCentredOnTheAim)
{
    Scene scene = *builtInScene("breast");
    const Approach way{Vec3(0.01, -0.05, 0), Vec3(0.0, -0.02, 0.01)};
    const Vec3 inward = glm::normalize(way.aim - way.entry);
    const std::vector<TraineeStep> script = traineeScript(scene, way);
    ASSERT_EQ(script.size(), 7U);
    EXPECT_NEAR(glm::length(script[0].to - way.entry), 30e-3, 1e-9);
    EXPECT_EQ(script[2].kind, TraineeStep::Kind::pierce);
    EXPECT_EQ(script[3].kind, TraineeStep::Kind::press);
    EXPECT_EQ(script[4].kind, TraineeStep::Kind::fire);
    const Vec3 middle = script[3].to + (scene.tool.throwLength - scene.tool.notchLength / 2) * inward;
    EXPECT_LT(glm::length(middle - way.aim), 1e-9);
    EXPECT_EQ(script[6].to, script[0].to);

    // A shallow target: the tip goes 3 mm in all the same.
    const Approach shallow{way.entry, way.entry + 8e-3 * inward};
    EXPECT_NEAR(glm::dot(traineeScript(scene, shallow)[3].to - way.entry, inward), 3e-3, 1e-9);
    scene.script = {{.kind = TraineeStep::Kind::fire}};
    EXPECT_EQ(traineeScript(scene, way).size(), 1U);
}

TEST(TraineeScript, DoesWhatTheSceneAsksForAndFiresNothingElse)
{
    Scene scene = *builtInScene("breast");
    const Approach way{Vec3(0, -0.05, 0), Vec3(0, -0.02, 0)};
    const auto has = [](const std::vector<TraineeStep>& script, TraineeStep::Kind kind) {
        return std::any_of(script.begin(), script.end(), [&](const TraineeStep& s) { return s.kind == kind; });
    };
    scene.task = SessionTask::touch;
    const std::vector<TraineeStep> touch = traineeScript(scene, way);
    EXPECT_FALSE(has(touch, TraineeStep::Kind::pierce) || has(touch, TraineeStep::Kind::fire));
    EXPECT_LT(touch[2].to.y - way.entry.y, 3e-3);
    EXPECT_GT(touch[3].seconds, 3);
    scene.task = SessionTask::advance;
    const std::vector<TraineeStep> advance = traineeScript(scene, way);
    EXPECT_TRUE(has(advance, TraineeStep::Kind::pierce));
    EXPECT_FALSE(has(advance, TraineeStep::Kind::fire));
    EXPECT_EQ(advance[3].to, way.aim);
}

}  // namespace
}  // namespace palpate::datasets
