#include <base/inputs.h>
#include <channel/channel.h>
#include <render/deformation.h>
#include <render/screen_plan.h>
#include <render/view_frame.h>
#include <tests/installed.h>
#include <tests/render/body.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGReader.h>
#include <vtkSmartPointer.h>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>
#include <cstdlib>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace palpate::render {
namespace {

namespace fs = std::filesystem;
constexpr int viewWidth = 800, viewHeight = 600;

// A process of ours: killed at the latest when it goes out of scope.
class Process {
public:
    Process(const std::vector<std::string>& command, const fs::path& output, bool emptyPath = false)
    {
        id_ = ::fork();
        if (id_ != 0)
            return;
        const int file = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        ::dup2(file, STDOUT_FILENO);
        ::dup2(file, STDERR_FILENO);
        ::unsetenv("DISPLAY");
        if (emptyPath)
            ::setenv("PATH", "/nowhere", 1);
        std::vector<char*> words;
        for (const std::string& word : command)
            words.push_back(const_cast<char*>(word.c_str()));
        words.push_back(nullptr);
        ::execvp(words[0], words.data());
        ::_exit(127);
    }
    Process(const Process&) = delete;
    Process& operator=(const Process&) = delete;
    ~Process() { end(SIGKILL); }

    void end(int signal)
    {
        if (id_ > 0)
            ::kill(id_, signal);
        wait();
    }
    // Exit status, or 1000 + signal. One that hangs is killed.
    int wait()
    {
        constexpr int patience = 12000;  // [10 ms]
        if (id_ > 0) {
            int status = 0;
            for (int i = 0; i < patience && ::waitpid(id_, &status, WNOHANG) == 0; ++i)
                if (std::this_thread::sleep_for(std::chrono::milliseconds(10)); i + 1 == patience) {
                    ::kill(id_, SIGKILL);
                    ::waitpid(id_, &status, 0);
                }
            id_ = 0;
            result_ = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
        }
        return result_;
    }

private:
    pid_t id_ = 0;
    int result_ = -1;
};

class Viewer : public testing::Test {
protected:
    void SetUp() override
    {
        const std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
        session_ = "view-" + std::to_string(::getpid());
        folder_ = fs::temp_directory_path() / ("palpate-" + name + "-" + std::to_string(::getpid()));
        fs::create_directories(folder_);
        if (!fs::exists(program()))
            GTEST_SKIP() << program() << " has not been built";
        if (!tests::installed("Xvfb") || !tests::installed("xvfb-run"))
            GTEST_SKIP() << "needs Xvfb (package xvfb)";
    }
    void TearDown() override
    {
        // An X server that ends takes its screen's file away at the same time.
        std::error_code gone;
        for (int i = 0; i < 100 && (fs::remove_all(folder_, gone), fs::exists(folder_)); ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        fs::remove("/dev/shm/palpate-" + session_);  // of publishers that were killed
    }

    static std::string program() { return std::string(PALPATE_BIN_DIR) + "/palpate-view"; }
    std::vector<std::string> publish(const std::string& mode, const std::string& argument = {}) const
    {
        return {PUBLISH_BODY, session_, mode, argument};
    }
    // In full detail.
    std::vector<std::string> hold(const std::string& moment) const
    {
        return {PUBLISH_BODY, session_, "hold", moment, "104"};
    }
    // On a display of its own, which `server` describes. Each has another number: xvfb-run trips over a display that is
    // just going.
    std::vector<std::string> window(const std::string& server, const std::vector<std::string>& more) const
    {
        static int number = 99;
        std::vector<std::string> command{
            "xvfb-run", "-a",        "-n",    std::to_string(number += 10), "-s", "-noreset " + server,
            program(),  "--session", session_};
        command.insert(command.end(), more.begin(), more.end());
        return command;
    }
    std::vector<std::string> view(const std::vector<std::string>& more) const
    {
        std::vector<std::string> command{program(), "--session", session_, "--offscreen", pictures(), "--size", "800x600"};
        command.insert(command.end(), more.begin(), more.end());
        return command;
    }
    std::string pictures() const { return folder_ / "pictures"; }
    fs::path log(const std::string& name) const { return folder_ / name; }
    std::string said(const std::string& name) const { return base::contentOf(log(name)).value_or(""); }
    bool waitFor(const std::string& picture) const
    {
        for (int i = 0; i < 600; ++i) {
            if (fs::exists(fs::path(pictures()) / picture))
                return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(50));
        }
        return false;
    }
    // The second picture of a body that stays at one moment of the story.
    vtkSmartPointer<vtkImageData> pictureAt(const std::string& moment)
    {
        fs::remove_all(pictures());
        Process publisher(hold(moment), log("publisher"));
        Process viewer(view({"--frames", "2", "--every", "0.05"}), log("viewer"));
        EXPECT_EQ(viewer.wait(), 0) << said("viewer");
        vtkNew<vtkPNGReader> reader;
        reader->SetFileName((fs::path(pictures()) / "frame_00001.png").c_str());
        reader->Update();
        return reader->GetOutput();
    }

