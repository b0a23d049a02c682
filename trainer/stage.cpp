#include <trainer/stage.h>

#include <base/error.h>
#include <base/said.h>
#include <base/window_size.h>
#include <base/words.h>
#include <trainer/case_pictures.h>
#include <trainer/look.h>
#include <trainer/screens.h>

#include <GLFW/glfw3.h>

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::trainer {

using base::tr;

namespace {

using Window = std::unique_ptr<GLFWwindow, decltype([](GLFWwindow* window) {
                                   glfwDestroyWindow(window);
                                   glfwTerminate();
                               })>;

Window openWindow(int width, int height)
{
    const char* const display = std::getenv("DISPLAY");
    base::failIf(
        glfwInit() == GLFW_FALSE, "{}",
        display != nullptr && *display != '\0'
            ? base::said(tr("DISPLAY {} does not answer: set another one, or type palpate --help for the commands"),
                         display)
            : tr("no display: set DISPLAY, or type palpate --help for the commands"));
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 2);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    int x = 0, y = 0;
    base::WindowSize screen;
    if (GLFWmonitor* const first = glfwGetPrimaryMonitor(); first != nullptr) {
        glfwGetMonitorWorkarea(first, &x, &y, &screen.width, &screen.height);
    }
    const auto [wide, high] = base::fittedTo(screen, {width, height});
    Window window(glfwCreateWindow(wide, high, tr("Palpate trainer"), nullptr, nullptr));
    base::failIf(!window, "{}", tr("the display has no OpenGL 3.2, which the window needs"));
    glfwMakeContextCurrent(window.get());
    glfwSwapInterval(0);
    return window;
}

// What comes from keys and mouse, and what the desktop does with the window.
//
// ImGui looks at keys once per picture. A key that goes down and up between two pictures stays down for one, and so does
// what was held with it.
class Input {
public:
    /// After ImGui's own callbacks, which these call.
    explicit Input(GLFWwindow* window) : window_(window)
    {
        glfwSetWindowUserPointer(window, this);
        glfwSetKeyCallback(
            window, [](GLFWwindow* w, int key, int code, int action, int mods) { of(w).heed(key, code, action, mods); });
        glfwSetMouseButtonCallback(window, passOn<ImGui_ImplGlfw_MouseButtonCallback>);
        glfwSetScrollCallback(window, passOn<ImGui_ImplGlfw_ScrollCallback>);
        glfwSetCharCallback(window, passOn<ImGui_ImplGlfw_CharCallback>);
        glfwSetWindowFocusCallback(window, passOn<ImGui_ImplGlfw_WindowFocusCallback>);
        glfwSetCursorEnterCallback(window, passOn<ImGui_ImplGlfw_CursorEnterCallback>);
        glfwSetCursorPosCallback(window, note);
        glfwSetWindowRefreshCallback(window, note);
        glfwSetFramebufferSizeCallback(window, note);
        glfwSetWindowContentScaleCallback(window, note);
        glfwSetWindowCloseCallback(window, note);
    }
    /// Whether something came since the last call.
    bool heard() noexcept { return std::exchange(heard_, false); }
    /// By how many steps texts are to be larger, asked for by Ctrl and + or - since the last call.
    int larger() noexcept { return std::exchange(larger_, 0); }
    /// As if a key, and another one with it, went down and up.
    void tap(int key, int with = none)
    {
        for (const int action : {GLFW_PRESS, GLFW_RELEASE}) {
            with != none ? heed(with, 0, action, 0) : void();
            heed(key, 0, action, 0);
        }
    }
    /// After a picture. Returns whether one more has to be drawn, for keys that have come up by now.
    bool letGo()
    {
        const std::vector<Stroke> up = std::exchange(released_, {});
        for (const Stroke& k : up) {
            ImGui_ImplGlfw_KeyCallback(window_, k.key, k.code, GLFW_RELEASE, k.mods);
        }
        pressed_ = false;
        return !up.empty();
    }

private:
    static constexpr int none = -1;
    struct Stroke {
        int key, code, mods;
    };
    static Input& of(GLFWwindow* window) { return *static_cast<Input*>(glfwGetWindowUserPointer(window)); }
    template <auto to, class... Args>
    static void passOn(GLFWwindow* window, Args... args)
    {
        of(window).heard_ = true;
        to(window, args...);
    }
    template <class... Args>
    static void note(GLFWwindow* window, Args...)
    {
        of(window).heard_ = true;
    }
    // By what is on the key: where it is differs between keyboards.
    static int sizeSteps(int key, int code)
    {
        const char* const name = glfwGetKeyName(key, code);
        const std::string_view sign = name != nullptr ? name : "";
        return key == GLFW_KEY_KP_ADD || sign == "+" || sign == "=" ? 1
               : key == GLFW_KEY_KP_SUBTRACT || sign == "-"         ? -1
                                                                    : 0;
    }
    void heed(int key, int code, int action, int mods)
    {
        heard_ = true;
        if (action == GLFW_PRESS && (mods & GLFW_MOD_CONTROL) != 0) {
            larger_ += sizeSteps(key, code);
        }
        if (action == GLFW_RELEASE && pressed_) {
            released_.push_back({key, code, mods});
            return;
        }
        if (action == GLFW_PRESS) {
            pressed_ = true;
        }
        ImGui_ImplGlfw_KeyCallback(window_, key, code, action, mods);
    }

    GLFWwindow* window_;
    bool heard_ = false;
    int larger_ = 0;
    bool pressed_ = false;  // a key, since the last picture
    std::vector<Stroke> released_;
};

// ImGui with its two back ends.
class Gui {
public:
    explicit Gui(GLFWwindow* window)
    {
        IMGUI_CHECKVERSION();
        ImGui::CreateContext();
        ImGuiIO& io = ImGui::GetIO();
        io.ConfigFlags |= ImGuiConfigFlags_NavEnableKeyboard;
        io.IniFilename = nullptr;
        io.ConfigInputTextCursorBlink = false;  // it would take pictures while nothing happens
        ImGui_ImplGlfw_InitForOpenGL(window, true);
        ImGui_ImplOpenGL3_Init("#version 150");
    }
    ~Gui()
    {
        ImGui_ImplOpenGL3_Shutdown();
        ImGui_ImplGlfw_Shutdown();
        ImGui::DestroyContext();
    }
    Gui& operator=(Gui&&) = delete;

    void begin()
    {
        ImGui_ImplOpenGL3_NewFrame();
        ImGui_ImplGlfw_NewFrame();
        // Enter presses what has the focus, as Space does.
        ImGuiIO& io = ImGui::GetIO();
        if (!io.WantTextInput && io.KeysDown[io.KeyMap[ImGuiKey_Enter]]) {
            io.NavInputs[ImGuiNavInput_Activate] = 1;
        }
        ImGui::NewFrame();
        tabFromHere();
    }
    void end(GLFWwindow* window)
    {
        ImGui::Render();
        int width = 0, height = 0;
        glfwGetFramebufferSize(window, &width, &height);
        glViewport(0, 0, width, height);
        glClearColor(0.09F, 0.10F, 0.13F, 1);
        glClear(GL_COLOR_BUFFER_BIT);
        ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
        glFinish();
        glfwSwapBuffers(window);
    }

private:
    // ImGui takes Tab for a way between fields of text: from anything else it would lead to the first one, unseen.
    static void tabFromHere()
    {
        ImGuiContext& context = *ImGui::GetCurrentContext();
        if (context.NavMoveScoringItems && (context.NavMoveFlags & ImGuiNavMoveFlags_Tabbing) != 0 &&
            ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Tab])) {
            context.NavTabbingDir = ImGui::GetIO().KeyShift ? -1 : context.NavId != 0 ? 1 : 0;
            context.NavDisableHighlight = false;
            context.NavDisableMouseHover = true;
        }
    }
};

