#include <channel/channel.h>
#include <tests/apps/desktop.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <thread>

namespace palpate::apps {
namespace {

using glm::dvec3;

// Somebody at a window: sees the tool as any viewer sees it, and has nothing but mouse and keys.
class User {
public:
    User(const Desktop& desktop, const channel::Subscriber& eyes) : desktop_(desktop), eyes_(eyes) {}

    channel::State sees() const { return *eyes_.state(); }

    void takeTool(const std::string& window) const
    {
        desktop_.xdotool({"mousemove", "--window", window, "250", "80", "mousedown", "1"});
        wait(0.5);
    }

    // How the tip goes when the mouse goes to the right, down, and the wheel turns with Ctrl.
    void learn()
    {
        constexpr int step = 24;
        pixelRight_ = tried({"mousemove_relative", "--", std::to_string(step), "0"}) / double(step);
        pixelDown_ = tried({"mousemove_relative", "--", "0", std::to_string(step)}) / double(step);
        notch_ = tried({"keydown", "ctrl", "click", "4", "keyup", "ctrl"});
    }

    // By at least half a pixel.
    void move(dvec3 by)
    {
        left_ += by;
        const glm::dmat3 ways(pixelRight_, pixelDown_, notch_);
        if (!(std::abs(glm::determinant(ways)) > 0.0))
            throw std::runtime_error("the tip does not follow the mouse");
        const dvec3 way = glm::inverse(ways) * left_;
        const long right = std::lround(way.x), down = std::lround(way.y), notches = std::lround(way.z);
        left_ -= double(right) * pixelRight_ + double(down) * pixelDown_ + double(notches) * notch_;
        std::vector<std::string> words;
        if (right != 0 || down != 0)
            words = {"mousemove_relative", "--", std::to_string(right), std::to_string(down)};
        if (notches != 0)
            words.insert(words.end(), {"keydown", "ctrl"});
        for (long i = 0; i < std::abs(notches); ++i)
            words.insert(words.end(), {"click", notches > 0 ? "4" : "5"});
        if (notches != 0)
            words.insert(words.end(), {"keyup", "ctrl"});
        if (!words.empty())
            desktop_.xdotool(words);
        wait(0.1);
    }

    void key(const std::string& name) const
    {
        desktop_.xdotool({"key", name});
        wait(0.5);
    }

private:
    // Where the tip is when it has come to rest.
    dvec3 restingTip() const
    {
        dvec3 before = vec(sees().tip);
        for (int still = 0, i = 0; still < 4 && i < 100; ++i) {
            wait(0.15);
            const dvec3 now = vec(sees().tip);
            still = glm::distance(now, before) < 1e-6 ? still + 1 : 0;
            before = now;
        }
        return before;
    }

    // How the tip goes by `words`. A window that is busy is slow to answer.
    dvec3 tried(const std::vector<std::string>& words) const
    {
        const dvec3 before = restingTip();
        desktop_.xdotool(words);
        for (int i = 0; i < 100 && glm::distance(vec(sees().tip), before) < 1e-5; ++i)
            wait(0.1);
        return restingTip() - before;
    }

