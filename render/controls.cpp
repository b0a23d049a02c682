#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <base/said.h>
#include <render/controls.h>

#include <vtkCommand.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::render {
namespace {

using base::said;
using base::tr;

constexpr double depthStep = 1e-3;                 // of a notch of the wheel, or a key [m]
constexpr double fineShare = 0.2;                  // with Shift
constexpr auto toThink = std::chrono::seconds(5);  // whether the session is to end
constexpr double pressStep = 0.5e-3;               // of the probe into the body, by a notch of the wheel [m]

Controls& controlsOf(GLFWwindow* window)
{
    return *static_cast<Controls*>(glfwGetWindowUserPointer(window));
}

bool shiftIn(GLFWwindow* window)
{
    return glfwGetKey(window, GLFW_KEY_LEFT_SHIFT) == GLFW_PRESS || glfwGetKey(window, GLFW_KEY_RIGHT_SHIFT) == GLFW_PRESS;
}

bool controlIn(GLFWwindow* window)
{
    return glfwGetKey(window, GLFW_KEY_LEFT_CONTROL) == GLFW_PRESS ||
           glfwGetKey(window, GLFW_KEY_RIGHT_CONTROL) == GLFW_PRESS;
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

// The index finger of a left hand lies on the right button.
int forHand(int button, bool leftHanded)
{
    const bool swaps = leftHanded && (button == GLFW_MOUSE_BUTTON_LEFT || button == GLFW_MOUSE_BUTTON_RIGHT);
    return swaps ? GLFW_MOUSE_BUTTON_LEFT + GLFW_MOUSE_BUTTON_RIGHT - button : button;
}

// The probe slides and sweeps with the cursor; `turned`: rocks and turns.
ultrasound::ProbeMove probeMove(glm::dvec2 pixels, bool turned)
{
    constexpr double metres = 0.1e-3, radians = 0.3 / 180.0 * 3.14159265358979323846;  // a pixel
    if (turned)
        return {.rock = radians * pixels.x, .turn = radians * pixels.y};
    return {.slide = -metres * pixels.x, .sweep = metres * pixels.y};
}

}  // namespace

Controls::Controls(GLFWwindow* window, vtkGenericRenderWindowInteractor& interactor, Picture& picture,
                   const Follower& follower, const ViewerOptions& options)
    : window_(window),
      interactor_(interactor),
      picture_(picture),
      follower_(follower),
      playback_(options.playback),
      images_(options.images),
      steps_(options.steps),
      leftHanded_(options.leftHanded),
      watches_(options.watches)
{
    if (options.tryout > 0)
        tryout_.emplace(options.tryout);
    glfwSetWindowUserPointer(window, this);
    glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int) {
        controlsOf(w).button(forHand(button, controlsOf(w).leftHanded_), action == GLFW_PRESS);
    });
    glfwSetCursorPosCallback(window,
                             [](GLFWwindow* w, double x, double y) { controlsOf(w).moved(pixelAt(w, x, y), shiftIn(w)); });
    glfwSetScrollCallback(window,
                          [](GLFWwindow* w, double, double y) { controlsOf(w).wheel(y, shiftIn(w), controlIn(w)); });
    glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int scancode, int action, int mods) {
        const char* name = glfwGetKeyName(key, scancode);
        if (action != GLFW_RELEASE)
            controlsOf(w).key(key, name != nullptr ? name : "", action == GLFW_REPEAT, mods);
    });
    // Where it is on a keyboard differs too much for a key's name.
    glfwSetCharCallback(window, [](GLFWwindow* w, unsigned int character) {
        if (character == '?')
            controlsOf(w).showHelp();
    });
    // Whoever closes the window is asked as by the key.
    glfwSetWindowCloseCallback(window, [](GLFWwindow* w) {
        glfwSetWindowShouldClose(w, GLFW_FALSE);
        controlsOf(w).close();
    });
    glfwSetWindowFocusCallback(window, [](GLFWwindow* w, int focused) {
        if (focused == GLFW_FALSE)
            controlsOf(w).hand_.release();
    });
}

void Controls::keep()
{
    if (const auto moved = spaceMouse_.moved(); moved != ultrasound::ProbeMove{})
        moveProbe(moved);
    if (!watches_)
        hand_.keep(follower_);
    picture_.setSteps(steps_, hand_.commands());
    if (tryout_ && follower_.known() && follower_.session() != nullptr)
        picture_.setCoaching(tryout_->see(follower_.session()->scenery(), follower_.state(), hand_.held()));
    picture_.setCaption(caption());
    picture_.setHand(hand_.is() && hand_.held() ? std::optional(hand_.target()) : std::nullopt);
    if (playback_ != nullptr)
        picture_.setTimeline(playback_->time / std::max<double>(playback_->length, 1e-3));
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
    if (!down && (measuring_ || probing_)) {
        if (measuring_)
            picture_.ultrasound().endCaliper();
        measuring_ = probing_ = false;
        return;  // it was not for the tool, which keys may hold
    }
    if (down && onUltrasound()) {
        measuring_ = button == GLFW_MOUSE_BUTTON_LEFT && measures();
        probing_ = button == GLFW_MOUSE_BUTTON_RIGHT;
        if (measuring_)
            picture_.ultrasound().beginCaliper(point(cursor_));
        if (measuring_ || probing_)
            return;
    }
    if (button == GLFW_MOUSE_BUTTON_RIGHT && down && hand_.held())
        return fire();
    if (button == GLFW_MOUSE_BUTTON_LEFT && down && hand_.commands() && picture_.endsAt(point(cursor_)))
        return hand_.end();
    if (button == GLFW_MOUSE_BUTTON_LEFT && hand_.is()) {
        byKey_ = false;
        return down ? hand_.press(follower_.state()) : hand_.release();
    }
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
    if (hand_.held() && !byKey_ && !measuring_ && !probing_) {
        const glm::dvec3 at = hand_.target();
        const glm::dvec3 way = picture_.under(point(to), at) - picture_.under(point(from), at);
        hand_.move((fine ? fineShare : 1.0) * way);
    }
    if (measuring_)
        picture_.ultrasound().dragCaliper(point(to));
    if (probing_)
        moveProbe(probeMove(to - from, fine));
    if (scrubbing_)
        scrub();
    interactor_.SetEventInformation(static_cast<int>(to.x), static_cast<int>(to.y));
    camera(vtkCommand::MouseMoveEvent);
}

