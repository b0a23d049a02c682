#include <render/coach.h>
#include <render/concealment.h>
#include <render/deformation.h>
#include <render/events.h>
#include <tests/error_of.h>
#include <tests/render/body.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace palpate::render {
namespace {

constexpr double none = std::numeric_limits<double>::infinity();

// A needle that goes to the back (+y), 20 mm to a tumour's middle.
channel::Scenery needleScenery()
{
    channel::Scenery s;
    s.structures = 2;
    s.structure[0] = named("tumour");
    s.structure[1] = named("vein");
    s.entry = {0, 0, 0};
    s.aim = {0, 20e-3, 0};
    s.throwLength = 15e-3;
    return s;
}

channel::State stateAt(double x, double y, double z, channel::Phase phase)
{
    channel::State s;
    s.tip = {x, y, z};
    s.axis = {0, 1, 0};
    s.phase = phase;
    s.distance.fill(1);
    s.ahead.fill(none);
    return s;
}

const CoachView view{.aim = {0, 20e-3, 0}, .handIsHere = true};

// A needle that was turned out of the picture by the wheel looks like one that is gone.
TEST(Coach, NamesTheKeysThatBringAToolBackIntoThePicture)
{
    const channel::Scenery scenery = needleScenery();
    CoachView lost = view;
    lost.outOfSight = true;
    const auto wrongAt = [&](double x, double y) {
        return coach(scenery, stateAt(x, y, 0, channel::Phase::free), lost).wrong;
    };
    EXPECT_NE(wrongAt(0, -0.3).find("the wheel forward, or Page down"), std::string::npos) << wrongAt(0, -0.3);
    EXPECT_NE(wrongAt(0, 0.3).find("Page up"), std::string::npos) << wrongAt(0, 0.3);
    EXPECT_NE(wrongAt(0.3, -0.03).find("arrow keys"), std::string::npos) << wrongAt(0.3, -0.03);
    EXPECT_EQ(coach(scenery, stateAt(0, -0.3, 0, channel::Phase::free), view).wrong, "");
    lost.handIsHere = false;
    EXPECT_EQ(wrongAt(0, -0.3), "") << "who looks on has no keys for it";
}

TEST(Coach, LeadsThroughABiopsyStepByStep)
{
    const channel::Scenery scenery = needleScenery();
    channel::State s = stateAt(0, -0.03, 0, channel::Phase::free);
    EXPECT_EQ(coach(scenery, s, view).step, 1);
    s.phase = channel::Phase::contact;
    EXPECT_EQ(coach(scenery, s, view).step, 2);
    s = stateAt(0, 5e-3, 0, channel::Phase::inserted);
    s.distance[0] = s.ahead[0] = 10e-3;
    EXPECT_EQ(coach(scenery, s, view).step, 3);
    EXPECT_NE(coach(scenery, s, view).now.find("tumour's rim (10 mm to go)"), std::string::npos);
    EXPECT_EQ(coach(scenery, s, view).wrong, "");
    s.distance[0] = s.ahead[0] = 1e-3;
    EXPECT_EQ(coach(scenery, s, view).now, "Fire the gun (Space, or the other mouse button)");
    CoachView onPicture = view;
    onPicture.scanned = true;  // where the other button moves the probe
    EXPECT_EQ(coach(scenery, s, onPicture).now, "Fire the gun (Space)");
    s.cores = s.bestCore = 1;
    s.coreTarget = s.bestTarget = 0.6;
    EXPECT_NE(coach(scenery, s, view).now.find("60 % tumour: draw the needle out"), std::string::npos);
    s.phase = channel::Phase::free;
    EXPECT_NE(coach(scenery, s, view).now.find("end the session (E, or click here)"), std::string::npos);
}

TEST(Coach, SaysHowFarOffAndTowardsWhat)
{
    const channel::Scenery scenery = needleScenery();
    channel::State s = stateAt(0, -0.01, -12e-3, channel::Phase::free);
    EXPECT_EQ(coach(scenery, s, view).wrong, "The tip is 12 mm off the line, towards the feet");
    s = stateAt(9e-3, 5e-3, 0, channel::Phase::inserted);
    s.distance[0] = 12e-3;
    EXPECT_EQ(coach(scenery, s, view).wrong,
              "The needle passes the tumour: its middle lies 9 mm towards the patient's right");
    // Nothing is seen along the line beyond 40 mm: a target of 10 mm, 60 mm ahead, is not missed by 3 mm, and is by 12 mm.
    const CoachView deep{.aim = {0, 70e-3, 0}, .handIsHere = true};
    s = stateAt(3e-3, 10e-3, 0, channel::Phase::inserted);
    s.distance[0] = 55e-3;
    EXPECT_EQ(coach(scenery, s, deep).wrong, "");
    s.tip[0] = 12e-3;
    s.distance[0] = 56.2e-3;
    EXPECT_EQ(coach(scenery, s, deep).wrong,
              "The needle passes the tumour: its middle lies 12 mm towards the patient's right");
    s = stateAt(0, 40e-3, 0, channel::Phase::inserted);
    s.distance[0] = 15e-3;
    EXPECT_EQ(coach(scenery, s, view).wrong, "The tip is beyond the tumour: draw back");
}

TEST(Coach, WarnsOfWhatTheThrowWouldReach)
{
    channel::State s = stateAt(0, 15e-3, 0, channel::Phase::inserted);
    s.distance[0] = s.ahead[0] = 1e-3;
    s.ahead[1] = 13e-3;
    EXPECT_EQ(coach(needleScenery(), s, view).wrong, "Do not fire: the 15 mm of the throw would reach vein");
    s.ahead[1] = 16e-3;
    EXPECT_EQ(coach(needleScenery(), s, view).wrong, "");
}

TEST(Coach, SaysTissuesAsPeopleDo)
{
    channel::Scenery scenery = needleScenery();
    scenery.structure[0] = named("idc_high_grade");
    scenery.structure[1] = named("chest_wall");
    channel::State s = stateAt(0, 15e-3, 0, channel::Phase::inserted);
    s.distance[0] = s.ahead[0] = 1e-3;
    s.ahead[1] = 5e-3;
    EXPECT_EQ(coach(scenery, s, view).wrong, "Do not fire: the 15 mm of the throw would reach chest wall");
    s.distance[0] = s.ahead[0] = 10e-3;
    EXPECT_NE(coach(scenery, s, view).now.find("high-grade carcinoma"), std::string::npos);
}

TEST(Coach, AMissBeginsAnew)
{
    channel::State s = stateAt(0, 5e-3, 0, channel::Phase::inserted);
    s.distance[0] = s.ahead[0] = 10e-3;
    s.cores = 1;
    const Coaching c = coach(needleScenery(), s, view);
    EXPECT_EQ(c.step, 3);
    EXPECT_EQ(c.wrong, "Core 1 holds 0 % tumour: take another");
}

// Briefings ask for half, and the score has all points for it: what is shown as less is not enough.
TEST(Coach, OneCoreWithHalfOfItTargetEndsABiopsy)
{
    channel::State s = stateAt(0, 15e-3, 0, channel::Phase::inserted);
    s.distance[0] = s.ahead[0] = 1e-3;
    s.cores = s.bestCore = 1;
    for (const auto& [target, told] : {std::pair{0.1, "10"}, {0.33, "33"}, {0.494, "49"}}) {
        s.coreTarget = s.bestTarget = target;
        const Coaching c = coach(needleScenery(), s, view);
        EXPECT_EQ(c.step, 4);
        EXPECT_EQ(c.wrong, std::string("Core 1 holds ") + told + " % tumour: take another");
    }
    for (const double target : {0.496, 0.5, 1.0}) {
        s.coreTarget = s.bestTarget = target;
        EXPECT_EQ(coach(needleScenery(), s, view).step, 5) << target;
    }
}

// The score takes the best core: a later shot beside it, or into the hole of the first, sends nobody back.
TEST(Coach, ALaterMissTakesNoStepBack)
{
    channel::State s = stateAt(0, 15e-3, 0, channel::Phase::inserted);
    s.distance[0] = 6e-3;
    s.cores = 10;
    s.bestCore = 1;
    s.bestTarget = 0.57;
    const Coaching c = coach(needleScenery(), s, view);
    EXPECT_EQ(c.step, 5);
    EXPECT_EQ(c.now, "Core 1 holds 57 % tumour: draw the needle out");
    EXPECT_EQ(c.wrong, "");
}

// What cores have taken is on the line no more: a line through the target's middle, or 3 mm beside that of a target of
// 10 mm, passes no target for that, and one 9 mm beside does.
TEST(Coach, ATargetThatWasTakenIsNotPassed)
{
    for (const auto& [aside, told] :
         {std::pair{0.0, ""},
          {0.4e-3, ""},
          {3e-3, ""},
          {9e-3, "The needle passes the tumour: its middle lies 9 mm towards the patient's right"}}) {
        channel::State s = stateAt(aside, 5e-3, 0, channel::Phase::inserted);
        s.distance[0] = std::hypot(15e-3, aside) - 5e-3;
        s.cores = 1;
        s.coreTarget = s.bestTarget = 0.05;
        const std::string wrong = coach(needleScenery(), s, view).wrong;
        EXPECT_EQ(wrong, *told != 0 ? told : "Core 1 holds 5 % tumour: take another") << aside;
    }
}

TEST(Coach, SaysForTwoSecondsThatTheGunFiresOnlyInside)
{
    channel::State s = stateAt(0, -0.01, -12e-3, channel::Phase::free);
    s.time = s.refused = 0.5;
    EXPECT_EQ(coach(needleScenery(), s, view).wrong, "The gun fires only inside the body");
    s.time = 2.49;
    EXPECT_EQ(coach(needleScenery(), s, view).wrong, "The gun fires only inside the body");
    s.time = 2.51;
    EXPECT_EQ(coach(needleScenery(), s, view).wrong, "The tip is 12 mm off the line, towards the feet");
    s.time = 0.6;
    s.phase = channel::Phase::inserted;
    EXPECT_NE(coach(needleScenery(), s, view).wrong, "The gun fires only inside the body");
}

// At bone the gun does not fire, and a throw that bone has stopped is told for four seconds; inside the body both.
TEST(Coach, SaysWhatBoneDidToAShot)
{
    channel::Scenery scenery = needleScenery();
    scenery.tissue[3].name = named("rib");
    channel::State s = stateAt(0, 5e-3, 0, channel::Phase::inserted);
    s.time = s.refused = 0.5;
    s.refusedBy = 3;
    EXPECT_EQ(coach(scenery, s, view).wrong, "The gun does not fire against rib: draw back and turn");
    s.time = 2.6;
    EXPECT_EQ(coach(scenery, s, view).wrong.find("rib"), std::string::npos);
    s.stopped = s.time;
    s.stoppedBy = 3;
    s.thrown = 3.2e-3;
    s.time = 6.5;
    EXPECT_EQ(coach(scenery, s, view).wrong, "The throw was stopped by rib after 3.2 mm");
    s.time = 6.7;
    EXPECT_EQ(coach(scenery, s, view).wrong.find("rib"), std::string::npos);
    std::vector<std::string> said;
    channel::State now = s;
    now.stopped = now.refused = now.time;
    for (const Event& event : eventsBetween(s, now))
        said.push_back(words(event, scenery));
    EXPECT_EQ(said, (std::vector<std::string>{"throw stopped by rib after 3.2 mm", "fired against rib"}));
}

TEST(Coach, APalpationAsksForTwoMarksAndSaysNothingOfTheLump)
{
    channel::Scenery scenery = needleScenery();
    scenery.tool = channel::ToolKind::capsule;
    CoachView hidden = view;
    hidden.targetHidden = true;
    hidden.planned = false;
    channel::State s = stateAt(30e-3, 0, 0, channel::Phase::contact);
    for (std::uint32_t marks : {0U, 1U, 2U}) {
        s.marks = marks;
        const Coaching c = coach(scenery, s, hidden);
        EXPECT_EQ(c.step, marks < 2 ? 2 : 3);
        EXPECT_EQ(c.wrong, "");
        EXPECT_EQ(c.now.find("tumour"), std::string::npos);
    }
}

TEST(Coach, ATouchIsRestedAndLiftedOffAndNeverPushedThrough)
{
    channel::Scenery scenery = needleScenery();
    scenery.task = channel::Task::touch;
    channel::State s = stateAt(0, -0.01, 0, channel::Phase::free);
    EXPECT_EQ(coach(scenery, s, view).now, "Touch the skin at the mark, where the planned line begins");
    EXPECT_EQ(coach(scenery, s, view).steps, 3);
    s.phase = channel::Phase::contact;
    s.rested = 600;
    EXPECT_EQ(coach(scenery, s, view).step, 2);
    EXPECT_EQ(coach(scenery, s, view).now, "Rest here, 3 s more: the skin gives way a little, and is not to be pierced");
    EXPECT_EQ(coach(scenery, s, view).wrong, "");
    s.total = {0, -2.5, 0};
    EXPECT_EQ(coach(scenery, s, view).wrong, "You push with 2.5 N: let the tool rest");
    s.total = {};
    s.rested = 3000;
    EXPECT_EQ(coach(scenery, s, view).now, "Lift off");
    EXPECT_FALSE(coach(scenery, s, view).last);
    s.phase = channel::Phase::free;
    EXPECT_EQ(coach(scenery, s, view).now, "Done: end the session (E, or click here)");
    EXPECT_TRUE(coach(scenery, s, view).last);
    s.phase = channel::Phase::inserted;
    EXPECT_EQ(coach(scenery, s, view).wrong, "The skin is pierced: it was only to be touched");
}

TEST(Coach, AnAdvanceStopsInTheTargetAndFiresNothing)
{
    channel::Scenery scenery = needleScenery();
    scenery.task = channel::Task::advance;
    channel::State s = stateAt(0, -0.01, 0, channel::Phase::contact);
    EXPECT_EQ(coach(scenery, s, view).now, "Push along the needle until the skin gives way");
    EXPECT_EQ(coach(scenery, s, view).steps, 4);
    s.phase = channel::Phase::inserted;
    s.distance[0] = s.ahead[0] = 1e-3;
    EXPECT_EQ(coach(scenery, s, view).now, "Advance until the tip is in the tumour (1 mm to go)");
    s.distance[0] = 6.3e-3;
    s.ahead[0] = 5e-3;  // of another surface of the target
    EXPECT_EQ(coach(scenery, s, view).now, "Advance until the tip is in the tumour (6 mm to go)");
    s.distance[0] = -1e-3;
    s.reached = 1;
    EXPECT_EQ(coach(scenery, s, view).now, "The tip is in the tumour: stop there, and draw the needle back");
    s.phase = channel::Phase::free;
    EXPECT_EQ(coach(scenery, s, view).step, 4);
    EXPECT_EQ(coach(scenery, s, view).now, "Done: end the session (E, or click here)");
}

// A ball of tissue 2 in tissue 1 in air: after it there is as much tissue 1 as there was of both, and not one voxel else
// changes.
TEST(Concealment, TheHiddenTissueBecomesWhatLiesAroundIt)
{
    channel::Scenery scenery = needleScenery();
    scenery.tissues = 3;
    scenery.tissue[1].name = named("fat");
    scenery.tissue[2].name = named("idc_high_grade");
    channel::Grid grid{{15, 15, 15}, 0, {0, 0, 0}, 1e-3};
    std::vector<std::uint8_t> labels;
    for (int z = 0; z < 15; ++z)
        for (int y = 0; y < 15; ++y)
            for (int x = 0; x < 15; ++x) {
                const double r = std::hypot(x - 7, y - 7, z - 7);
                labels.push_back(r < 4 ? 2 : r < 6.5 ? 1 : 0);
            }
    const auto before = labels;
    const Concealment what{false, {"idc_high_grade"}};
    conceal(what, scenery, grid, labels);
    for (std::size_t i = 0; i < labels.size(); ++i)
        ASSERT_EQ(labels[i], before[i] == 0 ? 0 : 1) << i;
    channel::State s = stateAt(0, 0, 0, channel::Phase::contact);
    s.distance[0] = 3e-3;
    s.aheadTissue = 2;
    conceal(what, s);
    conceal(what, scenery);
    EXPECT_TRUE(std::isinf(s.distance[0]));
    EXPECT_EQ(s.aheadTissue, 0U);
    EXPECT_EQ(scenery.entry, scenery.aim);
}

// A tissue that is misspelt would be shown. Names of over 31 bytes are cut off in a scenery.
TEST(Concealment, ATissueThatIsNotThereIsRefused)
{
    channel::Scenery scenery = needleScenery();
    scenery.tissues = 4;
    scenery.tissue[1].name = named("fat");
    scenery.tissue[2].name = named("a_lump_whose_name_is_so_long_in");
    scenery.tissue[3].name = named("liver");
    const std::vector<std::uint8_t> labels{0, 1, 1, 2};
    for (const std::string wrong : {"nosuch", "fat,liver", "a_lump_whose_name_is_so_long_i"})
        EXPECT_EQ(tests::errorOf([&] {
                      checkTissues({false, {"fat", wrong}}, scenery, labels);
                  }),
                  "--hide " + wrong + ": there is no such tissue; the body has: fat, a_lump_whose_name_is_so_long_in");
    EXPECT_NO_THROW(checkTissues({false, {"liver", "a lump whose name is so long indeed"}}, scenery, labels));
}

TEST(Concealment, NothingHiddenChangesNothing)
{
    channel::State s = stateAt(0, 0, 0, channel::Phase::contact);
    const channel::State before = s;
    conceal({}, s);
    EXPECT_EQ(std::memcmp(&s, &before, sizeof s), 0);
}

}  // namespace
}  // namespace palpate::render
