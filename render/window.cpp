// First, before anything that brings OpenGL's own header.
#include <GL/glew.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <base/error.h>
#include <base/window_size.h>
#include <render/controls.h>
#include <render/display.h>
#include <render/follower.h>
#include <render/hosts.h>
#include <render/sounds.h>

#include <vtkCallbackCommand.h>
#include <vtkCommand.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkGenericRenderWindowInteractor.h>
#include <vtkInteractorStyleTrackballCamera.h>
#include <vtkNew.h>
#include <vtkOpenGLFramebufferObject.h>
#include <vtkOpenGLState.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>

namespace palpate::render {
namespace {

using Window = std::unique_ptr<GLFWwindow, decltype([](GLFWwindow* window) {
                                   glfwDestroyWindow(window);
                                   glfwTerminate();
                               })>;

Window openWindow(const ViewerOptions& options)
{
    base::failIf(glfwInit() == GLFW_FALSE, "{}, or use --offscreen DIR", noDisplay());
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 2);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    // A frame buffer with alpha would let the desktop shine through.
    glfwWindowHint(GLFW_ALPHA_BITS, 0);
    int x = 0, y = 0;
    base::WindowSize screen;
    if (GLFWmonitor* first = glfwGetPrimaryMonitor(); first != nullptr && !options.hidden)
        glfwGetMonitorWorkarea(first, &x, &y, &screen.width, &screen.height);
    const auto [width, height] = base::fittedTo(screen, {options.width, options.height});
    Window window(glfwCreateWindow(width, height, "Palpate", nullptr, nullptr));
    base::failIf(!window, "the display has no OpenGL 3.2, which the viewer needs");
    glfwSetWindowSizeLimits(window.get(), base::leastSide, base::leastSide, GLFW_DONT_CARE, GLFW_DONT_CARE);
    glfwMakeContextCurrent(window.get());
    glfwSwapInterval(0);
    return window;
}

// VTK asks its host about the context by events.
void observe(vtkRenderWindow& target, GLFWwindow* window, unsigned long event,
             void (*answer)(vtkObject*, unsigned long, void*, void*))
{
    vtkNew<vtkCallbackCommand> command;
    command->SetClientData(window);
    command->SetCallback(answer);
    target.AddObserver(event, command);
}

void connect(vtkGenericOpenGLRenderWindow& target, GLFWwindow* window)
{
    using Object = vtkObject;
    const auto yes = [](Object*, unsigned long, void*, void* result) { *static_cast<int*>(result) = 1; };
    observe(target, window, vtkCommand::WindowMakeCurrentEvent,
            [](Object*, unsigned long, void* host, void*) { glfwMakeContextCurrent(static_cast<GLFWwindow*>(host)); });
    observe(target, window, vtkCommand::WindowIsCurrentEvent, [](Object*, unsigned long, void* host, void* result) {
        *static_cast<bool*>(result) = glfwGetCurrentContext() == host;
    });
    observe(target, window, vtkCommand::WindowSupportsOpenGLEvent, yes);
    observe(target, window, vtkCommand::WindowIsDirectEvent, yes);
    target.SetOwnContext(0);
    target.SetMultiSamples(0);
    target.SetMapped(true);
    target.SetReadyForRendering(true);
    target.SetShowWindow(true);
    base::failIf(!target.InitializeFromCurrentContext(), "the display has no OpenGL 3.2, which the viewer needs");
    target.SetSwapBuffers(0);
}

// The picture goes to the window with one copy of its colours. VTK's own way copies colours and depths, and both twice.
void present(vtkGenericOpenGLRenderWindow& target, GLFWwindow* window)
{
    vtkOpenGLState& state = *target.GetState();
    const int width = target.GetSize()[0], height = target.GetSize()[1];
    state.PushFramebufferBindings();
    target.GetRenderFramebuffer()->Bind(GL_READ_FRAMEBUFFER);
    target.GetRenderFramebuffer()->ActivateReadBuffer(0);
    state.vtkglBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    state.vtkglDrawBuffer(GL_BACK_LEFT);
    state.vtkglViewport(0, 0, width, height);
    state.vtkglScissor(0, 0, width, height);
    state.vtkglBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
    state.PopFramebufferBindings();
    glfwSwapBuffers(window);
}

// What the callback for the window's size needs; the window's own pointer belongs to the controls.
struct Target {
    vtkGenericOpenGLRenderWindow& window;
    vtkGenericRenderWindowInteractor& interactor;