// Pictures of cases, as textures.
class Textures {
public:
    Texture of(const std::string& picture)
    {
        const auto known = all_.find(picture);
        return known != all_.end() ? known->second : all_[picture] = load(picture);
    }

private:
    static Texture load(const std::string& picture)
    {
        const Pixels pixels = casePicture(picture);
        if (pixels.rgb.empty()) {
            return {};
        }
        Texture texture{0, pixels.width, pixels.height};
        glGenTextures(1, &texture.id);
        glBindTexture(GL_TEXTURE_2D, texture.id);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
        glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB, pixels.width, pixels.height, 0, GL_RGB, GL_UNSIGNED_BYTE, pixels.rgb.data());
        return texture;
    }

    std::map<std::string, Texture> all_;
};

// Texts grow with Ctrl and + or -, and with the screen's density.
class TextScale {
public:
    /// Between pictures.
    /// @param asked  by the user
    void fit(GLFWwindow* window, double asked)
    {
        float density = 1, other = 1;
        glfwGetWindowContentScale(window, &density, &other);
        const float wanted = static_cast<float>(asked) * std::max(density, 1.0F);
        if (wanted == set_) {
            return;
        }
        const bool again = set_ > 0;
        set_ = wanted;
        setLook(wanted);
        if (again) {
            ImGui_ImplOpenGL3_DestroyFontsTexture();
            ImGui_ImplOpenGL3_CreateFontsTexture();
        }
    }
    /// By so many steps larger. Returns whether it has changed.
    static bool change(double& asked, int steps)
    {
        constexpr double step = 1.25, least = 0.5, most = 3;
        const double before = asked;
        asked = steps != 0 ? std::clamp(asked * std::pow(step, steps), least, most) : asked;
        return asked != before;
    }

private:
    float set_ = 0;
};

}  // namespace

