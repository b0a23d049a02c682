#include <base/process.h>

#include <gtest/gtest.h>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>

namespace palpate::base {
namespace {

// Ended, and not yet taken in by its parent.
TEST(Process, ADeadOneHasNoStart)
{
    const StartedProgram child = start({{"true"}});
    ASSERT_EQ(child.error, 0);
    siginfo_t ended{};
    ASSERT_EQ(waitid(P_PID, static_cast<id_t>(child.pid), &ended, WEXITED | WNOWAIT), 0);
    EXPECT_EQ(processStart(static_cast<std::uint64_t>(child.pid)), 0U);
    EXPECT_EQ(exitStatus(child.pid), 0);
    EXPECT_EQ(processStart(static_cast<std::uint64_t>(child.pid)), 0U);
}

TEST(Process, AChildStartsAfterItsParent)
{
    const StartedProgram child = start({{"sleep", "60"}});
    ASSERT_EQ(child.error, 0);
    const std::uint64_t own = processStart(static_cast<std::uint64_t>(getpid()));
    EXPECT_GT(own, 0U);
    EXPECT_GE(processStart(static_cast<std::uint64_t>(child.pid)), own);
    kill(child.pid, SIGKILL);
    EXPECT_EQ(exitStatus(child.pid), -1);
}

TEST(Process, AProgramGetsItsWordsAndStreams)
{
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    const StartedProgram child = start({{"sh", "-c", "printf '%s' \"$0\"; exit 7", "a b"}, {-1, ends[1], -1}});
    ASSERT_EQ(child.error, 0);
    EXPECT_EQ(exitStatus(child.pid), 7);
    close(ends[1]);
    std::array<char, 16> text{};
    EXPECT_EQ(read(ends[0], text.data(), text.size()), 3);
    EXPECT_STREQ(text.data(), "a b");
    close(ends[0]);
}

TEST(Process, OnlyAnOwnGroupIsOutOfReachOfTheTerminal)
{
    for (const bool own : {false, true}) {
        const StartedProgram child = start({{"sleep", "60"}, {-1, -1, -1}, own});
        ASSERT_EQ(child.error, 0);
        EXPECT_EQ(getpgid(child.pid), own ? child.pid : getpgrp());
        kill(child.pid, SIGKILL);
        exitStatus(child.pid);
    }
}

TEST(Process, AProgramThatIsNotThereIsAnError)
{
    const StartedProgram none = start({{"palpate-no-such-program"}});
    EXPECT_EQ(none.error, ENOENT);
    EXPECT_EQ(none.pid, -1);
}

}  // namespace
}  // namespace palpate::base
