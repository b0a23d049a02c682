#include <base/end_in_order.h>

#include <gtest/gtest.h>

#include <signal.h>

#include <optional>

namespace palpate::base {
namespace {

int termsBefore = 0;

class EndInOrderTest : public testing::Test {
protected:
    EndInOrderTest()
    {
        termsBefore = 0;
        struct sigaction action {};
        action.sa_handler = [](int) { ++termsBefore; };
        ::sigaction(SIGTERM, &action, &saved_);
    }
    ~EndInOrderTest() override { ::sigaction(SIGTERM, &saved_, nullptr); }

private:
    struct sigaction saved_ {};
};

TEST_F(EndInOrderTest, ASignalEndsAllThatLive)
{
    std::optional<EndInOrder> first(std::in_place), second(std::in_place);
    raise(SIGTERM);
    EXPECT_TRUE(first->wanted() && second->wanted() && EndInOrder::asked());
    EXPECT_EQ(first->interruptedBy(), SIGTERM);
    EXPECT_EQ(second->interruptedBy(), SIGTERM);
    EXPECT_EQ(EndInOrder::signal(), SIGTERM);
    // One that begins afterwards neither ends with it nor hides it from those that have not looked yet.
    const EndInOrder third;
    EXPECT_FALSE(third.wanted());
    EXPECT_TRUE(first->wanted() && second->wanted());
    EXPECT_EQ(termsBefore, 0);
}

TEST_F(EndInOrderTest, OneEndsAlone)
{
    EndInOrder first;
    const EndInOrder second;
    first.end();
    EXPECT_TRUE(first.wanted());
    EXPECT_EQ(first.interruptedBy(), 0);
    EXPECT_FALSE(second.wanted() || EndInOrder::asked());
}

// In whatever order they end, the last restores what was there before the first; another one begins without a wish.
TEST_F(EndInOrderTest, TheLastRestores)
{
    std::optional<EndInOrder> first(std::in_place), second(std::in_place);
    first.reset();
    raise(SIGTERM);
    EXPECT_EQ(termsBefore, 0);
    EXPECT_TRUE(second->wanted());
    second.reset();
    raise(SIGTERM);
    EXPECT_EQ(termsBefore, 1);
    const EndInOrder third, fourth;
    EXPECT_FALSE(third.wanted() || fourth.wanted() || EndInOrder::asked());
}

// How another program says that the work is done.
TEST_F(EndInOrderTest, SigUsr1InterruptsNothing)
{
    const EndInOrder work;
    raise(SIGUSR1);
    EXPECT_TRUE(work.wanted());
    EXPECT_EQ(work.interruptedBy(), 0);
}

}  // namespace
}  // namespace palpate::base
