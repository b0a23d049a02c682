#include <session/rehearsal.h>

#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace palpate::session {
namespace {

haptics::SessionModel block(const std::string& model, const std::string& tool)
{
    auto scene = datasets::parseScene(
        "[volume]\nphantom = \"block\"\n[target]\nstructure = \"tumour\"\n" + tool + "[model]\n" + model, "rehearsal.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

const std::string ball = "[tool]\nkind = \"sphere\"\nradius_mm = 10\n";

TEST(Rehearsal, TellsAHopelessModelFromAnOrdinaryOne)
{
    const Rehearsal spring = rehearse(block("level = \"spring\"\n", ball));
    const Rehearsal absurd = rehearse(block("level = \"elastic\"\n[model.elastic]\nwindow = 41\ncycles = 100\n", ball));
    EXPECT_GT(spring.p50, 0.0);
    EXPECT_GE(spring.worst, 0.98 * spring.p50);  // a histogram's bins are 1 % wide
    EXPECT_GT(absurd.p50, 20 * spring.p50);
}

TEST(Rehearsal, RefusesOnlyWhatNobodyWantsToWaitFor)
{
    EXPECT_EQ(whyTooSlow({0.9e-3, 30e-3}, true), "");
    EXPECT_EQ(whyTooSlow({4.9e-3, 30e-3}, true), "");
    EXPECT_EQ(whyTooSlow({59e-3, 90e-3}, false), "");
    const std::string paced = whyTooSlow({7e-3, 30e-3}, true), unpaced = whyTooSlow({90e-3, 120e-3}, false);
    EXPECT_NE(paced.find("takes 7 ms here (30 ms at worst), and there is 1 ms"), std::string::npos) << paced;
    EXPECT_NE(unpaced.find("a second of the session takes 90 s"), std::string::npos) << unpaced;
    for (const std::string& text : {paced, unpaced}) {
        EXPECT_NE(text.find("--anyway"), std::string::npos) << text;
        EXPECT_EQ(text.find('\n'), std::string::npos);
    }
}

}  // namespace
}  // namespace palpate::session