    std::string session_;
    fs::path folder_;
};

using Pixel = std::array<int, 3>;

Pixel pixelAt(vtkImageData& image, int x, int y)
{
    const auto* p = static_cast<const unsigned char*>(image.GetScalarPointer(x, y, 0));
    return {p[0], p[1], p[2]};
}

bool nearTo(const Pixel& a, const Pixel& b, int tolerance)
{
    return std::abs(a[0] - b[0]) <= tolerance && std::abs(a[1] - b[1]) <= tolerance && std::abs(a[2] - b[2]) <= tolerance;
}

// Where the slice shows the point `p` [m] of its plane.
Pixel onSlice(vtkImageData& image, const channel::Scenery& scenery, glm::dvec3 p)
{
    const Area area = ScreenPlan(viewWidth, viewHeight).slices[0];
    const ViewFrame frame = viewFrame(scenery);
    const glm::dvec3 d = (p - frame.centre) * (std::min(area.width, area.height) / frame.extent);
    return pixelAt(image, area.x + area.width / 2 + static_cast<int>(std::lround(glm::dot(d, frame.right))),
                   area.y + area.height / 2 + static_cast<int>(std::lround(glm::dot(d, frame.up))));
}

int countNear(vtkImageData& image, const Area& area, const Pixel& colour, int tolerance)
{
    int count = 0;
    for (int y = area.y; y < area.y + area.height; ++y)
        for (int x = area.x; x < area.x + area.width; ++x)
            count += nearTo(pixelAt(image, x, y), colour, tolerance);
    return count;
}

// The image rises along x: grey is 255 times the fraction of the way through the grid.
TEST_F(Viewer, ShowsTheImageInItsSlices)
{
    channel::Scenery scenery = bodyScenery();
    const auto image = bodyImage(scenery);
    channel::Publisher publisher(session_, scenery, bodyLabels(scenery), image);
    publisher.setState(storyState(scenery, 0.05));
    Process viewer(view({"--frames", "1", "--slices", "image"}), log("viewer"));
    ASSERT_EQ(viewer.wait(), 0) << said("viewer");
    vtkNew<vtkPNGReader> reader;
    reader->SetFileName((fs::path(pictures()) / "frame_00000.png").c_str());
    reader->Update();
    const channel::Grid& grid = scenery.labels;
    for (const double x : {-30e-3, -12e-3, 10e-3, 25e-3}) {
        const int grey = static_cast<int>(255 * (x - grid.origin[0]) / ((grid.size[0] - 1) * grid.spacing));
        EXPECT_TRUE(nearTo(onSlice(*reader->GetOutput(), scenery, {x, 15e-3, 0}), {grey, grey, grey}, 3)) << x;
    }
}

TEST_F(Viewer, ShowsTheDimpleAndTheNeedleWhereTheyAre)
{
    const auto before = pictureAt("0.05"), after = pictureAt("1.99");
    ASSERT_EQ(before->GetDimensions()[0], viewWidth);
    ASSERT_EQ(after->GetDimensions()[1], viewHeight);
    const channel::Scenery scenery = bodyScenery();
    const glm::dvec3 entry = vec(scenery.entry), axis = glm::normalize(vec(scenery.aim) - entry);
    const ViewFrame frame = viewFrame(scenery);
    const glm::dvec3 aside = glm::cross(axis, frame.towards);
    constexpr Pixel fat{242, 217, 128}, air{12, 13, 18}, needle{64, 217, 255};

    const glm::dvec3 inDimple = entry + 4.5e-3 * axis + 3e-3 * aside;
    EXPECT_TRUE(nearTo(onSlice(*before, scenery, inDimple), fat, 3));
    EXPECT_TRUE(nearTo(onSlice(*after, scenery, inDimple), air, 3));
    const glm::dvec3 farAway = entry + 20e-3 * axis - 25e-3 * aside;
    EXPECT_EQ(onSlice(*before, scenery, farAway), onSlice(*after, scenery, farAway));

    // Pressed 9 mm deep the shaft is 5 mm inside the rest surface; before that the tip was 23 mm off.
    EXPECT_TRUE(nearTo(onSlice(*after, scenery, entry + 3e-3 * axis), needle, 3));
    EXPECT_FALSE(nearTo(onSlice(*before, scenery, entry + 3e-3 * axis), needle, 60));
    const Area view = ScreenPlan(viewWidth, viewHeight).view;
    const int shown = countNear(*before, view, {70, 235, 255}, 60), longer = countNear(*after, view, {70, 235, 255}, 60);
    EXPECT_GT(shown, 50);
    EXPECT_GT(longer, shown + 200);
}

TEST_F(Viewer, WritesAPictureOfEveryEventAndEndsWithTheSession)
{
    Process publisher(publish("play", pictures() + "/frame_00000.png"), log("publisher"));
    Process viewer(view({"--every", "0.5"}), log("viewer"));
    ASSERT_EQ(viewer.wait(), 0) << said("viewer");
    EXPECT_EQ(publisher.wait(), 0) << said("publisher");
    for (const char* name : {"frame_00000.png", "frame_00002.png", "000_contact.png", "001_inserted.png",
                             "002_near_artery.png", "003_fired.png", "004_finished.png"})
        EXPECT_TRUE(fs::exists(fs::path(pictures()) / name)) << name;
}

TEST_F(Viewer, KilledLeavesTheSimulationUntouched)
{
    Process publisher(publish("hold", "1.5"), log("publisher"));
    Process viewer(view({"--every", "0.05"}), log("viewer"));
    ASSERT_TRUE(waitFor("frame_00001.png")) << said("viewer");
    const auto subscriber = channel::Subscriber::attach(session_);
    ASSERT_TRUE(subscriber);
    viewer.end(SIGKILL);
    const std::uint64_t tick = subscriber->state()->tick;
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    EXPECT_TRUE(subscriber->alive());
    EXPECT_GT(subscriber->state()->tick, tick + 50);
}

TEST_F(Viewer, SaysThatTheSimulationWasKilled)
{
    Process publisher(publish("hold", "1.5"), log("publisher"));
    Process viewer(view({"--every", "0.05", "--wait", "1"}), log("viewer"));
    ASSERT_TRUE(waitFor("frame_00001.png")) << said("viewer");
    publisher.end(SIGKILL);
    EXPECT_EQ(viewer.wait(), 1);
    EXPECT_NE(said("viewer").find("session " + session_ + " stopped without ending (process "), std::string::npos);
}

TEST_F(Viewer, ShowsASessionThatHasBeenStartedAgain)
{
    auto first = std::make_unique<Process>(publish("hold", "0.05"), log("first"));
    Process viewer(view({"--every", "0.5", "--wait", "20"}), log("viewer"));
    ASSERT_TRUE(waitFor("frame_00001.png")) << said("viewer");
    first->end(SIGKILL);
    Process second(publish("play"), log("second"));
    EXPECT_EQ(viewer.wait(), 0) << said("viewer");
    int finished = 0;
    for (const auto& entry : fs::directory_iterator(pictures()))
        finished += entry.path().string().ends_with("_finished.png");
    EXPECT_EQ(finished, 1);
}

TEST_F(Viewer, EndsCleanlyWhenInterrupted)
{
    for (const int signal : {SIGINT, SIGTERM}) {
        Process publisher(publish("hold", "1.5"), log("publisher"));
        Process viewer(view({"--every", "0.05"}), log("viewer"));
        ASSERT_TRUE(waitFor("frame_00001.png")) << said("viewer");
        viewer.end(signal);
        EXPECT_EQ(viewer.wait(), 0) << said("viewer");
        fs::remove_all(pictures());
    }
}

// How many pixels of a screen have a colour: Xvfb keeps its frame buffer in a file (X11/XWDFile.h, big endian, BGRX).
int countOnScreen(const fs::path& file, const Pixel& colour)
{
    const std::string bytes = base::contentOf(file).value_or("");
    const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(bytes[at]); };
    const auto word = [&](std::size_t n) {
        return static_cast<std::size_t>(byte(4 * n) << 24U | byte(4 * n + 1) << 16U | byte(4 * n + 2) << 8U |
                                        byte(4 * n + 3));
    };
    constexpr std::size_t headerWords = 25, colourBytes = 12;
    if (bytes.size() < 4 * headerWords)
        return 0;
    int count = 0;
    for (std::size_t at = word(0) + word(19) * colourBytes; at + 3 < bytes.size(); at += 4)
        count += nearTo({byte(at + 2), byte(at + 1), byte(at)}, colour, 2);
    return count;
}

