#include <channel/channel.h>
#include <channel/segment.h>
#include <tests/allocations.h>
#include <tests/channel/example.h>

#include <gtest/gtest.h>

#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

namespace palpate::channel {
namespace {

TEST(Exchange, ALateViewerGetsSceneryLabelsAndTheLastState)
{
    const std::string session = sessionNamed("late");
    const auto labels = smallLabels();
    Publisher publisher(session, smallScenery(), labels);
    fillDisplaced(publisher.backBuffer(), 40);
    publisher.publishDisplaced();
    for (std::uint64_t tick = 1; tick <= 50; ++tick)
        publisher.setState(stateOf(tick));

    const auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    EXPECT_STREQ(subscriber->scenery().scene.data(), "cube");
    EXPECT_EQ(subscriber->scenery().labels.size, smallScenery().labels.size);
    EXPECT_EQ(std::vector<std::uint8_t>(subscriber->labels().begin(), subscriber->labels().end()), labels);
    EXPECT_EQ(subscriber->state()->tick, 50U);
    const auto displaced = std::make_unique<Displaced>();
    EXPECT_TRUE(subscriber->displaced(*displaced));
    EXPECT_EQ(displaced->tick, 40U);
    EXPECT_TRUE(whole(*displaced));
    EXPECT_FALSE(subscriber->displaced(*displaced)) << "nothing newer";
}

TEST(Exchange, OnlyItsUserMayReadASegmentWhateverTheUmask)
{
    for (const mode_t mask : {0777U, 0022U, 0U}) {
        const std::string session = sessionNamed("umask");
        const mode_t before = ::umask(mask);
        const Publisher publisher(session, smallScenery(), smallLabels());
        ::umask(before);
        struct stat status {};
        ASSERT_EQ(::stat((std::string(segmentFolder) + segmentName(session)).c_str(), &status), 0);
        EXPECT_EQ(status.st_mode & 0777U, 0600U) << mask;
    }
}

TEST(Exchange, NothingIsThereBeforeTheFirstTick)
{
    const std::string session = sessionNamed("first");
    const Publisher publisher(session, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    EXPECT_FALSE(subscriber->state().has_value());
    EXPECT_FALSE(subscriber->displaced(*std::make_unique<Displaced>()));
    EXPECT_TRUE(subscriber->alive());
}

TEST(Exchange, AnUnfinishedWriteGivesNothingInsteadOfHanging)
{
    const std::string session = sessionNamed("unfinished");
    Publisher publisher(session, smallScenery(), smallLabels());
    publisher.setState(stateOf(3));
    fillDisplaced(publisher.backBuffer(), 3);
    publisher.publishDisplaced();
    const auto subscriber = Subscriber::attach(session);
    ASSERT_TRUE(subscriber);
    RawSegment raw(segmentName(session));
    const Header& header = raw.at<Header>(0);
    raw.at<StateBlock>(header.stateOffset).sequence += 1;
    raw.at<DisplacedBlock>(header.displacedOffset).slot[1].sequence += 1;
    EXPECT_FALSE(subscriber->state().has_value());
    EXPECT_FALSE(subscriber->displaced(*std::make_unique<Displaced>()));
}

TEST(Exchange, MoreNodesThanFitAreCutOff)
{
    const std::string session = sessionNamed("many");
    Publisher publisher(session, smallScenery(), smallLabels());
    publisher.backBuffer().tick = 1;
    publisher.backBuffer().count = maxDisplaced + 1;
    publisher.publishDisplaced();
    const auto displaced = std::make_unique<Displaced>();
    ASSERT_TRUE(Subscriber::attach(session)->displaced(*displaced));
    EXPECT_EQ(displaced->count, maxDisplaced);
}

TEST(Exchange, PublishingAllocatesNothing)
{
    const std::string session = sessionNamed("heap");
    Publisher publisher(session, smallScenery(), smallLabels());
    const State state;
    const auto before = tests::allocations();
    for (std::uint64_t tick = 1; tick <= 1000; ++tick) {
        publisher.setState(state);
        fillDisplaced(publisher.backBuffer(), tick);
        publisher.publishDisplaced();
    }
    EXPECT_EQ(tests::allocations(), before);
    ::operator delete(::operator new(1));
    EXPECT_GT(tests::allocations(), before) << "the counter counts";
}

TEST(Exchange, TheTimeOfPublishingIsFilledIn)
{
    const std::string session = sessionNamed("time");
    Publisher publisher(session, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    State state;
    publisher.setState(state);
    const std::uint64_t first = subscriber->state()->published;
    publisher.setState(state);
    EXPECT_GT(first, 0U);
    EXPECT_GE(subscriber->state()->published, first);
    state.published = 17;
    publisher.setState(state);
    EXPECT_EQ(subscriber->state()->published, 17U);
}

struct Seen {
    std::uint64_t states = 0, displaced = 0, torn = 0, backwards = 0;
};

// Reads until both have been seen `enough` times, and checks every copy against its closed form. Five minutes are for a
// busy machine: with other work beside it took over one.
Seen readMany(const std::string& session, std::uint64_t enough)
{
    const auto subscriber = Subscriber::attach(session);
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(5);
    Seen seen;
    std::uint64_t last = 0;
    const auto displaced = std::make_unique<Displaced>();
    while (subscriber && (seen.states < enough || seen.displaced < enough) && std::chrono::steady_clock::now() < end) {
        if (const auto state = subscriber->state()) {
            ++seen.states;
            seen.torn += !whole(*state);
            seen.backwards += state->tick < last;
            last = state->tick;
        }
        const std::uint64_t before = displaced->tick;
        if (subscriber->displaced(*displaced)) {
            ++seen.displaced;
            seen.torn += !whole(*displaced);
            seen.backwards += displaced->tick <= before;
        }
        if (!subscriber->alive())
            break;
    }
    return seen;
}

// Writes without a rest but for one of a millisecond after every 64th displaced copy: a reader that is slower than this
// writer, as it may be under a sanitizer, gets one then.
void hammer(Publisher& publisher, const std::atomic<bool>& stop)
{
    for (std::uint64_t tick = 1; !stop.load(std::memory_order_relaxed); ++tick) {
        publisher.setState(stateOf(tick));
        if (tick % 4 == 0) {
            fillDisplaced(publisher.backBuffer(), tick);
            publisher.publishDisplaced();
        }
        if (tick % 256 == 0)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
}

TEST(Exchange, SeveralReadersNeverSeeATornCopy)
{
    const std::string session = sessionNamed("threads");
    Publisher publisher(session, smallScenery(), smallLabels());
    std::atomic<bool> stop{false};
    std::thread writer([&] { hammer(publisher, stop); });
    constexpr std::uint64_t enough = 2000;
    std::vector<Seen> seen(3);
    std::vector<std::thread> readers;
    for (Seen& mine : seen)
        readers.emplace_back([&mine, &session] { mine = readMany(session, enough); });
    for (std::thread& reader : readers)
        reader.join();
    stop = true;
    writer.join();
    for (const Seen& mine : seen) {
        EXPECT_GE(mine.states, enough);
        EXPECT_GE(mine.displaced, enough);
        EXPECT_EQ(mine.torn, 0U);
        EXPECT_EQ(mine.backwards, 0U);
    }
}

TEST(Exchange, ReadersInOtherProcessesNeverSeeATornCopy)
{
    const std::string session = sessionNamed("processes");
    int ready[2] = {};
    ASSERT_EQ(::pipe(ready), 0);
    const pid_t writer = ::fork();
    if (writer == 0) {
        Publisher publisher(session, smallScenery(), smallLabels());
        [[maybe_unused]] const auto n = ::write(ready[1], "x", 1);
        hammer(publisher, std::atomic<bool>{false});
        ::_exit(0);
    }
    char byte = 0;
    ASSERT_EQ(::read(ready[0], &byte, 1), 1);
    constexpr std::uint64_t enough = 2000;
    const Seen seen = readMany(session, enough);
    EXPECT_GE(seen.states, enough);
    EXPECT_GE(seen.displaced, enough);
    EXPECT_EQ(seen.torn, 0U);
    EXPECT_EQ(seen.backwards, 0U);

    const auto subscriber = Subscriber::attach(session);
    ::kill(writer, SIGKILL);
    ::waitpid(writer, nullptr, 0);
    const auto last = subscriber->state();
    EXPECT_TRUE(!last || whole(*last)) << "killed in the middle of a write";
    ::close(ready[0]);
    ::close(ready[1]);
    ::shm_unlink(segmentName(session).c_str());
}

}  // namespace
}  // namespace palpate::channel
