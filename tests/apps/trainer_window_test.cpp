#include <channel/channel.h>
#include <tests/apps/desktop.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace palpate::apps {
namespace {

namespace fs = std::filesystem;

constexpr int wide = 1000, high = 700;

bool can()
{
    return built("palpate-trainer") && built("palpate-view") && installed("Xvfb") && installed("xdotool");
}

std::vector<fs::path> filesIn(const fs::path& folder, const std::string& extension)
{
    std::vector<fs::path> files;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder, none))
        if (entry.path().extension() == extension)
            files.push_back(entry.path());
    return files;
}

// 0: the process is gone.
int parentOf(std::uint64_t pid)
{
    std::ifstream status("/proc/" + std::to_string(pid) + "/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("PPid:"))
            return std::stoi(line.substr(5));
    return 0;
}

// The trainer's window, and who uses it.
struct Trainer {
    explicit Trainer(const std::string& chosen = "layered")
        : program(desktop.start("palpate-trainer", {"--size", std::to_string(wide) + "x" + std::to_string(high), "--case",
                                                    chosen, "--sessions", folder / "s"})),
          open(!desktop.window("Palpate trainer").empty())
    {
    }

    const Folder folder;
    const Desktop desktop;
    std::unique_ptr<Program> program;
    bool open;

    void click(int x, int y, const std::string& button = "1") const
    {
        desktop.xdotool({"mousemove", std::to_string(x), std::to_string(y)});
        wait(0.3);
        desktop.xdotool({"click", button});
        wait(0.4);
    }
    void mainButton() const { click(wide - 60, high - 38); }
    // Its window says in its title which screen it is at.
    bool isAt(const std::string& screen) const { return windowIsThere("^Palpate trainer: " + screen + "$"); }
    void key(const std::string& name) const
    {
        desktop.xdotool({"key", name});
        wait(0.4);
    }
    std::optional<channel::Subscriber> session() const
    {
        for (int i = 0; i < 600; ++i) {
            for (const std::string& name : channel::sessions()) {
                auto found = name.starts_with("train-") ? channel::Subscriber::attach(name) : std::nullopt;
                if (found && parentOf(found->ownerPid()) == program->pid() && found->state() && found->input())
                    return found;
            }
            wait(0.1);
        }
        return std::nullopt;
    }
    // The figures of the one session, once it has ended.
    nlohmann::json result() const
    {
        for (int i = 0; i < 300; ++i) {
            if (const auto files = filesIn(folder / "s", ".json"); !files.empty())
                return nlohmann::json::parse(readText(files[0]));
            wait(0.1);
        }
        return {};
    }
    bool windowIsThere(const std::string& name) const { return !desktop.window(name).empty(); }
    // From the list of cases to a session with its window, by `next` on each screen; nothing where one does not come.
    std::optional<channel::Subscriber> sessionBy(const auto& next) const
    {
        for (const std::string screen : {"Case", "Device", "Briefing", "Session"}) {
            if (!isAt(screen)) {
                ADD_FAILURE() << "not at " << screen;
                return std::nullopt;
            }
            if (screen != "Session") {
                wait(0.5);
                next();
            }
        }
        auto found = session();
        if (found && windowIsThere("^Palpate$"))
            return found;
        ADD_FAILURE() << "no session with a window";
        return std::nullopt;
    }
};

TEST(TrainerWindow, ABiopsyFromTheStartToTheDebriefByMouseAlone)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Trainer t;
    ASSERT_TRUE(t.open);
    const auto eyes = t.sessionBy([&] { t.mainButton(); });
    ASSERT_TRUE(eyes);
    wait(1);
    // The needle waits on the planned line: the wheel alone goes along it.
    t.desktop.xdotool({"mousemove", "250", "400", "mousedown", "1"});
    wait(0.6);
    const auto roll = [&](const char* way, int notches, auto until) {
        for (int i = 0; i < 150 && !until(*eyes->state()); ++i) {
            t.desktop.xdotool({"click", "--repeat", std::to_string(notches), "--delay", "40", way});
            wait(0.12);
        }
    };
    roll("4", 3, [](const channel::State& s) { return s.phase == channel::Phase::inserted && s.distance[0] < 12e-3; });
    roll("4", 1, [](const channel::State& s) { return s.phase == channel::Phase::inserted && s.distance[0] < 4e-3; });
    t.desktop.xdotool({"click", "3"});
    wait(0.8);
    ASSERT_EQ(eyes->state()->cores, 1U) << "inserted by " << eyes->state()->inserted << " m, target at "
                                        << eyes->state()->distance[0] << " m, phase "
                                        << static_cast<int>(eyes->state()->phase);
    roll("5", 3, [](const channel::State& s) { return s.phase == channel::Phase::free; });
    t.desktop.xdotool({"mouseup", "1"});
    wait(1);
    // On the words of the last step, below title and caption.
    for (int y = 40; y < 110 && eyes->ending() == channel::Ending::none; y += 8)
        t.click(60, y);
    const auto json = t.result();
    ASSERT_EQ(json["core"].size(), 1U);
    EXPECT_GT(json["core"][0]["target_fraction"], 0.2);
    EXPECT_GT(json["score"]["total"], 60);
    ASSERT_TRUE(t.isAt("Result"));
    wait(1);
    t.click(250, high - 79);  // debrief
    EXPECT_TRUE(t.windowIsThere("^Palpate$"));
    EXPECT_EQ(figures({"replay", filesIn(t.folder / "s", ".db").at(0).string()})["identical"], true);
}