TEST_F(Viewer, DrawsFiguresAndSliceInAWindowToo)
{
    Process publisher(publish("hold", "1.9"), log("publisher"));
    Process viewer(window("-screen 0 800x600x24 -fbdir " + folder_.string(), {"--size", "800x600", "--wait", "1"}),
                   log("viewer"));
    constexpr Pixel bar{89, 166, 255}, onSlice{64, 217, 255};
    int bars = 0, needle = 0;
    for (int i = 0; i < 300 && (bars < 300 || needle < 300); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        if (said("viewer").find("no display") != std::string::npos) {
            FAIL() << "xvfb-run gave the viewer no display";
        }
        bars = countOnScreen(folder_ / "Xvfb_screen0", bar);
        needle = countOnScreen(folder_ / "Xvfb_screen0", onSlice);
    }
    EXPECT_GE(bars, 300) << "4.2 N of 8.5 N is half a bar";
    EXPECT_GE(needle, 300);
    publisher.end(SIGKILL);
    // xvfb-run's own status may be about its cleaning up (5): the viewer's line tells.
    viewer.wait();
    EXPECT_NE(said("viewer").find("stopped without ending"), std::string::npos) << said("viewer");
}

// Of the screen's left half, where the body is: pixels that are not the background; 0 before there is a picture.
int bodyOnScreen(const fs::path& file)
{
    constexpr Pixel background{15, 18, 26};
    const ScreenPlan plan(viewWidth, viewHeight);
    const int empty = countOnScreen(file, background);
    return empty == 0 ? 0 : viewWidth * viewHeight - empty - (viewWidth - plan.view.width) * viewHeight;
}

