#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <render/controls.h>

#include <vtkCommand.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::render {
namespace {

constexpr double turnStep = 2.0 / 180.0 * 3.14159265358979323846;  // of an arrow key [rad]
constexpr double depthStep = 1e-3;                                 // of a notch of the wheel [m]
constexpr double fineShare = 0.2;                                  // with Shift
constexpr double opacityStep = 1.25;

Controls& controlsOf(GLFWwindow* window)
{
    return *static_cast<Controls*>(glfwGetWindowUserPointer(window));
}

bool shiftIn(GLFWwindow* window)
{
    return glfwGetKey(window, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS || glfwGetKey(window, GLFW_KEY_RIGHT_SHIFT) == GLFW_PRESS;
}

// Where the cursor is in the frame buffer, which has more pixels than the window has points on high-density screens.
glm::dvec2 pixelAt(GLFWwindow* window, double x, double y)
{
    int width = 0, height = 0, wide = 1, high = 1;
    glfwGetFramebufferSize(window, &width, &height);
    glfwGetWindowSize(window, &wide, &high);
    return {x * width / std::max(wide, 1), height - 1 - y * height / std::max(high, 1)};
}

Point2 point(glm::dvec2 p)
{
    return {p.x, p.y};
}

SliceLook following(SliceLook look)
{
    return look == SliceLook::tinted ? SliceLook::image : look == SliceLook::image ? SliceLook::tissue : SliceLook::tinted;
}

// The picture's directions at a point [m]: to the right and up on the screen, and into it. Unit vectors.
struct Screen {
    glm::dvec3 right, up, into;
};

Screen screenAt(const Picture& picture, glm::dvec3 at)
{
    const glm::dvec3 origin = picture.under({0, 0}, at);
    const glm::dvec3 right = glm::normalize(picture.under({100, 0}, at) - origin),
                     up = glm::normalize(picture.under({0, 100}, at) - origin);
    return {right, up, glm::cross(up, right)};
}

}  // namespace

Controls::Controls(GLFWwindow* window, vtkGenericRenderWindowInteractor& interactor, Picture& picture,
                   const Follower& follower, Playback* playback)
    : window_(window), interactor_(interactor), picture_(picture), follower_(follower), playback_(playback)
{
    glfwSetWindowUserPointer(window, this);
    glfwSetMouseButtonCallback(
        window, [](GLFWwindow* w, int button, int action, int) { controlsOf(w).button(button, action == GLFW_PRESS); });
    glfwSetCursorPosCallback(window,
                             [](GLFWwindow* w, double x, double y) { controlsOf(w).moved(pixelAt(w, x, y), shiftIn(w)); });
    glfwSetScrollCallback(window, [](GLFWwindow* w, double, double y) { controlsOf(w).wheel(y, shiftIn(w)); });
    glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int scancode, int action, int mods) {
        const char* name = glfwGetKeyName(key, scancode);
        if (action != GLFW_RELEASE)
            controlsOf(w).key(key, name != nullptr ? name : "", action == GLFW_REPEAT, (mods & GLFW_MOD_SHIFT) != 0);
    });
    // Where it is on a keyboard differs too much for a key's name.
    glfwSetCharCallback(window, [](GLFWwindow* w, unsigned int character) {
        if (character == '?')
            controlsOf(w).showHelp();
    });
    glfwSetWindowFocusCallback(window, [](GLFWwindow* w, int focused) {
        if (focused == GLFW_FALSE)
            controlsOf(w).hand_.release();
    });
}

void Controls::keep()
{
    hand_.keep(follower_);
    picture_.setCaption(caption());
    picture_.setHand(hand_.is() && hand_.held() ? std::optional(hand_.target()) : std::nullopt);
    if (playback_ != nullptr)
        picture_.setTimeline(playback_->time / std::max<double>(playback_->length, 1e-3));
}

bool Controls::used() noexcept
{
    return std::exchange(used_, false);
}

void Controls::camera(unsigned long event)
{
    interactor_.InvokeEvent(event);
}