// Of a scene that holds the probe the session has its pose; else this viewer puts it on the skin.
void Controls::moveProbe(const ultrasound::ProbeMove& by)
{
    if (!sceneHoldsProbe())
        picture_.ultrasound().moveProbe(by);
    else if (hand_.commands())
        hand_.moveProbe(by);
}

bool Controls::sceneHoldsProbe() const
{
    return follower_.session() != nullptr && follower_.session()->scenery().probe != channel::ProbeKind::none;
}

void Controls::storePicture()
{
    if (!hand_.paused() && picture_.ultrasound().store(images_))
        hand_.storePicture();
}

// By the keyboard: what the button of the index finger does while it is held.
void Controls::toggleHold()
{
    if (hand_.held())
        hand_.release();
    else if (hand_.is())
        hand_.press(follower_.state());
    byKey_ = hand_.held();
}

// Below the list of keys nobody sees what the gun would hit.
void Controls::fire()
{
    if (!helping_)
        hand_.fire();
}

void Controls::step(glm::dvec3 direction, double steps, bool fine)
{
    hand_.move(steps * (fine ? fineShare : 1.0) * depthStep * direction);
}

void Controls::wheel(double notches, bool fine, bool intoPicture)
{
    used_ = true;
    if (onUltrasound() && fine)
        moveProbe({.press = notches * pressStep});
    else if (onUltrasound() && !hand_.held())
        picture_.ultrasound().turn(Knob::depth, notches > 0 ? -1 : 1);
    else if (hand_.is())
        step(intoPicture ? screen().into : hand_.axis(), notches, fine);
    else
        camera(notches > 0 ? vtkCommand::MouseWheelForwardEvent : vtkCommand::MouseWheelBackwardEvent);
}

Controls::Screen Controls::screen() const
{
    const glm::dvec3 at = hand_.target(), origin = picture_.under({0, 0}, at);
    const glm::dvec3 right = glm::normalize(picture_.under({100, 0}, at) - origin),
                     up = glm::normalize(picture_.under({0, 100}, at) - origin);
    return {right, up, glm::cross(up, right)};
}

bool Controls::onUltrasound() const
{
    return picture_.ultrasoundShown() && picture_.ultrasound().holds(point(cursor_));
}

void Controls::scrub()
{
    if (!scrubbing_)
        return;
    playback_->jump = picture_.timeAt(point(cursor_)) * playback_->length;
}

void Controls::showHelp()
{
    used_ = true;
    helping_ = !helping_;
    picture_.setHelp(helping_ ? help() : std::vector<KeyHelp>());
}

bool Controls::asksToClose() const
{
    return closing_ && Clock::now() - *closing_ < toThink;
}

// The window that commands a session ends it as it goes, and the key is "back" elsewhere: it asks.
void Controls::close()
{
    used_ = true;
    const bool ends = hand_.commands() && !tryout_ && follower_.state().status == channel::Status::running;
    if (ends && !asksToClose()) {
        closing_ = Clock::now();
        return;
    }
    if (ends) {
        hand_.end();
        hand_.keep(follower_);
    }
    glfwSetWindowShouldClose(window_, GLFW_TRUE);
}

std::string Controls::caption() const
{
    if (asksToClose())
        return tr("Q, Esc or closing the window once more ends the session");
    if (playback_ != nullptr) {
        const Playback& p = *playback_;
        const std::string how = p.paused ? tr("PAUSED") : said(tr("REPLAY x {:Lg}"), p.speed.load());
        const bool computing = p.ready < p.length;
        const char* fault = p.fault;
        return said(tr("{}   {:.3Lf} of {:.1Lf} s{}{}"), how, p.time.load(), p.length.load(),
                    computing ? said(tr("   ({:.1Lf} s computed)"), p.ready.load()) : "",
                    fault != nullptr ? std::string("   ") + tr(fault) : "");
    }
    if (follower_.state().standing == channel::Standing::toolElsewhere)
        return tr("PAUSED   bring the tool back to where it was");
    if (hand_.paused())
        return tr("PAUSED   S goes on, E ends, Backspace begins anew");
    if (!hand_.is())
        return "";
    if (!hand_.held())
        return leftHanded_ ? tr("hold the right button, or press Enter, to take the tool   (? lists the keys)")
                           : tr("hold the left button, or press Enter, to take the tool   (? lists the keys)");
    const double lag = glm::distance(hand_.target(), vec(follower_.state().tip));
    return said(tr("holding   hand ahead of the tip by {:.1Lf} mm"), 1e3 * lag);
}

}  // namespace palpate::render