struct Stage::Impl {
    Impl(int width, int height) : window(openWindow(width, height)), gui(window.get()), input(window.get()) {}

    static constexpr int none = -1;

    Window window;
    Gui gui;
    Input input;
    Textures textures;
    TextScale scale;
    int shown = none;  // screen
};

Stage::Stage(int width, int height) : impl_(std::make_unique<Impl>(width, height)) {}

Stage::~Stage() = default;

std::string Stage::renderer() const
{
    const GLubyte* const name = glGetString(GL_RENDERER);
    return name != nullptr ? reinterpret_cast<const char*>(name) : "unknown";
}

bool Stage::closed() const
{
    return glfwWindowShouldClose(impl_->window.get()) != GLFW_FALSE;
}

void Stage::stay()
{
    glfwSetWindowShouldClose(impl_->window.get(), GLFW_FALSE);
}

bool Stage::focused() const
{
    return glfwGetWindowAttrib(impl_->window.get(), GLFW_FOCUSED) != GLFW_FALSE;
}

void Stage::takeFocus()
{
    glfwFocusWindow(impl_->window.get());
}

bool Stage::await(double seconds)
{
    seconds > 0 ? glfwWaitEventsTimeout(seconds) : glfwPollEvents();
    return impl_->input.heard();
}

void Stage::press(Press what)
{
    switch (what) {
        case Press::activate:
            return impl_->input.tap(GLFW_KEY_ENTER);
        case Press::back:
            return impl_->input.tap(GLFW_KEY_ESCAPE);
        case Press::next:
            return impl_->input.tap(GLFW_KEY_TAB);
        case Press::previous:
            return impl_->input.tap(GLFW_KEY_TAB, GLFW_KEY_LEFT_SHIFT);
    }
}

Drawn Stage::draw(State& state)
{
    const auto begun = std::chrono::steady_clock::now();
    const bool scaled = TextScale::change(state.settings.textScale, impl_->input.larger());
    impl_->scale.fit(impl_->window.get(), state.settings.textScale);
    impl_->gui.begin();
    const bool entered = impl_->shown != static_cast<int>(state.screen);
    if (entered) {
        glfwSetWindowTitle(impl_->window.get(), (std::string(tr("Palpate trainer: ")) + nameOf(state.screen)).c_str());
    }
    impl_->shown = static_cast<int>(state.screen);
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const Errand errand = drawScreen(
        state, [this](const std::string& picture) { return impl_->textures.of(picture); }, size.x, size.y, entered);
    impl_->gui.end(impl_->window.get());
    return {errand == Errand::none && scaled ? Errand::keepSettings : errand,
            std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count(), impl_->input.letGo()};
}

void Stage::renew()
{
    impl_->shown = Impl::none;
}

}  // namespace palpate::trainer