void Controls::button(int button, bool down)
{
    used_ = true;
    if (button == GLFW_MOUSE_BUTTON_MIDDLE)
        return camera(down ? vtkCommand::MiddleButtonPressEvent : vtkCommand::MiddleButtonReleaseEvent);
    if (button == GLFW_MOUSE_BUTTON_LEFT && hand_.is())
        return down ? hand_.press(follower_.state()) : hand_.release();
    if (button == GLFW_MOUSE_BUTTON_LEFT && playback_ != nullptr) {
        scrubbing_ = down;
        return scrub();
    }
    if (button == GLFW_MOUSE_BUTTON_LEFT || button == GLFW_MOUSE_BUTTON_RIGHT)
        camera(down ? vtkCommand::LeftButtonPressEvent : vtkCommand::LeftButtonReleaseEvent);
}

// The tool stays under the cursor.
void Controls::moved(glm::dvec2 to, bool fine)
{
    used_ = true;
    const glm::dvec2 from = std::exchange(cursor_, to);
    if (hand_.held()) {
        const glm::dvec3 at = hand_.target();
        const glm::dvec3 way = picture_.under(point(to), at) - picture_.under(point(from), at);
        hand_.move((fine ? fineShare : 1.0) * way);
    }
    if (scrubbing_)
        scrub();
    interactor_.SetEventInformation(static_cast<int>(to.x), static_cast<int>(to.y));
    camera(vtkCommand::MouseMoveEvent);
}

void Controls::wheel(double notches, bool fine)
{
    used_ = true;
    if (hand_.is())
        hand_.move((fine ? fineShare : 1.0) * notches * depthStep * screenAt(picture_, hand_.target()).into);
    else
        camera(notches > 0 ? vtkCommand::MouseWheelForwardEvent : vtkCommand::MouseWheelBackwardEvent);
}

void Controls::key(int key, const std::string& name, bool again, bool shift)
{
    used_ = true;
    if (key == GLFW_KEY_ESCAPE || name == "q")
        glfwSetWindowShouldClose(window_, GLFW_TRUE);
    else if (!pictureKey(key, name, shift) && playback_ != nullptr)
        playKey(key, name, shift);
    else if (hand_.is())
        handKey(key, name, again);
}

bool Controls::pictureKey(int key, const std::string& name, bool shift)
{
    if (key == GLFW_KEY_F1 || name == "h")
        showHelp();
    else if (name == "l")
        picture_.show(picture_.layout() == Layout::trainee ? Layout::instructor : Layout::trainee);
    else if (name == "r")
        picture_.resetView();
    else if (name == "c")
        picture_.setCut(!picture_.cut());
    else if (name == "i" && picture_.hasImage())
        picture_.show(following(picture_.sliceLook()));
    else if (name == "w" && picture_.hasImage())
        picture_.nextWindow();
    else if (key == GLFW_KEY_TAB)
        picture_.selectTissue(shift ? -1 : 1);
    else if (key == GLFW_KEY_PAGE_UP || key == GLFW_KEY_PAGE_DOWN)
        picture_.changeOpacity(key == GLFW_KEY_PAGE_UP ? opacityStep : 1 / opacityStep);
    else if (name == "+" || name == "=" || key == GLFW_KEY_KP_ADD)
        camera(vtkCommand::MouseWheelForwardEvent);
    else if (name == "-" || key == GLFW_KEY_KP_SUBTRACT)
        camera(vtkCommand::MouseWheelBackwardEvent);
    else
        return false;
    return true;
}

void Controls::handKey(int key, const std::string& name, bool again)
{
    const Screen screen = screenAt(picture_, hand_.target());
    if (key == GLFW_KEY_LEFT || key == GLFW_KEY_RIGHT)
        hand_.turn(screen.into, key == GLFW_KEY_RIGHT ? turnStep : -turnStep);
    else if (key == GLFW_KEY_UP || key == GLFW_KEY_DOWN)
        hand_.turn(screen.right, key == GLFW_KEY_UP ? turnStep : -turnStep);
    else if (key == GLFW_KEY_SPACE && !again)
        hand_.fire();
    else if (name == "m" && !again)
        hand_.mark();
    else if (name == "e" && !again)
        hand_.end();
}

