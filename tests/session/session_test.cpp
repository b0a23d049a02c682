#include <session/session.h>

#include <session/devices.h>
#include <session/open.h>
#include <session/trainer.h>

#include <gtest/gtest.h>

#include <tests/allocations.h>
#include <tests/error_of.h>
#include <tests/folder.h>

#include <unistd.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

namespace palpate::session {
namespace {

class SessionTest : public testing::Test {
protected:
    static void SetUpTestSuite()
    {
        SceneChanges changes;
        changes.setting = "fast";
        model_ = new haptics::SessionModel(openSession("near-vessel", changes));
    }
    static void TearDownTestSuite() { delete model_; }

    static const haptics::SessionModel& model() { return *model_; }
    static haptics::SessionInfo info() { return describeSession(model(), "near-vessel", "hand"); }
    static std::unique_ptr<haptics::Device> hand() { return openDevice(model(), {}, nullptr); }

private:
    static inline haptics::SessionModel* model_ = nullptr;
};

TEST_F(SessionTest, AFalconThatNothingOpensIsRefused)
{
    DeviceRequest request;
    request.name = "falcon";
    EXPECT_THROW(openDevice(model(), request, nullptr), std::runtime_error);
}

TEST(Open, AnotherTargetIsNoVitalStructureAnyMore)
{
    SceneChanges changes;
    changes.model = "spring";
    changes.target = "artery";
    const haptics::SessionModel model = openSession("near-vessel", changes);
    EXPECT_EQ(model.scene.target, "artery");
    ASSERT_EQ(model.scene.vital.size(), 2U);
    EXPECT_EQ(model.scene.vital[0].name, "vein");
    EXPECT_EQ(reopenSession("r.db", describeSession(model, "near-vessel", "hand")).scene.vital.size(), 2U);
}

// A record and its volume on another machine, or in a folder with another name.
TEST(Open, ARecordsVolumeIsFoundBesideIt)
{
    const tests::Folder home;
    const std::filesystem::path here(home / "here"), there(home / "there");
    std::filesystem::create_directories(here);
    SceneChanges changes;
    changes.model = "spring";
    openSession("block", changes).tissue->save(here / "v.vdb");
    std::ofstream(here / "s.toml") << "name = \"own\"\n[volume]\nfile = \"v.vdb\"\n[model]\nlevel = \"spring\"\n"
                                      "[target]\nstructure = \"tumour\"\n";
    const auto info = describeSession(openSession(here / "s.toml", {}), here / "s.toml", "hand");
    std::filesystem::rename(here, there);
    EXPECT_EQ(reopenSession(there / "r.db", info).scene.source.file, there / "v.vdb");
    EXPECT_EQ(tests::errorOf([&] { reopenSession(home / "r.db", info); }),
              (home / "r.db").string() + ": its session reads " + (here / "v.vdb").string() +
                  ", which is not there: bring it back, or copy it beside the record");
    openSession("near-vessel", changes).tissue->save(there / "v.vdb");
    EXPECT_NE(tests::errorOf([&] { reopenSession(there / "r.db", info); }).find("has changed since it was recorded"),
              std::string::npos);
}

constexpr double length = 4.0;  // the scripted hand has punctured and fired by then [s]

// The poses of a device's session, handed in one by one, give the same session: each bit of each force, and all figures.
TEST_F(SessionTest, PosesHandedInAreTheDevicesSession)
{
    Session looped(model(), info());
    std::vector<haptics::DeviceSample> poses;
    const auto device = hand();
    const auto timing = looped.run(*device, {.servo = {.paced = false, .seconds = length}},
                                   [&](const haptics::TickRecord& r, const auto&) { poses.push_back(r.device); });
    ASSERT_EQ(timing.ticks, poses.size());
    ASSERT_EQ(poses.size(), 4000U);

    Session stepped(model(), info());
    haptics::ForceHash hash;
    for (const haptics::DeviceSample& pose : poses) {
        hash.add(stepped.tick(pose));
    }
    const SessionFigures a = looped.figures(), b = stepped.figures();
    EXPECT_EQ(a.forceHash, b.forceHash);
    EXPECT_EQ(a.forceHash, hash.value());
    EXPECT_GT(a.punctures, 0U);
    EXPECT_EQ(a.punctures, b.punctures);
    EXPECT_EQ(a.cores.size(), b.cores.size());
    EXPECT_EQ(a.nearest, b.nearest);
    EXPECT_EQ(a.peakTotal, b.peakTotal);
    EXPECT_EQ(a.energyMade, b.energyMade);
    EXPECT_EQ(a.score.total, b.score.total);
    EXPECT_EQ(a.score.pathLength, b.score.pathLength);
    EXPECT_FALSE(a.faulted);
}

TEST_F(SessionTest, EndsAfterTheTickInWhichItIsTold)
{
    Session session(model(), info());
    const auto device = hand();
    std::atomic<bool> stop{false};
    std::uint64_t last = 0;
    const auto timing =
        session.run(*device, {.servo = {.paced = false}, .stop = &stop}, [&](const haptics::TickRecord& r, const auto&) {
            last = r.tick;
            stop = r.tick == 41;
        });
    EXPECT_EQ(last, 41U);
    EXPECT_EQ(timing.ticks, 42U);
}

// A pose that is no number switches the force off; the figures say so.
TEST_F(SessionTest, FiguresTellOfAFault)
{
    Session session(model(), info());
    haptics::DeviceSample pose{.position = model().approach.entry, .buttons = haptics::buttonDeadMan};
    session.tick(pose);
    EXPECT_FALSE(session.figures().faulted);
    pose.position.x = std::bit_cast<double>(0x7ff8000000000000);
    EXPECT_EQ(session.tick(pose).total, Vec3(0.0));
    EXPECT_TRUE(session.figures().faulted);
}

static_assert(!std::is_move_constructible_v<Session> && !std::is_copy_constructible_v<Session>);
static_assert(!std::is_move_assignable_v<Session> && !std::is_copy_assignable_v<Session>);

TEST_F(SessionTest, ARateThatIsNoPositiveNumberIsRefused)
{
    haptics::SessionInfo bad = info();
    for (const double rate : {0.0, -1000.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
        bad.rate = rate;
        EXPECT_THROW(Session(model(), bad), std::runtime_error) << rate;
    }
}

// A session whose ticks come slowly, so that there is time beside it.
TrainOptions slowly(const std::string& name)
{
    TrainOptions options;
    options.session = name + std::to_string(getpid());
    options.servo.paced = false;
    for (int i = 1; i < 500; ++i) {
        options.faults.push_back({FaultKind::gap, 0, 20e-3, 20e-3 * i});
    }
    return options;
}

// Its own lookAfter, and no other's, ends a session.
TEST_F(SessionTest, TwoTrainersEndEachByItself)
{
    TrainOptions first = slowly("first"), second = slowly("second");
    std::atomic<bool> hasEnded{false};
    first.lookAfter = [] { return false; };
    int since = 0;
    second.lookAfter = [&] { return !hasEnded || ++since < 3; };
    Trainer one(model(), info(), first), other(model(), info(), second);
    std::thread beside([&] {
        one.run();
        hasEnded = true;
    });
    const TrainResult result = other.run();
    beside.join();
    EXPECT_GE(since, 3);
    EXPECT_EQ(result.signal, 0);
    EXPECT_EQ(result.problem, "");
    EXPECT_THROW(other.run(), std::runtime_error) << "a second time, without its record";
}

TEST_F(SessionTest, ATrainerRefusesWhatItCannotDo)
{
    TrainOptions options = slowly("refused");
    haptics::SessionInfo slower = info();
    slower.rate = 500;
    EXPECT_THROW(Trainer(model(), slower, options), std::runtime_error);
    options.faults = parseFaults("stall-viewer=100ms@0.2s");
    EXPECT_THROW(Trainer(model(), info(), options), std::runtime_error);
    options.stallViewers = [](bool) {};
    EXPECT_NO_THROW(Trainer(model(), info(), options));
}

TEST_F(SessionTest, ATickAllocatesNothing)
{
    Session session(model(), info());
    const Vec3 way = glm::normalize(model().approach.aim - model().approach.entry);
    haptics::DeviceSample pose{.axis = way, .buttons = haptics::buttonDeadMan | haptics::buttonFire};
    EXPECT_EQ(tests::heapCallsIn([&] {
                  for (int i = 0; i < 400; ++i) {
                      pose.position = model().approach.entry + (0.1e-3 * i - 10e-3) * way;
                      session.tick(pose);
                  }
              }),
              0U);
    EXPECT_GT(session.figures().peakBasic, 0.0);
}

}  // namespace
}  // namespace palpate::session