// The tip goes by a millimetre a key, in the picture and along the needle.
void expectKeysMoveTheTool(const Trainer& t, const channel::Subscriber& eyes)
{
    const auto tip = [&] { return vec(eyes.state()->tip); };
    const auto press = [&](const std::string& key, int times) {
        t.desktop.xdotool({"key", "--repeat", std::to_string(times), "--delay", "40", key});
        wait(1.0);
    };
    const glm::dvec3 start = tip();
    press("Right", 6);
    EXPECT_NEAR(glm::distance(tip(), start), 0.0, 0.2e-3) << "nobody holds the tool";
    t.key("Return");
    press("Right", 6);
    const glm::dvec3 right = tip() - start;
    EXPECT_NEAR(glm::length(right), 6e-3, 1.5e-3);
    press("shift+Left", 30);
    EXPECT_NEAR(glm::distance(tip(), start), 0.0, 1.5e-3) << "five of them with Shift are one without";
    press("Up", 6);
    EXPECT_NEAR(glm::length(tip() - start), 6e-3, 1.5e-3);
    EXPECT_NEAR(glm::dot(glm::normalize(tip() - start), glm::normalize(right)), 0.0, 0.3);
    press("Down", 6);
    press("ctrl+Page_Down", 4);
    EXPECT_NEAR(glm::length(tip() - start), 4e-3, 1.5e-3);
    press("ctrl+Page_Up", 4);
    const glm::dvec3 axis = vec(eyes.state()->axis);
    press("ctrl+Right", 3);
    EXPECT_NEAR(glm::degrees(std::acos(glm::dot(axis, vec(eyes.state()->axis)))), 6.0, 1.0);
    press("ctrl+Left", 3);
}

TEST(TrainerWindow, ABiopsyFromTheStartToTheDebriefByKeysAlone)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Trainer t;
    ASSERT_TRUE(t.open);
    const auto eyes = t.sessionBy([&] { t.key("Return"); });
    ASSERT_TRUE(eyes);
    wait(2);
    expectKeysMoveTheTool(t, *eyes);
    const auto go = [&](const char* key, auto until) {
        for (int i = 0; i < 150 && !until(*eyes->state()); ++i) {
            t.desktop.xdotool({"key", key});
            wait(0.12);
        }
    };
    go("Page_Down", [](const channel::State& s) { return s.phase == channel::Phase::inserted && s.distance[0] < 4e-3; });
    t.key("space");
    ASSERT_EQ(eyes->state()->cores, 1U);
    go("Page_Up", [](const channel::State& s) { return s.phase == channel::Phase::free; });
    t.key("Return");
    t.key("e");
    const auto json = t.result();
    ASSERT_EQ(json["core"].size(), 1U);
    EXPECT_GT(json["core"][0]["target_fraction"], 0.2);
    EXPECT_GT(json["score"]["total"], 60);
    ASSERT_TRUE(t.isAt("Result"));
    wait(1);
    t.key("d");
    EXPECT_TRUE(t.windowIsThere("^Palpate$"));
    wait(2);
    t.key("q");
    wait(1);
    t.key("Escape");
    t.key("Escape");
    EXPECT_EQ(t.program->wait().status, 0);
}