// From the first picture on, through the change from coarse pictures to the fine one 1.2 s after all motion: only on a
// screen, where VTK's buffers are made anew in the midst of a picture, was the body missing from what came out.
TEST_F(Viewer, TheBodyStaysOnTheScreenWhenMotionStops)
{
    Process publisher(hold("1.9"), log("publisher"));
    Process viewer(
        window("-screen 0 800x600x24 -fbdir " + folder_.string(), {"--size", "800x600", "--wait", "1", "--no-steps"}),
        log("viewer"));
    const fs::path screen = folder_ / "Xvfb_screen0";
    constexpr int some = viewWidth * viewHeight / 10;
    for (int i = 0; i < 600 && bodyOnScreen(screen) < some; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    const int whole = bodyOnScreen(screen);
    ASSERT_GE(whole, some) << said("viewer");
    int least = whole;
    const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(3500);
    while (std::chrono::steady_clock::now() < end) {
        least = std::min(least, bodyOnScreen(screen));
        std::this_thread::sleep_for(std::chrono::milliseconds(15));
    }
    EXPECT_GT(least, whole * 4 / 5);
    publisher.end(SIGKILL);
    viewer.wait();
}

TEST_F(Viewer, OpensAWindowWhereThereIsADisplay)
{
    Process publisher(publish("hold", "1.5"), log("publisher"));
    Process viewer(window("-screen 0 1280x1024x24", {"--size", "640x480", "--frames", "5", "--json", "-"}), log("viewer"));
    viewer.wait();
    EXPECT_NE(said("viewer").find("\"frames\": 5"), std::string::npos) << said("viewer");
}

// An instructor looks at a session in which the mouse is the hand before the trainee's window is there, or while that is
// opened again.
TEST_F(Viewer, ThatOnlyWatchesLeavesTheHand)
{
    channel::Scenery scenery = render::bodyScenery(52, 2e-3);
    scenery.viewersHand = channel::handIsViewers;
    channel::Publisher publisher(session_, scenery, render::bodyLabels(scenery));
    publisher.setState(render::storyState(scenery, 1.5));
    const auto subscriber = channel::Subscriber::attach(session_);
    ASSERT_TRUE(subscriber);
    const auto takesTheHand = [&](const std::vector<std::string>& more, const std::string& name) {
        std::vector<std::string> options{"--size", "400x400", "--frames", "6", "--json", folder_ / (name + ".json")};
        options.insert(options.end(), more.begin(), more.end());
        Process viewer(window("-screen 0 800x600x24", options), log(name));
        bool taken = false;
        channel::State state = render::storyState(scenery, 1.5);
        for (int i = 0; i < 1500 && !fs::exists(folder_ / (name + ".json")); ++i) {
            state.time = 0.02 * static_cast<double>(++state.tick);
            publisher.setState(state);
            taken = taken || !channel::ViewersHand::take(*subscriber);
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
        viewer.wait();
        EXPECT_TRUE(fs::exists(folder_ / (name + ".json"))) << said(name);
        return taken;
    };
    EXPECT_TRUE(takesTheHand({}, "hand"));
    EXPECT_FALSE(takesTheHand({"--watch"}, "watcher"));
}

// A server may be asked to end before it listens (a test with Debian's Xvfb waited 600 s for it, which is a timer of it).
TEST_F(Viewer, EndsThoughItsServerDoesNot)
{
    const fs::path server = folder_ / "Xvfb";
    std::ofstream(server) << "#!/bin/sh\ntrap '' TERM\necho 77 >&$2\nwhile :; do sleep 0.1; done\n";
    fs::permissions(server, fs::perms::owner_all);
    std::vector<std::string> command = view({"--wait", "0.3"});
    command.insert(command.begin(), {"env", "PATH=" + folder_.string() + ":" + std::getenv("PATH")});
    Process viewer(command, log("viewer"));
    EXPECT_EQ(viewer.wait(), 1);
    EXPECT_EQ(said("viewer").rfind("palpate-view: ", 0), 0U) << said("viewer");
}

TEST_F(Viewer, TellsInOneLineWhatIsMissing)
{
    const auto expectError = [&](const std::vector<std::string>& command, const std::string& words, bool emptyPath = false,
                                 int status = 1) {
        Process viewer(command, log("viewer"), emptyPath);
        EXPECT_EQ(viewer.wait(), status) << words;
        const std::string text = said("viewer");
        EXPECT_EQ(text.rfind("palpate-view: ", 0), 0U) << text;
        EXPECT_NE(text.find(words), std::string::npos) << text;
        EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    };
    expectError(view({"--wait", "0.3"}), "no session " + session_);
    expectError({program(), "--session", "a/b", "--offscreen", pictures()}, "a name is");
    expectError({program(), "--session", session_}, "no display");
    expectError(view({"--wait", "0.3"}), "install the package xvfb", true);
    expectError(view({"--every", "-1"}), "--every: Value -1 not in range", false, 2);
    expectError({program(), "--size", "12"}, "WIDTHxHEIGHT");
    EXPECT_FALSE(fs::exists(pictures())) << "a folder without a picture is left";
    fs::remove_all(pictures());
    std::ofstream(pictures()) << "a file";
    expectError(view({"--wait", "0.3"}), "cannot be made: ");
    expectError({program(), "--session", session_, "--movie", pictures() + "/film.mp4"}, "there is no folder");
}

}  // namespace
}  // namespace palpate::render
