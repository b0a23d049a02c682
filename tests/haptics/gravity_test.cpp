#include "models.h"

#include <haptics/posed.h>
#include <haptics/replay.h>
#include <tests/error_of.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <string>
#include <utility>

namespace palpate::haptics {
namespace {

using tests::errorOf;
using tests::modelOf;

// A small breast of soft tissue: it moves by millimetres.
std::string breast(const std::string& target, const std::string& more)
{
    return "name = \"turned\"\n[volume]\nphantom = \"breast\"\nvoxel_mm = 3\n[target]\n" + target + more;
}
const std::string tumour = "structure = \"tumour\"\n";
const std::string toProne = "[gravity]\nposture = \"prone\"\nshape = \"unloaded\"\nmodulus = 0.3\n";

struct Volume {
    datasets::Scene scene;
    std::shared_ptr<const volume::Tissue> tissue;
};

Volume volumeOf(const std::string& text)
{
    auto scene = datasets::parseScene(text, "turned.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return {std::move(scene), std::move(tissue)};
}

Vec3 middleOf(const volume::Tissue& tissue, const std::string& structure)
{
    const volume::LabelImage image = tissue.labels();
    const auto labels = tissue.labelsNamed(structure);
    Vec3 sum(0.0);
    double count = 0.0;
    volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        if (image.values[image.offset(n)] == labels.at(0)) {
            sum += image.affine.toPatient(Vec3(n));
            count += 1.0;
        }
    });
    return sum / count;
}

// Prone tissue falls to the front; the aim of the scene stays in the tumour, and the way in on the skin.
TEST(Gravity, TheTargetAndThePlanMoveWithTheTissue)
{
    const auto flat = modelOf(breast(tumour, ""));
    const auto mm = [](Vec3 p) {
        return " = [" + std::to_string(1e3 * p.x) + ", " + std::to_string(1e3 * p.y) + ", " + std::to_string(1e3 * p.z) +
               "]\n";
    };
    const auto turned =
        modelOf(breast(tumour + "entry_mm" + mm(flat.approach.entry) + "aim_mm" + mm(flat.approach.aim), toProne));
    ASSERT_TRUE(turned.posture);
    EXPECT_GT(turned.posture->farthest, 1.5e-3);
    const Vec3 before = middleOf(*flat.tissue, "tumour"), after = middleOf(*turned.tissue, "tumour");
    EXPECT_LT(after.y, before.y - 0.8e-3);
    EXPECT_LT(glm::length((turned.approach.aim - flat.approach.aim) - (after - before)), 1.5e-3);
    EXPECT_LT(turned.approach.entry.y, flat.approach.entry.y - 0.8e-3);
    EXPECT_LT(std::abs(turned.surface.distance(turned.approach.entry)), 2e-3);
    // The scene keeps what its text says, so that the text gives the same session again.
    EXPECT_NEAR(turned.scene.entry->y, flat.approach.entry.y, 1e-8);
    EXPECT_EQ(modelHash(modelOf(turned.scene.text)), modelHash(turned));
}

TEST(Gravity, ThePostureOfTheVolumeOrNoGravityChangesNoBit)
{
    const std::string plain = modelHash(modelOf(breast(tumour, "")));
    for (const std::string gravity :
         {"[gravity]\nposture = \"supine\"\nshape = \"supine\"\n", "[gravity]\ndirection = [0, 2, 0]\nshape = \"supine\"\n",
          "[gravity]\nposture = \"prone\"\nshape = \"supine\"\ng_m_s2 = 0\n"}) {
        const auto model = modelOf(breast(tumour, gravity));
        EXPECT_FALSE(model.posture) << gravity;
        EXPECT_EQ(modelHash(model), plain) << gravity;
    }
}

// A ghost is shown beside a session in the same body, whatever either was set to and whatever is done in it.
TEST(BodyHash, TellsBodiesApartAndNoSettings)
{
    const auto hashes = [](const std::string& target, const std::string& more) {
        const auto model = modelOf(breast(target, more));
        return std::pair(modelHash(model), bodyHash(model));
    };
    const auto plain = hashes(tumour, "[model]\nsetting = \"default\"\n");
    for (const std::string setting : {"[model]\nsetting = \"fast\"\n", "[model]\nlevel = \"spring\"\nspacing_mm = 3\n"}) {
        const auto other = hashes(tumour, setting);
        EXPECT_NE(other.first, plain.first) << setting;
        EXPECT_EQ(other.second, plain.second) << setting;
    }
    EXPECT_EQ(hashes(tumour, "[[vital]]\nname = \"muscle\"\nwarn_mm = 3\n").second, plain.second);
    EXPECT_NE(hashes(tumour, toProne).second, plain.second);
    EXPECT_NE(hashes(tumour, "[volume.parameters]\ntumour_diameter_mm = 9\n").second, plain.second);
}

TEST(Gravity, PlacesThatWouldNotMoveWithTheTissueAreRefused)
{
    const auto refusal = [](const std::string& target, const std::string& more) {
        const Volume v = volumeOf(breast(target, more));
        return errorOf([&] { posed(v.scene, v.tissue); });
    };
    EXPECT_NE(refusal(tumour, toProne + "[[script]]\nkind = \"move\"\nto_mm = [0, 0, 0]\n").find("[[script]]"),
              std::string::npos);
    EXPECT_NE(refusal(tumour, toProne + "[probe]\nkind = \"linear\"\nface_mm = [0, 0, 0]\ndirection = [0, 1, 0]\n"
                                        "lateral = [1, 0, 0]\n")
                  .find("over_target"),
              std::string::npos);
    const std::string inAir = refusal(tumour + "entry_mm = [0, -900, 0]\n", toProne);
    EXPECT_NE(inAir.find("entry_mm = [0, -900, 0] mm"), std::string::npos) << inAir;
    EXPECT_EQ(refusal(tumour, toProne + "[[script]]\nkind = \"wait\"\nseconds = 1\n"), "");
}

}  // namespace
}  // namespace palpate::haptics