    void fit(GLFWwindow* host) const
    {
        int width = 0, height = 0;
        glfwGetFramebufferSize(host, &width, &height);
        if (width < 1 || height < 1 || (window.GetSize()[0] == width && window.GetSize()[1] == height))
            return;
        window.SetSize(width, height);
        interactor.SetSize(width, height);
    }
};

// When a picture is due. Pictures begin with the simulation's frames, so that all viewers show the same tick; one that
// cannot keep up with that draws as fast as it can, one that is quick begins a second one half-way. A fine picture of what
// does not move is no reason to keep a core busy.
class FrameClock {
public:
    bool due(const Follower& follower, bool moving, bool used) const
    {
        const auto since = Clock::now() - drawn_;
        if (!moving)
            return !still_ || since >= stillFrame;
        return (used && since >= frame) || slow_ || frameAt(follower) != frame_;
    }
    void begin(const Follower& follower, bool moving)
    {
        drawn_ = Clock::now();
        frame_ = frameAt(follower);
        still_ = !moving;
    }
    void end()
    {
        const auto took = Clock::now() - drawn_;
        slow_ = !still_ && took > frame;
        quick_ = took < frame / 4;
    }

private:
    std::uint64_t frameAt(const Follower& follower) const
    {
        const std::uint64_t tick = follower.state().tick, half = channel::frameTicks / 2;
        return 2 * (tick / channel::frameTicks) + (quick_ && tick % channel::frameTicks > half ? 1 : 0);
    }

    static constexpr auto frame = std::chrono::milliseconds(channel::frameTicks), stillFrame = std::chrono::seconds(1);
    Clock::time_point drawn_{};
    std::uint64_t frame_ = 0;
    bool slow_ = false, quick_ = false, still_ = false;
};

// Ends VTK's use of the context before the window goes, also when an exception passes.
struct Finalizer {
    vtkRenderWindow& target;
    ~Finalizer() { target.Finalize(); }
};

}  // namespace

ViewerFigures showInWindow(const ViewerOptions& options, const std::atomic<int>& stop)
{
    const Window window = openWindow(options);
    vtkNew<vtkGenericOpenGLRenderWindow> target;
    connect(*target, window.get());
    const Finalizer finalizer{*target};
    int width = 0, height = 0;
    glfwGetFramebufferSize(window.get(), &width, &height);
    target->SetSize(width, height);

    Picture picture(*target);
    setUp(picture, options);
    vtkNew<vtkGenericRenderWindowInteractor> interactor;
    interactor->SetRenderWindow(target);
    vtkNew<vtkInteractorStyleTrackballCamera> style;
    interactor->SetInteractorStyle(style);
    interactor->EnableRenderOff();
    interactor->Initialize();
    const Target shown{*target, *interactor};

    Follower follower(options.session, options.wait, options.result);
    Controls controls(window.get(), *interactor, picture, follower, options);
    std::optional<Sounds> sounds;
    if (options.sounds)
        sounds.emplace([](const std::string& why) { std::fprintf(stderr, "palpate-view: %s\n", why.c_str()); });
    FrameClock clock;
    auto used = Clock::now();
    const auto nothingToShow = [&] { return options.playback != nullptr && options.playback->length < 0; };
    while (!stop && !follower.over() && glfwWindowShouldClose(window.get()) == GLFW_FALSE && !nothingToShow() &&
           (options.frames == 0 || follower.frames() < options.frames)) {
        glfwPollEvents();
        shown.fit(window.get());
        float scale = 1, other = 1;
        glfwGetWindowContentScale(window.get(), &scale, &other);
        picture.setDisplayScale(static_cast<double>(scale));
        const bool now = controls.used();
        if (now)
            used = Clock::now();
        follower.poll(picture);
        controls.keep();
        if (sounds)
            sounds->heed(follower.state());
        const bool moving = follower.moving() || controls.holding() || Clock::now() - used < std::chrono::milliseconds(300);
        if (!clock.due(follower, moving, now)) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            continue;
        }
        clock.begin(follower, moving);
        // VTK takes the state of a foreign context as it finds it. With OpenGL's own default (less) flat things would
        // hide what is drawn over them at the same depth.
        target->GetState()->Reset();
        target->GetState()->vtkglDepthFunc(GL_LEQUAL);
        follower.draw(picture, moving ? Quality::moving : Quality::still, [&] { present(*target, window.get()); });
        clock.end();
    }
    ViewerFigures figures = follower.figures();
    figures.display = picture.display();
    addScans(picture.ultrasound(), figures);
    picture.close();
    return figures;
}

}  // namespace palpate::render
