// First, before anything that brings OpenGL's own header.
#include <GL/glew.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <render/follower.h>
#include <render/hosts.h>

#include <vtkCallbackCommand.h>
#include <vtkCommand.h>
#include <vtkGenericOpenGLRenderWindow.h>
#include <vtkGenericRenderWindowInteractor.h>
#include <vtkInteractorStyleTrackballCamera.h>
#include <vtkNew.h>
#include <vtkOpenGLState.h>

#include <memory>
#include <stdexcept>
#include <thread>

namespace palpate::render {
namespace {

struct WindowCloser {
    void operator()(GLFWwindow* window) const noexcept
    {
        if (window != nullptr)
            glfwDestroyWindow(window);
        glfwTerminate();
    }
};
using Window = std::unique_ptr<GLFWwindow, WindowCloser>;

Window openWindow(const ViewerOptions& options)
{
    if (glfwInit() == GLFW_FALSE)
        throw std::runtime_error("no display: set DISPLAY, or use --offscreen DIR");
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 2);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    // A frame buffer with alpha would let the desktop shine through.
    glfwWindowHint(GLFW_ALPHA_BITS, 0);
    Window window(glfwCreateWindow(options.width, options.height, "Palpate", nullptr, nullptr));
    if (!window)
        throw std::runtime_error("the display has no OpenGL 3.2, which the viewer needs");
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
    if (!target.InitializeFromCurrentContext())
        throw std::runtime_error("the display has no OpenGL 3.2, which the viewer needs");

    target.SetFrameBlitModeToBlitToHardware();
}

// Left: turn, middle: shift, right or wheel: nearer and further.
struct Hand {
    vtkGenericRenderWindowInteractor& interactor;
    vtkGenericOpenGLRenderWindow& target;
    bool used = false;  // since the last frame

    void tell(unsigned long event)
    {
        used = true;
        interactor.InvokeEvent(event);
    }
};

Hand& handOf(GLFWwindow* window)
{
    return *static_cast<Hand*>(glfwGetWindowUserPointer(window));
}

void listen(GLFWwindow* window, Hand& hand)
{
    glfwSetWindowUserPointer(window, &hand);
    glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int) {
        const bool down = action == GLFW_PRESS;
        if (button == GLFW_MOUSE_BUTTON_LEFT)
            handOf(w).tell(down ? vtkCommand::LeftButtonPressEvent : vtkCommand::LeftButtonReleaseEvent);
        else if (button == GLFW_MOUSE_BUTTON_MIDDLE)
            handOf(w).tell(down ? vtkCommand::MiddleButtonPressEvent : vtkCommand::MiddleButtonReleaseEvent);
        else if (button == GLFW_MOUSE_BUTTON_RIGHT)
            handOf(w).tell(down ? vtkCommand::RightButtonPressEvent : vtkCommand::RightButtonReleaseEvent);
    });
    glfwSetCursorPosCallback(window, [](GLFWwindow* w, double x, double y) {
        handOf(w).interactor.SetEventInformationFlipY(static_cast<int>(x), static_cast<int>(y));
        handOf(w).tell(vtkCommand::MouseMoveEvent);
    });
    glfwSetScrollCallback(window, [](GLFWwindow* w, double, double y) {
        handOf(w).tell(y > 0 ? vtkCommand::MouseWheelForwardEvent : vtkCommand::MouseWheelBackwardEvent);
    });
    glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int, int action, int) {
        if (action == GLFW_PRESS && (key == GLFW_KEY_Q || key == GLFW_KEY_ESCAPE))
            glfwSetWindowShouldClose(w, GLFW_TRUE);
    });
    glfwSetFramebufferSizeCallback(window, [](GLFWwindow* w, int width, int height) {
        if (width < 1 || height < 1)
            return;
        handOf(w).used = true;
        handOf(w).target.SetSize(width, height);
        handOf(w).interactor.SetSize(width, height);
    });
}

// Ends VTK's use of the context before the window goes, also when an exception passes.
struct Finalizer {
    vtkRenderWindow& target;
    ~Finalizer() { target.Finalize(); }
};

}  // namespace

ViewerFigures showInWindow(const ViewerOptions& options, const std::atomic<bool>& stop)
{
    const Window window = openWindow(options);
    vtkNew<vtkGenericOpenGLRenderWindow> target;
    connect(*target, window.get());
    const Finalizer finalizer{*target};
    int width = 0, height = 0;
    glfwGetFramebufferSize(window.get(), &width, &height);
    target->SetSize(width, height);

    Picture picture(*target);
    vtkNew<vtkGenericRenderWindowInteractor> interactor;
    interactor->SetRenderWindow(target);
    vtkNew<vtkInteractorStyleTrackballCamera> style;
    interactor->SetInteractorStyle(style);
    interactor->EnableRenderOff();
    interactor->Initialize();
    Hand hand{*interactor, *target};
    listen(window.get(), hand);

    Follower follower(options.session, options.wait);
    // A fine picture of what does not move is no reason to keep a core busy.
    constexpr auto frame = std::chrono::milliseconds(16), stillFrame = std::chrono::milliseconds(400);
    Clock::time_point drawn{};
    auto used = Clock::now();
    while (!stop && !follower.over() && glfwWindowShouldClose(window.get()) == GLFW_FALSE &&
           (options.frames == 0 || follower.figures().frames < options.frames)) {
        const auto start = Clock::now();
        glfwPollEvents();
        if (std::exchange(hand.used, false))
            used = start;
        follower.poll(picture);
        const bool moving = follower.moving() || start - used < std::chrono::milliseconds(300);
        if (moving || start - drawn > stillFrame) {
            // VTK takes the state of a foreign context as it finds it. With OpenGL's own default (less) flat things would
            // hide what is drawn over them at the same depth.
            target->GetState()->Reset();
            target->GetState()->vtkglDepthFunc(GL_LEQUAL);
            follower.draw(picture, moving ? Quality::moving : Quality::still);
            glfwSwapBuffers(window.get());
            drawn = start;
        }
        std::this_thread::sleep_until(start + frame);
    }
    ViewerFigures figures = follower.figures();
    figures.display = picture.display();
    picture.close();
    return figures;
}

}  // namespace palpate::render
