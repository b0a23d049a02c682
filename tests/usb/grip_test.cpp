// Buttons of an emulated Falcon behind a kernel that umockdev plays, in the programs as a user starts them. Run it under
// umockdev-wrapper.
#include <base/inputs.h>
#include <tests/apps/desktop.h>
#include <tests/falcon/rig.h>
#include <tests/usb/kernel.h>

#include <gtest/gtest.h>

#include <signal.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>

namespace palpate::falcon {
namespace {

namespace fs = std::filesystem;
using apps::Desktop;
using apps::Program;

bool waitFor(const std::function<bool()>& holds, int looks = 1200)
{
    for (int i = 0; i < looks && !holds(); ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return holds();
}

// A homed Falcon that answers, and a finger.
struct GripBench {
    GripBench() : device(syntheticFirmware(600).image), kernel(device) { device.makeReady(); }

    // Whoever listens hears so many packets more.
    bool heard(std::uint64_t packets) const
    {
        const std::uint64_t begun = device.packets();
        return waitFor([&] { return device.packets() >= begun + packets; });
    }
    // Holds the button until `seen`, and lets it go. Presses again as a hand would where nothing has come of it in ten
    // seconds: one screen's listener may still have heard it when the next screen was there.
    bool press(std::uint8_t button, const std::function<bool()>& seen)
    {
        bool happened = false;
        for (int presses = 0; presses < 4 && !happened; ++presses) {
            device.hand.buttons = button;
            happened = waitFor(seen, 200);
            device.hand.buttons = 0;
            if (!heard(20)) {
                return false;
            }
        }
        return happened;
    }

    Emulator device;
    Kernel kernel;
};

std::string wordsOf(const fs::path& process)
{
    std::string words = base::contentOf(process / "cmdline").value_or("");
    std::ranges::replace(words, '\0', ' ');
    return words;
}

// How many processes that `parent` has started were started with these words.
int children(int parent, const std::string& words)
{
    int count = 0;
    for (const auto& entry : fs::directory_iterator("/proc")) {
        std::ifstream status(entry.path() / "status");
        std::string line;
        while (std::getline(status, line) && !line.starts_with("PPid:")) {
        }
        const bool child = line.starts_with("PPid:") && std::stoi(line.substr(5)) == parent;
        count += child && wordsOf(entry.path()).find(words) != std::string::npos ? 1 : 0;
    }
    return count;
}

TEST(Grip, TheCommandPrintsALineForEachPressAndLetsTheFalconGo)
{
    GripBench bench;
    const apps::Folder folder;
    const std::string file = folder / "lines";
    Program command("/usr/bin/env", {"sh", "-c", "exec " PALPATE_BIN_DIR "/palpate devices --buttons > " + file});
    const auto has = [&](const std::string& line) {
        return [&, line] { return apps::readText(file).find(line) != std::string::npos; };
    };
    ASSERT_TRUE(waitFor(has("ready: ")));
    EXPECT_TRUE(bench.kernel.claimed);
    ASSERT_TRUE(bench.heard(20));
    EXPECT_TRUE(bench.press(buttonForward, has("button forward\n")));
    EXPECT_TRUE(bench.press(buttonLeft, has("button left\n")));
    command.send(SIGTERM);
    EXPECT_EQ(command.wait().status, 128 + SIGTERM);
    EXPECT_TRUE(waitFor([&] { return !bench.kernel.claimed; }));
    EXPECT_EQ(bench.device.command().motor, Triple{});
    const std::string lines = apps::readText(file);
    EXPECT_EQ(lines.substr(lines.find('\n') + 1), "button forward\nbutton left\n");
}

// By hand (Ctrl-C), or by the trainer's window as it is closed: the push ends and its torque is gone.
TEST(Grip, ATestPushThatIsInterruptedLeavesNoTorque)
{
    for (const int signal : {SIGINT, SIGTERM}) {
        GripBench bench;
        Program command("palpate", {"devices", "--force-test"});
        const Vec3 middle = bench.device.hand.goal;
        double side = 5e-3;
        ASSERT_TRUE(waitFor([&] {
            side = -side;
            bench.device.hand.goal = middle + Vec3(side, side, 2 * side);
            bench.device.hand.buttons = buttonCentre;
            return largestOf(bench.device.command().motor) > 100;
        }));
        command.send(signal);
        EXPECT_EQ(command.wait().status, 128 + signal);
        EXPECT_EQ(bench.device.command().motor, Triple{});
        EXPECT_FALSE(bench.kernel.claimed);
    }
}

TEST(Grip, ACommandThatNobodyListensToEnds)
{
    const GripBench bench;
    {
        // Killed, it leaves the command behind.
        Program shell("/usr/bin/env", {"sh", "-c", PALPATE_BIN_DIR "/palpate devices --buttons & wait"});
        ASSERT_TRUE(waitFor([&] { return bench.kernel.claimed.load(); }));
    }
    EXPECT_TRUE(waitFor([&] { return !bench.kernel.claimed; }));
}

// The trainer's window on a display of its own.
struct Window {
    const apps::Folder folder;
    const Desktop desktop;
    std::unique_ptr<Program> trainer =
        desktop.start("palpate-trainer", {"--case", "first-touch", "--sessions", folder / "sessions"});

    bool isAt(const std::string& screen) const
    {
        return desktop.xdotool({"search", "--onlyvisible", "--name", "^Palpate trainer: " + screen + "$"}) != "";
    }
    bool hasResult() const
    {
        std::error_code none;
        for (const auto& entry : fs::directory_iterator(folder / "sessions", none))
            if (entry.path().extension() == ".json" && apps::readText(entry.path()).find("\"score\"") != std::string::npos)
                return true;
        return false;
    }
    int runs(const std::string& words) const { return children(trainer->pid(), words); }
};

// A session with the Falcon, chosen, begun and ended without a hand leaving its grip.
TEST(Grip, ItsButtonsWorkTheScreensAndASessionGetsTheFalcon)
{
    if (!apps::built("palpate-trainer") || !apps::built("palpate-view"))
        GTEST_SKIP() << "there is no palpate-view";
    GripBench bench;
    Window window;
    const auto at = [&](const char* screen) { return [&window, screen] { return window.isAt(screen); }; };
    ASSERT_TRUE(waitFor(at("Case")));
    const auto listening = [&] { return bench.kernel.claimed && window.runs("devices --buttons") == 1; };
    ASSERT_TRUE(waitFor(listening) && bench.heard(20));
    ASSERT_TRUE(bench.press(buttonForward, at("Device")));
    ASSERT_TRUE(waitFor(listening) && bench.heard(20));
    ASSERT_TRUE(bench.press(buttonCentre, at("Case"))) << "back";
    ASSERT_TRUE(bench.press(buttonForward, at("Device")));
    ASSERT_TRUE(waitFor(listening) && bench.heard(20));
    // The focus is on the main button, the last one: the first two are the mouse and the Falcon.
    const auto tap = [&](std::uint8_t button) {
        bench.device.hand.buttons = button;
        ASSERT_TRUE(bench.heard(20));
        bench.device.hand.buttons = 0;
        ASSERT_TRUE(bench.heard(20));
    };
    tap(buttonRight);
    tap(buttonRight);
    tap(buttonForward);
    tap(buttonLeft);
    tap(buttonLeft);
    ASSERT_TRUE(bench.press(buttonForward, at("Briefing")));
    bench.device.hand.buttons = buttonForward;
    ASSERT_TRUE(waitFor(at("Session")));
    bench.device.hand.buttons = 0;
    EXPECT_TRUE(waitFor([&] { return window.runs("--device falcon") == 1; })) << "the second button was marked";
    EXPECT_EQ(window.runs("devices --buttons"), 0);
    EXPECT_TRUE(waitFor([&] { return bench.kernel.claimed.load(); })) << "the session has it";
    // Whoever trains moves the grip, as the session asks for, and ends it by the left button, held.
    bench.device.hand.buttons = buttonLeft;
    const Vec3 middle = bench.device.hand.goal;
    double side = 5e-3;
    EXPECT_TRUE(waitFor([&] {
        side = -side;
        bench.device.hand.goal = middle + Vec3(side, side, 2 * side);
        return window.isAt("Result");
    }));
    EXPECT_TRUE(window.hasResult()) << "a session that could not have the Falcon has none";
    EXPECT_TRUE(waitFor(listening));
    bench.device.hand.buttons = 0;
    EXPECT_TRUE(bench.heard(20));
    ASSERT_TRUE(bench.press(buttonCentre, at("Case")));
    // Whoever has the Falcon lets it go before the kernel is gone.
    window.trainer->send(SIGTERM);
    EXPECT_EQ(window.trainer->wait().status, 128 + SIGTERM);
    EXPECT_TRUE(waitFor([&] { return !bench.kernel.claimed; }));
}

}  // namespace
}  // namespace palpate::falcon
