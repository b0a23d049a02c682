#include <command/progress.h>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace palpate::apps {
namespace {

/// Standard error goes into `end` as long as it lives.
class Redirected {
public:
    explicit Redirected(int end) : kept_(::dup(STDERR_FILENO)) { ::dup2(end, STDERR_FILENO); }
    ~Redirected()
    {
        ::dup2(kept_, STDERR_FILENO);
        ::close(kept_);
    }
    Redirected(const Redirected&) = delete;
    Redirected& operator=(const Redirected&) = delete;

private:
    int kept_;
};

// What comes out at `end` until it holds `awaited`, or half a minute is over.
std::string readUntil(int end, const std::string& awaited)
{
    std::string all;
    while (all.find(awaited) == std::string::npos) {
        pollfd ready{end, POLLIN, 0};
        char bytes[4096];
        const ssize_t count = ::poll(&ready, 1, 30000) > 0 ? ::read(end, bytes, sizeof bytes) : 0;
        if (count <= 0) {
            break;
        }
        all.append(bytes, static_cast<std::size_t>(count));
    }
    return all;
}

TEST(Progress, ATerminalSeesTheClockGoOnAndTheLineTakenAway)
{
    const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY);
    ASSERT_GE(terminal, 0);
    ASSERT_EQ(::grantpt(terminal), 0);
    ASSERT_EQ(::unlockpt(terminal), 0);
    const int screen = ::open(::ptsname(terminal), O_RDWR | O_NOCTTY);
    ASSERT_GE(screen, 0);
    {
        const Redirected redirected(screen);
        command::Progress progress(command::Progress::Clock::ticking);
        progress.show("counting");
        // Said once; the seconds come from the clock.
        EXPECT_NE(readUntil(terminal, "1 s: counting").find("1 s: counting"), std::string::npos);
        EXPECT_NE(readUntil(terminal, "2 s: counting").find("2 s: counting"), std::string::npos);
        progress.show("reading", 0.5);
        const std::string bar = "s: reading [###############...............] 50 %";
        EXPECT_NE(readUntil(terminal, bar).find(bar), std::string::npos);
        progress.clear();
        const std::string taken = readUntil(terminal, "\r\x1b[K");
        EXPECT_EQ(taken.substr(taken.size() - 4), "\r\x1b[K");
    }
    ::close(screen);
    ::close(terminal);
}

TEST(Progress, AFileSeesNothing)
{
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    {
        const Redirected redirected(ends[1]);
        command::Progress progress(command::Progress::Clock::ticking);
        progress.show("counting");
        ::usleep(1500000);
        progress.show("reading", 1);
    }
    ::close(ends[1]);
    EXPECT_EQ(readUntil(ends[0], "anything"), "");
    ::close(ends[0]);
}

}  // namespace
}  // namespace palpate::apps
