// The first exercises ask for no core: who does what the briefing says has all points and reaches the level.
#include <haptics/hand.h>
#include <haptics/losses.h>
#include <haptics/simulation.h>
#include <session/devices.h>
#include <session/open.h>
#include <training/case.h>
#include <training/store.h>

#include <tests/training/courses.h>

#include <gtest/gtest.h>

#include <memory>

namespace palpate::training {
namespace {

struct Done {
    haptics::Score score;
    std::vector<haptics::Loss> losses;
};

haptics::SessionModel modelOfCase(const std::string& id)
{
    useOwnData();
    session::SceneChanges changes;
    changes.setting = "fast";
    return session::openSession(findCase(id).scene, changes);
}

Done done(const haptics::SessionModel& model, haptics::Device& hand)
{
    constexpr int longest = 60'000;
    const haptics::SessionInfo info = session::describeSession(model, "case", "hand");
    haptics::LossWatch watch(info);
    auto simulation = std::make_unique<haptics::Simulation>(model);
    for (int i = 0; i < longest && !hand.finished(); ++i) {
        const haptics::TickRecord& r = simulation->tick(hand.read());
        hand.write(r.total);
        hand.observe(r);
        watch.add(r);
    }
    EXPECT_TRUE(hand.finished());
    return {watch.score(), watch.losses(info)};
}

Done doneByScript(const haptics::SessionModel& model, const std::string& trainee = "")
{
    session::DeviceRequest request;
    request.trainee = trainee;
    return done(model, *session::openDevice(model, request, nullptr));
}

bool reachesLevel(const std::string& exercise, const haptics::Score& score)
{
    return meets(breastCourse().exercise(exercise)->gate, valuesOf(score));
}

std::string said(const std::vector<haptics::Loss>& losses)
{
    std::string all;
    for (const haptics::Loss& loss : losses) {
        all += inWords(loss) + "; ";
    }
    return all;
}

// As somebody at the window would do it who goes by the briefing: on the skin for three seconds, and off.
TEST(FirstTouch, RestedOnTheSkinIsAllPointsAndTheLevel)
{
    const haptics::SessionModel model = modelOfCase("first-touch");
    const Done rested = doneByScript(model);
    EXPECT_EQ(rested.score.total, 100) << said(rested.losses);
    EXPECT_TRUE(rested.losses.empty()) << said(rested.losses);
    EXPECT_TRUE(reachesLevel("touch", rested.score));
    EXPECT_EQ(rested.score.deepest, 0);
    EXPECT_GE(rested.score.rest, 3);
    EXPECT_EQ(rested.score.passes, 0U);
}

// The briefing asks for three seconds.
TEST(FirstTouch, AShortRestIsNotTheLevel)
{
    haptics::Score score = doneByScript(modelOfCase("first-touch")).score;
    ASSERT_TRUE(reachesLevel("touch", score));
    score.rest = 2.9;
    EXPECT_FALSE(reachesLevel("touch", score));
}

TEST(FirstTouch, PiercedIsNeither)
{
    haptics::SessionModel model = modelOfCase("first-touch");
    model.scene.task = datasets::SessionTask::biopsy;  // what the hand does; the record asks for a touch
    haptics::HandDevice hand = haptics::handBefore(model, 30e-3);
    const Done pierced = done(model, hand);
    EXPECT_GE(pierced.score.passes, 1U);
    EXPECT_LE(pierced.score.total, 25);
    EXPECT_FALSE(reachesLevel("touch", pierced.score));
    ASSERT_FALSE(pierced.losses.empty());
    EXPECT_EQ(pierced.losses[0].measure, "deepest_mm");
}

TEST(StraightIn, InTheLumpAndBackIsAllPointsAndTheLevel)
{
    const Done reached = doneByScript(modelOfCase("straight-in"));
    EXPECT_GT(reached.score.total, 99) << said(reached.losses);
    EXPECT_TRUE(reachesLevel("advance", reached.score)) << said(reached.losses);
    EXPECT_EQ(reached.score.tipToTarget, 0);
    EXPECT_EQ(reached.score.passes, 0U);
}

TEST(FirstTouch, AnExpertsHandReachesTheLevel)
{
    const Done rested = doneByScript(modelOfCase("first-touch"), "expert");
    EXPECT_GT(rested.score.total, 90) << said(rested.losses);
    EXPECT_TRUE(reachesLevel("touch", rested.score)) << said(rested.losses);
}

TEST(StraightIn, AnExpertsHandReachesTheLevelAndFiresNothing)
{
    const Done reached = doneByScript(modelOfCase("straight-in"), "expert");
    EXPECT_GT(reached.score.total, 90) << said(reached.losses);
    EXPECT_TRUE(reachesLevel("advance", reached.score)) << said(reached.losses);
    EXPECT_EQ(reached.score.passes, 0U);
}

// A ball is pressed into a block: its tool can take no core, so none is missing.
TEST(Pressing, LosesNothingForACore)
{
    session::SceneChanges changes;
    changes.setting = "fast";
    const Done pressed = doneByScript(session::openSession("block", changes));
    EXPECT_GT(pressed.score.skinContacts, 0U);
    for (const haptics::Loss& loss : pressed.losses) {
        EXPECT_EQ(loss.measure, "peak_force_n") << loss.words;
    }
}

}  // namespace
}  // namespace palpate::training
