// A six-axis mouse, by a daemon that speaks as spacenavd's first protocol does: 8 numbers for each event.
#include <render/space_mouse.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <thread>

namespace palpate::render {
namespace {

class Daemon {
public:
    Daemon()
    {
        const std::string path = (folder_ / "spnav").string();
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::strncpy(address.sun_path, path.c_str(), sizeof(address.sun_path) - 1);
        listener_ = ::socket(AF_UNIX, SOCK_STREAM, 0);
        EXPECT_EQ(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        EXPECT_EQ(::listen(listener_, 1), 0);
        ::setenv("SPNAV_SOCKET", path.c_str(), 1);
    }
    ~Daemon()
    {
        ::unsetenv("SPNAV_SOCKET");
        ::close(client_);
        ::close(listener_);
    }
    void accept() { client_ = ::accept(listener_, nullptr, nullptr); }
    void say(const std::array<int, 8>& event) const
    {
        EXPECT_EQ(::write(client_, event.data(), sizeof event), static_cast<ssize_t>(sizeof event));
    }

private:
    tests::Folder folder_;
    int listener_ = -1, client_ = -1;
};

// Two events of 50 ms with the cap half way to the right, pressed down all the way and turned: what it was moved is their
// sum.
TEST(SpaceMouse, MovesTheProbeByHowLongAndHowFarItIsHeld)
{
    Daemon daemon;
    SpaceMouse mouse;
    ASSERT_TRUE(mouse.connected());
    EXPECT_EQ(mouse.moved(), ultrasound::ProbeMove{});
    daemon.accept();
    daemon.say({0, 175, -350, 0, 0, 350, 0, 50});
    daemon.say({0, 175, -700, 0, 0, 350, 0, 50});
    daemon.say({1, 3, 1, 0, 0, 0, 0, 0});  // a button is no motion
    ultrasound::ProbeMove sum;
    for (int i = 0; i < 100; ++i) {
        sum += mouse.moved();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_NEAR(sum.slide, -0.1 * 0.5 * SpaceMouse::fastest, 1e-12);
    EXPECT_NEAR(sum.press, 0.1 * SpaceMouse::fastest, 1e-12) << "farther than the cap goes counts as that";
    EXPECT_NEAR(sum.turn, 0.1 * SpaceMouse::fastestTurn, 1e-12);
    EXPECT_EQ(sum.sweep, 0.0);
    EXPECT_EQ(mouse.moved(), ultrasound::ProbeMove{});
}

TEST(SpaceMouse, WithoutADaemonNothingMoves)
{
    ::setenv("SPNAV_SOCKET", "/nonexistent/spnav", 1);
    SpaceMouse mouse;
    ::unsetenv("SPNAV_SOCKET");
    EXPECT_FALSE(mouse.connected());
    EXPECT_EQ(mouse.moved(), ultrasound::ProbeMove{});
}

}  // namespace
}  // namespace palpate::render