// Esc is "back" on every other screen: in a session it asks first, and who touched nothing has no result.
TEST(TrainerWindow, EscapeAsksBeforeItEndsASession)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Trainer t;
    const auto eyes = t.sessionBy([&] { t.key("Return"); });
    ASSERT_TRUE(eyes);
    wait(1);
    t.key("Escape");
    wait(1);
    EXPECT_EQ(eyes->ending(), channel::Ending::none);
    t.key("Escape");
    EXPECT_EQ(t.result()["contacts"], 0);
    ASSERT_TRUE(t.isAt("Result"));
    wait(1);
    t.key("d");                         // nothing to see again
    constexpr double longEnough = 4.0;  // a debrief opens its window in one
    EXPECT_TRUE(t.desktop.window("^Palpate$", longEnough).empty());
}

TEST(TrainerWindow, ASignalEndsTheSessionThatItHasStarted)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Trainer t;
    const auto eyes = t.sessionBy([&] { t.key("Return"); });
    ASSERT_TRUE(eyes);
    t.program->send(SIGTERM);
    const Outcome outcome = t.program->wait();
    EXPECT_EQ(outcome.status, 128 + SIGTERM);
    EXPECT_EQ(outcome.err, "palpate-trainer: interrupted\n");
    EXPECT_EQ(eyes->ending(), channel::Ending::finished) << "in order, with its record";
}

TEST(TrainerWindow, PalpateAloneOpensItOnADesktopAndItsHelpElsewhere)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Desktop desktop;
    const auto program = desktop.start("palpate", {});
    ASSERT_FALSE(desktop.window("Palpate trainer").empty());
    desktop.xdotool({"key", "Escape"});
    EXPECT_EQ(program->wait().status, 0);
    const Outcome bare =
        Program("/usr/bin/env", {"-u", "DISPLAY", "-u", "WAYLAND_DISPLAY", std::string(PALPATE_BIN_DIR) + "/palpate"})
            .wait();
    EXPECT_EQ(bare.status, 2);
    EXPECT_NE(bare.err.find("palpate --help"), std::string::npos);
}

// From the list of cases back over the buttons above it, whatever is beside or below what.
TEST(TrainerWindow, TabGoesToEverythingThatCanBePressed)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Trainer t("first-touch");
    ASSERT_TRUE(t.isAt("Case"));
    wait(1);
    for (const char* key : {"shift+Tab", "shift+Tab", "Return"}) {
        t.key(key);
    }
    EXPECT_TRUE(t.isAt("Instructor")) << "beside the settings, before the list";
}

// A setting that is changed is kept at once, and all is drawn anew: behind the settings, which keep the focus.
TEST(TrainerWindow, KeysStayInTheSettingsWhenOneIsChanged)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Trainer t("first-touch");
    ASSERT_TRUE(t.isAt("Case"));
    wait(1);
    // Settings; English, Deutsch, colours as in the body; the next ones, and what is behind them.
    for (const char* key : {"shift+Tab", "Return", "Tab", "Tab", "Return", "Tab", "Return"}) {
        t.key(key);
    }
    wait(0.6);
    EXPECT_TRUE(t.isAt("Case")) << "Enter chose a case behind the settings";
}

TEST(TrainerWindow, EachScreenIsDrawnToMeasureIt)
{
    if (!can())
        GTEST_SKIP() << "needs palpate-trainer, palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Desktop desktop;
    const Folder folder;
    const auto program = desktop.start("palpate-trainer",
                                       {"--frames", "3", "--screens", "--json", folder / "f", "--sessions", folder / "s"});
    ASSERT_EQ(program->wait().status, 0);
    const auto json = nlohmann::json::parse(readText(folder / "f"));
    EXPECT_EQ(json.at("frames"), 3 * json.at("screens").size());
    for (const char* screen : {"case", "device", "briefing", "session", "result", "progress", "instructor, live",
                               "instructor, kept", "instructor, groups"}) {
        const auto& of = json.at("screens").at(screen);
        EXPECT_EQ(of.at("frames"), 3) << screen;
        EXPECT_GT(of.at("frame_ms_p50"), 0) << screen;
        EXPECT_LE(of.at("frame_ms_p50"), of.at("frame_ms_max")) << screen;
    }
}

}  // namespace
}  // namespace palpate::apps