void Controls::playKey(int key, const std::string& name, bool shift)
{
    Playback& p = *playback_;
    // A second step may come before the player has taken the first.
    const double asked = p.jump, now = std::isnan(asked) ? p.time.load() : asked;
    const auto jump = [&p](double to) { p.jump = std::clamp<double>(to, 0, p.length); };
    constexpr double tick = 1e-3, frame = 1.0 / 30, leap = 1.0;  // [s]
    if (key == GLFW_KEY_SPACE)
        p.paused = !p.paused;
    else if (name == "." || name == ",") {
        p.paused = true;
        jump(now + (name == "." ? 1 : -1) * (shift ? frame : tick));
    } else if (key == GLFW_KEY_RIGHT || key == GLFW_KEY_LEFT)
        jump(now + (key == GLFW_KEY_RIGHT ? leap : -leap));
    else if (key == GLFW_KEY_UP || key == GLFW_KEY_DOWN)
        p.speed = std::clamp(p.speed * (key == GLFW_KEY_UP ? 2.0 : 0.5), 1.0 / 64, 8.0);
    else if (key == GLFW_KEY_HOME || key == GLFW_KEY_END)
        jump(key == GLFW_KEY_HOME ? 0.0 : p.length.load());
}

void Controls::scrub()
{
    if (!scrubbing_)
        return;
    int width = 1, height = 1;
    glfwGetFramebufferSize(window_, &width, &height);
    playback_->jump = std::clamp(cursor_.x / std::max(width, 1), 0.0, 1.0) * playback_->length;
}

void Controls::showHelp()
{
    used_ = true;
    helping_ = !helping_;
    picture_.setHelp(helping_ ? help() : std::vector<KeyHelp>());
}

std::vector<KeyHelp> Controls::help() const
{
    std::vector<KeyHelp> keys;
    if (hand_.is())
        keys = {{"hold left", "take the tool and move it in the plane of the picture"},
                {"  wheel", "push it into the picture, or pull it out"},
                {"  Shift", "five times finer"},
                {"  arrows", "turn the tool"},
                {"  Space", "fire the biopsy gun"},
                {"M", "mark the place of the tool"},
                {"E", "end the session"}};
    else if (playback_ != nullptr)
        keys = {{"Space", "pause, play"},
                {". ,", "one tick on, back; with Shift a frame"},
                {"right left", "a second on, back"},
                {"up down", "twice as fast, half as fast"},
                {"Home End", "to the beginning, the end"},
                {"hold left", "drag through the time"}};
    std::vector<KeyHelp> all{{hand_.is() || playback_ != nullptr ? "hold right" : "hold left", "turn the camera"},
                             {"hold middle", "shift the camera"},
                             {hand_.is() ? "+ -" : "wheel, + -", "nearer, further"},
                             {"R", "camera and opacities as at first"},
                             {"L", "layout: trainee, instructor"},
                             {"C", "cut towards the tool, whole body"},
                             {"Tab", "choose a tissue"},
                             {"Page up, down", "the tissue's opacity"},
                             {"? H F1", "these keys"},
                             {"Q Esc", "close the window"}};
    if (picture_.hasImage())
        all.insert(all.begin() + 6, {{"I", "slices: image and tissues, image, tissues"}, {"W", "the image's grey window"}});
    keys.insert(keys.end(), all.begin(), all.end());
    return keys;
}

std::string Controls::caption() const
{
    if (playback_ != nullptr) {
        const Playback& p = *playback_;
        const std::string how = p.paused ? "PAUSED" : fmt::format("REPLAY x {:g}", p.speed.load());
        const bool computing = p.ready < p.length;
        const char* fault = p.fault;
        return fmt::format("{}   {:.3f} of {:.1f} s{}{}", how, p.time.load(), p.length.load(),
                           computing ? fmt::format("   ({:.1f} s computed)", p.ready.load()) : "",
                           fault != nullptr ? fmt::format("   {}", fault) : "");
    }
    if (!hand_.is())
        return "";
    if (!hand_.held())
        return "hold the left button to take the tool   (? lists the keys)";
    const double lag = glm::distance(hand_.target(), vec(follower_.state().tip));
    return fmt::format("holding   hand ahead of the tip by {:.1f} mm", 1e3 * lag);
}

}  // namespace palpate::render