    const Desktop& desktop_;
    const channel::Subscriber& eyes_;
    dvec3 pixelRight_{0.0}, pixelDown_{0.0}, notch_{0.0}, left_{0.0};  // [m]
};

std::optional<channel::Subscriber> sessionWithHand(const std::string& name)
{
    for (int i = 0; i < 400; ++i) {
        auto session = channel::Subscriber::attach(name);
        // A session that begins anew leaves its first attempt's memory for a moment.
        if (session && session->state() && session->input() && session->ending() == channel::Ending::none)
            return session;
        wait(0.05);
    }
    return std::nullopt;
}

// Along the planned line until the target is so far ahead [m], or for so many moves.
void advance(User& user, dvec3 axis, double ahead)
{
    constexpr double stride = 2e-3;  // [m]
    for (int i = 0; i < 60 && user.sees().ahead[0] > ahead; ++i)
        user.move(stride * axis);
}

void withdraw(User& user, dvec3 axis)
{
    constexpr double stride = 4e-3;  // [m]
    for (int i = 0; i < 30 && user.sees().phase != channel::Phase::free; ++i)
        user.move(-stride * axis);
}

TEST(Desktop, MouseAndKeysCompleteABiopsyThatReplaysBitByBit)
{
    if (!installed("Xvfb") || !installed("xdotool"))
        GTEST_SKIP() << "needs Xvfb and xdotool (packages xvfb and xdotool)";
    if (!built("palpate-view"))
        GTEST_SKIP() << "palpate-view has not been built";
    const Folder folder;
    const std::string session = "desktop-" + std::to_string(::getpid());
    const Desktop desktop;
    const auto train =
        desktop.start("palpate", {"train", smallLayered(), "--device", "mouse", "--view", "--close-at-end", "--seconds",
                                  "120", "--session", session, "--record", folder / "s.db", "--json", folder / "s.json"});
    const std::string window = desktop.window("Palpate");
    const auto eyes = sessionWithHand(session);
    ASSERT_FALSE(window.empty());
    ASSERT_TRUE(eyes);
    const dvec3 entry = vec(eyes->scenery().entry), aim = vec(eyes->scenery().aim), axis = glm::normalize(aim - entry);

    User user(desktop, *eyes);
    user.takeTool(window);
    user.learn();
    const dvec3 off = vec(user.sees().tip) - entry;
    user.move(-(off - glm::dot(off, axis) * axis));
    // The notch lies 2 to 22 mm ahead of the tip.
    advance(user, axis, 6e-3);
    EXPECT_EQ(user.sees().phase, channel::Phase::inserted);
    user.key("F1");
    user.key("space");
    EXPECT_EQ(user.sees().cores, 0U) << "below the list of keys nobody sees what the gun would hit";
    user.key("F1");
    user.key("space");
    EXPECT_EQ(user.sees().cores, 1U);
    withdraw(user, axis);
    EXPECT_EQ(user.sees().phase, channel::Phase::free);
    user.key("e");
    const Outcome outcome = train->wait();
    ASSERT_EQ(outcome.status, 0) << outcome.err;

    const auto json = nlohmann::json::parse(readText(folder / "s.json"));
    ASSERT_EQ(json["core"].size(), 1U);
    EXPECT_GT(json["core"][0]["target_fraction"], 0.2);
    EXPECT_GE(json["punctures"], 1);
    EXPECT_GT(json["peak_force_n"]["total"], 0.3);
    EXPECT_EQ(json["device"], "mouse");
    const auto replayed = figures({"replay", folder / "s.db"});
    EXPECT_EQ(replayed["identical"], true);
    EXPECT_EQ(replayed["force_hash"], json["force_hash"]);
}

// Nobody could move the tool any more.
TEST(Desktop, ASessionEndsWithTheWindowThatIsItsHand)
{
    if (!built("palpate-view") || !installed("Xvfb") || !installed("xdotool"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Folder folder;
    const std::string session = "closed-" + std::to_string(::getpid());
    const Desktop desktop;
    const auto train = desktop.start("palpate", {"train", smallLayered(), "--device", "mouse", "--view", "--seconds", "600",
                                                 "--session", session, "--record", folder / "s.db"});
    const std::string window = desktop.window("Palpate");
    ASSERT_FALSE(window.empty());
    const auto eyes = sessionWithHand(session);
    ASSERT_TRUE(eyes);
    desktop.xdotool({"key", "space"});  // fires only while the dead-man switch is held
    wait(0.5);
    EXPECT_EQ(eyes->state()->cores, 0U);
    desktop.close(window);  // asks, as Q does
    wait(0.5);
    EXPECT_EQ(eyes->ending(), channel::Ending::none);
    desktop.xdotool({"key", "q"});
    const Outcome outcome = train->wait();
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(figures({"replay", folder / "s.db"})["identical"], true);
}

// S lets the tool go and makes the ticks stand still; Backspace begins anew, with a record of the second attempt alone.
TEST(Desktop, APauseIsNotInTheRecordAndANewBeginningLeavesNothingOfTheOldOne)
{
    if (!built("palpate-view") || !installed("Xvfb") || !installed("xdotool"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Folder folder;
    const std::filesystem::path pictures = folder / "s.ultrasound";
    std::filesystem::create_directory(pictures);
    writeText(pictures / "earlier.png", "of another session");
    const auto stored = [&] {
        return std::distance(std::filesystem::directory_iterator(pictures), std::filesystem::directory_iterator());
    };
    const std::string session = "paused-" + std::to_string(::getpid());
    const Desktop desktop;
    const auto train =
        desktop.start("palpate", {"train", smallLayered(), "--device", "mouse", "--view", "--close-at-end", "--seconds",
                                  "600", "--session", session, "--record", folder / "s.db", "--json", folder / "s.json"});
    ASSERT_FALSE(desktop.window("Palpate").empty());
    auto eyes = sessionWithHand(session);
    ASSERT_TRUE(eyes);
    const auto until = [&](const auto& holds, int looks = 200) {
        for (int i = 0; i < looks && !holds(); ++i)
            wait(0.05);
        return holds();
    };
    // A window that is not there yet misses a key.
    const auto pressUntil = [&](const char* key, const auto& holds) {
        for (int i = 0; i < 5 && !holds(); ++i) {
            desktop.xdotool({"key", key});
            until(holds);
        }
        return holds();
    };
    const auto paused = [&] { return eyes->state()->standing == channel::Standing::paused; };
    wait(1);
    desktop.xdotool({"key", "BackSpace"});
    wait(0.5);
    EXPECT_EQ(eyes->ending(), channel::Ending::none) << "only a session that is paused begins anew";
    ASSERT_TRUE(pressUntil("Return", [&] { return eyes->input() && eyes->input()->held != 0; }));
    const auto held = vec(eyes->input()->target);
    desktop.xdotool({"mousemove", "200", "300", "mousemove", "500", "400"});
    wait(1);
    EXPECT_LT(glm::distance(vec(eyes->input()->target), held), 1e-3) << "the mouse moves nothing that a key holds";
    ASSERT_TRUE(pressUntil("s", paused));
    const auto at = eyes->state()->tick;
    wait(1.0);
    EXPECT_EQ(eyes->state()->tick, at);
    EXPECT_EQ(glm::length(vec(eyes->state()->total)), 0.0);
    ASSERT_TRUE(pressUntil("s", [&] { return eyes->state()->tick > at; }));
    desktop.xdotool({"key", "u"});  // the ultrasound picture, which takes a moment to be there
    for (int i = 0; i < 60 && stored() == 1; ++i) {
        desktop.xdotool({"key", "p"});
        until([&] { return stored() > 1; }, 20);
    }
    ASSERT_GT(stored(), 1);
    ASSERT_TRUE(pressUntil("s", paused));
    ASSERT_TRUE(pressUntil("BackSpace", [&] { return eyes->ending() != channel::Ending::none; }));
    eyes = sessionWithHand(session);
    ASSERT_TRUE(eyes);
    EXPECT_FALSE(paused());
    EXPECT_EQ(stored(), 1) << "pictures of the first attempt are gone, and no others";
    EXPECT_TRUE(std::filesystem::exists(pictures / "earlier.png"));
    wait(1);
    ASSERT_TRUE(pressUntil("s", paused));
    const auto again = eyes->state()->tick;
    wait(1);
    ASSERT_TRUE(pressUntil("s", [&] { return eyes->state()->tick > again; }));
    ASSERT_TRUE(pressUntil("e", [&] { return eyes->ending() != channel::Ending::none; }));
    const Outcome outcome = train->wait();
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    const auto json = nlohmann::json::parse(readText(folder / "s.json"));
    EXPECT_EQ(json["pauses"]["count"], 1);
    EXPECT_GT(json["pauses"]["seconds"], 0.5);
    const auto replayed = figures({"replay", folder / "s.db"});
    EXPECT_EQ(replayed["identical"], true);
    EXPECT_EQ(replayed["force_hash"], json["force_hash"]);
}

// Told step by step, and over after its seconds: nothing is left of it.
TEST(Desktop, ATryoutEndsByItselfAndLeavesNothing)
{
    if (!built("palpate-view") || !installed("Xvfb") || !installed("xdotool"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and xdotool (packages xvfb and xdotool)";
    const Desktop desktop;
    const auto train = desktop.start("palpate", {"train", "--tryout", "--device", "mouse", "--seconds", "2"});
    EXPECT_FALSE(desktop.window("Palpate").empty());
    const Outcome outcome = train->wait();
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(outcome.out.find("points"), std::string::npos) << outcome.out;
    expectRefusal({"train", "--tryout"}, "a person must hold the tool");
    expectRefusal({"train", "--tryout", "--device", "mouse", "--record", "x.db"}, "--tryout");
}

TEST(Mouse, IsRefusedWhereNobodyCanMoveIt)
{
    expectRefusal({"train", "layered", "--device", "mouse", "--unpaced"}, "leave out --unpaced");
    expectRefusal({"train", "layered", "--device", "mouse", "--no-view"}, "needs a window");
    expectRefusal({"train", "layered", "--device", "mouse", "--trainee", "novice"}, "bring their own hand");
}

}  // namespace
}  // namespace palpate::apps
