#include <channel/bounds.h>
#include <channel/channel.h>
#include <channel/segment.h>

#include <tests/channel/example.h>
#include <tests/fuzz_count.h>

#include <gtest/gtest.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>

namespace palpate::channel {
namespace {

void cut(const std::string& session, off_t bytes)
{
    const int file = ::shm_open(segmentName(session).c_str(), O_RDWR, 0);
    ASSERT_GE(file, 0);
    EXPECT_EQ(::ftruncate(file, bytes), 0);
    ::close(file);
}

// Without the guard each of these is a SIGBUS.
TEST(Torn, BothEndsOutliveASegmentThatIsCutOff)
{
    for (const off_t keep : {off_t{0}, off_t{100}, off_t{4096}, off_t{20000}}) {
        const std::string session = sessionNamed("torn");
        Publisher publisher(session, smallScenery(), smallLabels());
        publisher.setState(stateOf(5));
        auto subscriber = Subscriber::attach(session);
        ASSERT_TRUE(subscriber);
        ASSERT_TRUE(subscriber->state());
        EXPECT_FALSE(publisher.torn());
        cut(session, keep);
        EXPECT_EQ(subscriber->ending(), Ending::torn) << keep;
        const auto displaced = std::make_unique<Displaced>();
        for (std::uint64_t tick = 6; tick < 9; ++tick) {
            publisher.setState(stateOf(tick));
            fillDisplaced(publisher.backBuffer(), tick);
            publisher.publishDisplaced();
            subscriber->state();
            subscriber->displaced(*displaced);
            subscriber->input();
        }
        EXPECT_TRUE(publisher.torn());
        EXPECT_EQ(subscriber->scenery().tissues, 2U) << "what was checked is a copy";
        for (const std::uint8_t label : subscriber->labels())
            EXPECT_LE(label, 1);
        EXPECT_EQ(subscriber->ending(), Ending::torn);
    }
    EXPECT_FALSE(Subscriber::attach(sessionNamed("torn"))) << "the next one may have the name";
}

TEST(Torn, AHandOutlivesItsPage)
{
    const std::string session = sessionNamed("torn-hand");
    Scenery scenery = smallScenery();
    scenery.viewersHand = 1;
    Publisher publisher(session, scenery, smallLabels());
    const auto subscriber = Subscriber::attach(session);
    auto hand = ViewersHand::take(*subscriber);
    ASSERT_TRUE(hand);
    cut(session, 0);
    hand->set({});
    publisher.input();
}

// What is not about a segment still ends the process.
TEST(Torn, AnyOtherBusErrorEndsTheProcess)
{
    const pid_t child = ::fork();
    if (child == 0) {
        Publisher publisher(sessionNamed("torn-other"), smallScenery(), smallLabels());
        ::prctl(PR_SET_DUMPABLE, 0);
        const int file = ::memfd_create("empty", 0);
        auto* nothing = static_cast<volatile char*>(::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0));
        *nothing = 1;
        ::_exit(0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    // A sanitizer reports the error, and ends the process with a status of its own.
    EXPECT_FALSE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    EXPECT_TRUE(!WIFSIGNALED(status) || WTERMSIG(status) == SIGBUS || WTERMSIG(status) == SIGABRT) << WTERMSIG(status);
    ::shm_unlink(segmentName("test-" + std::to_string(child) + "-torn-other").c_str());
}

TEST(Bounds, AStateThatIsNoneIsNotShown)
{
    const std::string session = sessionNamed("none");
    Publisher publisher(session, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<void (*)(State&)> faults{
        [](State& s) { s.tip[1] = nan; },
        [](State& s) { s.axis[0] = std::numeric_limits<double>::infinity(); },
        [](State& s) { s.total[2] = -1e300; },
        [](State& s) { s.phase = static_cast<Phase>(7); },
        [](State& s) { s.warning = static_cast<Warning>(9); },
        [](State& s) { s.warned = 1; },
        [](State& s) { s.tissue = 64; },
        [](State& s) { s.tissue = 2; },  // the scenery has two
        [](State& s) { s.stoppedBy = 2; },
        [](State& s) { s.aheadTissue = 0xFFFFFFFF; },
        [](State& s) { s.distance[3] = nan; },
        [](State& s) { s.probe.face[0] = nan; },
        [](State& s) {
            s.probe.axial = {0, 0, 0};
        },
        [](State& s) { s.probe.lateral = s.probe.axial; },
        [](State& s) { s.probe.force = 1e9; },
        [](State& s) { s.holes = maxHoles + 1; },
        [](State& s) { s.hole[2].to[1] = std::numeric_limits<float>::infinity(); },
        [](State& s) { s.mark[1].place[0] = std::numeric_limits<float>::infinity(); }};
    for (const auto& fault : faults) {
        State state = stateOf(4);
        publisher.setState(state);
        EXPECT_TRUE(subscriber->state());
        fault(state);
        publisher.setState(state);
        EXPECT_FALSE(subscriber->state());
    }
}

TEST(Bounds, ATaskThatIsNoneIsNoScenery)
{
    Scenery scenery = smallScenery();
    scenery.task = Task::advance;
    EXPECT_TRUE(sound(scenery));
    scenery.task = static_cast<Task>(4);
    EXPECT_FALSE(sound(scenery));
}

TEST(Bounds, AnUltrasoundThatIsNoneIsNoScenery)
{
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    const std::vector<void (*)(Scenery&)> faults{[](Scenery& s) { s.fine.spacing = 0; },
                                                 [](Scenery& s) { s.fine.size[1] = -4; },
                                                 [](Scenery& s) { s.fine.size[2] = 1 << 20; },
                                                 [](Scenery& s) { s.sound[63].soundSpeed = nan; },
                                                 [](Scenery& s) { s.sound[1].attenuation = -1; },
                                                 [](Scenery& s) { s.sound[1].echo = 1e30F; },
                                                 [](Scenery& s) { s.sound[0].pattern = 4; },
                                                 [](Scenery& s) { s.probe = static_cast<ProbeKind>(3); },
                                                 [](Scenery& s) { s.probeFrequency = -5e6; },
                                                 [](Scenery& s) { s.holeRadius = std::nan(""); },
                                                 [](Scenery& s) { s.who.fill('a'); }};
    const std::vector<std::uint8_t> fine(finelyLabelled().size());
    for (const auto& fault : faults) {
        Scenery scenery = fineScenery();
        EXPECT_TRUE(sound(scenery));
        fault(scenery);
        EXPECT_FALSE(sound(scenery));
        EXPECT_THROW(Publisher(sessionNamed("unsound"), scenery, smallLabels(), {}, fine), std::runtime_error);
    }
}

// Its place and its length in the header are whatever somebody has written there.
TEST(Bounds, FineLabelsLieInsideTheSegment)
{
    const std::string session = sessionNamed("fine");
    Publisher publisher(session, fineScenery(), smallLabels(), {}, finelyLabelled());
    const auto viewer = Subscriber::attach(session);
    ASSERT_TRUE(viewer);
    const auto given = viewer->fine();
    EXPECT_EQ(std::vector<std::uint8_t>(given.begin(), given.end()), finelyLabelled());
    RawSegment raw(segmentName(session));
    auto& header = raw.at<Header>(0);
    const std::uint64_t offset = header.fineOffset, bytes = header.fineBytes;
    for (const auto& [at, length] : {std::pair{raw.bytes(), bytes},
                                     {raw.bytes() - bytes + 8, bytes},
                                     {~7ULL, bytes},
                                     {offset, bytes + 1},
                                     {offset, bytes - 1},
                                     {offset, ~0ULL},
                                     {offset, 0ULL}}) {
        header.fineOffset = at;
        header.fineBytes = length;
        EXPECT_THROW(Subscriber::attach(session), std::runtime_error) << at << ' ' << length;
        EXPECT_EQ(viewer->fine().data(), given.data()) << "what was checked is a copy";
        EXPECT_EQ(viewer->fine().size(), bytes);
    }
}

TEST(Bounds, NodesThatTheLatticeDoesNotHaveAreRefused)
{
    const std::string session = sessionNamed("nodes");
    Publisher publisher(session, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    const auto displaced = std::make_unique<Displaced>();
    const auto publish = [&](const Displacement& d) {
        publisher.backBuffer().count = 1;
        publisher.backBuffer().nodes[0] = d;
        publisher.publishDisplaced();
        return subscriber->displaced(*displaced);
    };
    EXPECT_TRUE(publish({999, {0, 0, 0}}));
    EXPECT_FALSE(publish({1000, {0, 0, 0}}));
    EXPECT_FALSE(publish({0, {std::numeric_limits<float>::quiet_NaN(), 0, 0}}));
    EXPECT_FALSE(publish({0, {0, 1e30F, 0}}));
}

// One to six words of the segment at random, values that are likely to hurt; a third of them in the header, a third there
// and in the scenery.
void mutate(RawSegment& raw, std::size_t bytes, std::mt19937_64& random)
{
    static const std::uint64_t nasty[]{0,
                                       1,
                                       ~0ULL,
                                       1ULL << 31U,
                                       1ULL << 32U,
                                       1ULL << 63U,
                                       0x7FF8000000000000,
                                       0x7FF0000000000000,
                                       0x7FEFFFFFFFFFFFFF,
                                       0x7FFFFFFF7FFFFFFF,
                                       0x0000FFFF0000FFFF,
                                       4096};
    for (auto n = 1 + random() % 6; n > 0; --n) {
        const std::size_t reaches[]{sizeof(Header), 4096 + sizeof(Scenery), bytes};
        const std::size_t reach = reaches[random() % 3];
        auto& word = raw.at<std::uint64_t>(random() % (std::min(reach, bytes) / 8) * 8);
        switch (random() % 3) {
            case 0:
                word = nasty[random() % std::size(nasty)];
                break;
            case 1:
                word ^= 1ULL << (random() % 64);
                break;
            default:
                word = random();
        }
    }
}

// What a viewer gets from any segment is what it can show; a segment that is none is an error on one line.
TEST(Bounds, ViewersTakeOnlyWhatTheyCanShow)
{
    const std::string session = sessionNamed("fuzz");
    const int count = tests::fuzzCount(400);
    const auto displaced = std::make_unique<Displaced>();
    int shown = 0, refused = 0;
    Publisher publisher(session, fineScenery(), smallLabels(), {}, finelyLabelled());
    publisher.setState(stateOf(3));
    fillDisplaced(publisher.backBuffer(), 3);
    publisher.publishDisplaced();
    RawSegment raw(segmentName(session));
    const std::size_t bytes = raw.bytes();
    const std::vector<std::byte> original(&raw.at<std::byte>(0), &raw.at<std::byte>(0) + bytes);
    for (int i = 0; i < count; ++i) {
        std::mt19937_64 random(static_cast<std::uint64_t>(i));
        std::memcpy(&raw.at<std::byte>(0), original.data(), bytes);
        // Half of them after the viewer has come.
        const bool later = i % 2 == 0;
        try {
            auto early = later ? Subscriber::attach(session) : std::nullopt;
            mutate(raw, bytes, random);
            const auto viewer = later ? std::move(early) : Subscriber::attach(session);
            if (!viewer) {
                ++refused;
                continue;
            }
            const Scenery& s = viewer->scenery();
            ASSERT_TRUE(sound(s)) << i;
            ASSERT_EQ(viewer->labels().size(), voxelsOf(s.labels));
            std::size_t sum = viewer->image().size();
            for (const std::uint8_t label : viewer->labels())
                sum += label;
            ASSERT_EQ(viewer->fine().size(), voxelsOf(s.fine));
            for (const std::uint8_t label : viewer->fine())
                sum += label;
            if (const auto state = viewer->state()) {
                ASSERT_TRUE(sound(*state, s)) << i;
                ++shown;
            }
            displaced->publication = 0;
            if (viewer->displaced(*displaced)) {
                ASSERT_LE(displaced->count, maxDisplaced);
                for (std::uint32_t k = 0; k < displaced->count; ++k)
                    ASSERT_TRUE(sound(displaced->nodes[k], voxelsOf(s.lattice))) << i;
            }
            viewer->input();
            viewer->ending();
            EXPECT_LT(sum, std::size_t{1} << 20U);
        } catch (const std::runtime_error& e) {
            EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
            ++refused;
        }
    }
    std::memcpy(&raw.at<std::byte>(0), original.data(), bytes);
    EXPECT_GT(shown, count / 10);
    EXPECT_GT(refused, count / 10);
}

}  // namespace
}  // namespace palpate::channel
