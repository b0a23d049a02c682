#include <channel/channel.h>
#include <channel/segment.h>
#include <tests/allocations.h>
#include <tests/channel/example.h>

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>
#include <vector>

namespace palpate::channel {
namespace {

Scenery mouseScenery()
{
    Scenery scenery = smallScenery();
    scenery.viewersHand = 1;
    return scenery;
}

// An input in which every number follows from `n`.
Input inputOf(std::uint64_t n)
{
    const double x = static_cast<double>(n);
    Input input;
    input.target = {x, x + 1, x + 2};
    input.axis = {x, x, x};
    input.fires = input.marks = static_cast<std::uint32_t>(n);
    return input;
}

bool whole(const Input& input)
{
    const Input expected = inputOf(input.fires);
    return input.target == expected.target && input.axis == expected.axis && input.marks == expected.marks;
}

TEST(ViewersHand, ArrivesAtTheSimulationAndAtOtherViewers)
{
    const std::string session = sessionNamed("hand");
    const Publisher publisher(session, mouseScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    EXPECT_FALSE(publisher.input());
    auto hand = ViewersHand::take(*subscriber);
    ASSERT_TRUE(hand);
    EXPECT_FALSE(publisher.input()) << "nothing has been written yet";
    hand->set(inputOf(5));
    ASSERT_TRUE(publisher.input());
    EXPECT_TRUE(whole(*publisher.input()));
    EXPECT_EQ(subscriber->input()->fires, 5U);
    const std::uint64_t beat = publisher.input()->beat;
    hand->set(inputOf(5));
    EXPECT_EQ(publisher.input()->beat, beat + 1);
}

TEST(ViewersHand, IsOneViewersAtATimeAndOnlyWhereTheSessionHasNoneOfItsOwn)
{
    const std::string session = sessionNamed("one"), other = sessionNamed("own");
    const Publisher publisher(session, mouseScenery(), smallLabels()), own(other, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    EXPECT_FALSE(ViewersHand::take(*Subscriber::attach(other)));
    {
        auto first = ViewersHand::take(*subscriber);
        ASSERT_TRUE(first);
        EXPECT_FALSE(ViewersHand::take(*subscriber));
        const ViewersHand moved = std::move(*first);
        EXPECT_FALSE(ViewersHand::take(*subscriber));
    }
    EXPECT_TRUE(ViewersHand::take(*subscriber)) << "given back";
}

TEST(ViewersHand, OfAParentIsNotGivenBackByItsChild)
{
    const std::string session = sessionNamed("forked-hand");
    const Publisher publisher(session, mouseScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    auto hand = ViewersHand::take(*subscriber);
    const pid_t child = ::fork();
    if (child == 0) {
        hand.reset();
        ::_exit(0);
    }
    ::waitpid(child, nullptr, 0);
    EXPECT_FALSE(ViewersHand::take(*subscriber));
    hand.reset();
    EXPECT_TRUE(ViewersHand::take(*subscriber));
}

// Killed where it hurts most: inside a write.
TEST(ViewersHand, OfAKilledViewerIsFreeAndItsLastWriteDisturbsNobody)
{
    const std::string session = sessionNamed("dead-hand");
    const Publisher publisher(session, mouseScenery(), smallLabels());
    int ready[2] = {};
    ASSERT_EQ(::pipe(ready), 0);
    const pid_t viewer = ::fork();
    if (viewer == 0) {
        const auto subscriber = Subscriber::attach(session);
        auto hand = ViewersHand::take(*subscriber);
        hand->set(inputOf(3));
        RawSegment raw(segmentName(session));
        raw.at<InputBlock>(raw.at<Header>(0).inputOffset).sequence += 1;
        [[maybe_unused]] const auto n = ::write(ready[1], "x", 1);
        for (;;)
            ::pause();
    }
    char byte = 0;
    ASSERT_EQ(::read(ready[0], &byte, 1), 1);
    const auto subscriber = Subscriber::attach(session);
    EXPECT_FALSE(ViewersHand::take(*subscriber)) << "it lives";
    EXPECT_FALSE(publisher.input());
    ::kill(viewer, SIGKILL);
    ::waitpid(viewer, nullptr, 0);
    auto hand = ViewersHand::take(*subscriber);
    ASSERT_TRUE(hand);
    hand->set(inputOf(4));
    ASSERT_TRUE(publisher.input());
    EXPECT_EQ(publisher.input()->fires, 4U);
    ::close(ready[0]);
    ::close(ready[1]);
}

TEST(ViewersHand, CanWriteNothingElse)
{
    const std::string session = sessionNamed("page");
    const Publisher publisher(session, mouseScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    const auto hand = ViewersHand::take(*subscriber);
    ASSERT_TRUE(hand);
    RawSegment raw(segmentName(session));
    const auto& header = raw.at<Header>(0);
    constexpr std::size_t page = 4096;
    EXPECT_EQ(header.inputOffset % page, 0U);
    for (const std::uint64_t other :
         {header.sceneryOffset, header.labelsOffset, header.stateOffset, header.displacedOffset})
        EXPECT_TRUE(other + page <= header.inputOffset || other >= header.inputOffset + page);
}

TEST(ViewersHand, IsNeverSeenTornByTheSimulation)
{
    const std::string session = sessionNamed("torn-hand");
    const Publisher publisher(session, mouseScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    auto hand = ViewersHand::take(*subscriber);
    ASSERT_TRUE(hand);
    std::atomic<bool> stop{false};
    std::thread viewer([&] {
        for (std::uint64_t n = 1; !stop; ++n) {
            hand->set(inputOf(n));
            std::this_thread::yield();
        }
    });
    int seen = 0, torn = 0;
    const auto before = tests::allocations();
    constexpr int enough = 2000;
    while (seen < enough)
        if (const auto input = publisher.input()) {
            ++seen;
            torn += !whole(*input);
        }
    const auto after = tests::allocations();
    stop = true;
    viewer.join();
    EXPECT_EQ(torn, 0);
    EXPECT_EQ(after, before);
}

TEST(Session, TwoSideBySideDoNotMix)
{
    const std::string first = sessionNamed("left"), second = sessionNamed("right");
    Publisher left(first, mouseScenery(), smallLabels()), right(second, mouseScenery(), smallLabels());
    const auto seesLeft = Subscriber::attach(first), seesRight = Subscriber::attach(second);
    auto hand = ViewersHand::take(*seesRight);
    ASSERT_TRUE(hand);
    for (std::uint64_t tick = 1; tick <= 100; ++tick) {
        left.setState(stateOf(tick));
        right.setState(stateOf(1000 + tick));
        fillDisplaced(left.backBuffer(), tick);
        left.publishDisplaced();
        hand->set(inputOf(tick));
        EXPECT_EQ(seesLeft->state()->tick, tick);
        EXPECT_EQ(seesRight->state()->tick, 1000 + tick);
        EXPECT_FALSE(left.input());
        EXPECT_EQ(right.input()->fires, tick);
    }
    EXPECT_FALSE(seesRight->displaced(*std::make_unique<Displaced>()));
}

// A replay goes back in time too.
TEST(Exchange, DisplacedNodesOfAnEarlierTickAreNewsWhenTheyArePublishedLater)
{
    const std::string session = sessionNamed("back");
    Publisher publisher(session, smallScenery(), smallLabels());
    const auto subscriber = Subscriber::attach(session);
    const auto displaced = std::make_unique<Displaced>();
    for (const std::uint64_t tick : {40, 20, 20, 30}) {
        fillDisplaced(publisher.backBuffer(), tick);
        publisher.publishDisplaced();
        EXPECT_TRUE(subscriber->displaced(*displaced));
        EXPECT_EQ(displaced->tick, tick);
        EXPECT_FALSE(subscriber->displaced(*displaced));
    }
}

// At the size of the largest display volume and while ticks come.
TEST(Exchange, AViewerAttachesAtTheFirstTryAtAnyTime)
{
    const std::string session = sessionNamed("attach");
    Scenery scenery = smallScenery();
    scenery.labels.size = {160, 160, 160};
    Publisher publisher(session, scenery, std::vector<std::uint8_t>(160U * 160U * 160U, 1));
    publisher.setState(stateOf(1));  // a thread may begin late
    std::atomic<bool> stop{false};
    std::thread simulation([&] {
        for (std::uint64_t tick = 2; !stop; ++tick) {
            publisher.setState(stateOf(tick));
            if (tick % 33 == 0) {
                fillDisplaced(publisher.backBuffer(), tick);
                publisher.publishDisplaced();
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
    });
    for (int i = 0; i < 20; ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(17));
        const auto viewer = Subscriber::attach(session);
        ASSERT_TRUE(viewer);
        const std::vector<std::uint8_t> copy(viewer->labels().begin(), viewer->labels().end());
        EXPECT_EQ(copy.size(), 160U * 160U * 160U);
        // A writer that loses its core in the middle of a write leaves nothing to be read until it goes on.
        auto state = viewer->state();
        for (int k = 0; k < 1000 && !state; ++k) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            state = viewer->state();
        }
        EXPECT_TRUE(state);
    }
    stop = true;
    simulation.join();
}

}  // namespace
}  // namespace palpate::channel
