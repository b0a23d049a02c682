#include <trainer/window.h>

#include <base/words.h>
#include <trainer/case_pictures.h>
#include <trainer/errands.h>
#include <trainer/look.h>
#include <trainer/screens.h>

#include <GLFW/glfw3.h>

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace palpate::trainer {

namespace {

using base::tr;

constexpr double idle = 0.2;  // between looks at what runs, when nobody does anything [s]

struct WindowCloser {
    void operator()(GLFWwindow* window) const noexcept
    {
        if (window != nullptr) {
            glfwDestroyWindow(window);
        }
        glfwTerminate();
    }
};
using Window = std::unique_ptr<GLFWwindow, WindowCloser>;

Window openWindow(const WindowOptions& options)
{
    if (glfwInit() == GLFW_FALSE) {
        throw std::runtime_error(tr("no display: set DISPLAY, or type palpate --help for the commands"));
    }
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 2);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    Window window(glfwCreateWindow(options.width, options.height, tr("Palpate trainer"), nullptr, nullptr));
    if (!window) {
        throw std::runtime_error(tr("the display has no OpenGL 3.2, which the window needs"));
    }
    glfwMakeContextCurrent(window.get());
    glfwSwapInterval(0);
    return window;
}

// ImGui looks at keys once per picture. A key that goes down and up between two pictures stays down for one.
class Keys {
public:
    explicit Keys(GLFWwindow* window) : window_(window)
    {
        glfwSetWindowUserPointer(window, this);
        glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int code, int action, int mods) {
            static_cast<Keys*>(glfwGetWindowUserPointer(w))->heed(key, code, action, mods);
        });
    }
    /// After a picture.
    void letGo()
    {
        for (const Press& p : std::exchange(released_, {})) {
            ImGui_ImplGlfw_KeyCallback(window_, p.key, p.code, GLFW_RELEASE, p.mods);
        }
        pressed_.clear();
    }
    /// Whether the next picture shows a key that has come up by now.
    bool waiting() const { return !released_.empty(); }

private:
    struct Press {
        int key, code, mods;
    };
    void heed(int key, int code, int action, int mods)
    {
        if (action == GLFW_RELEASE && std::ranges::find(pressed_, key) != pressed_.end()) {
            released_.push_back({key, code, mods});
            return;
        }
        if (action == GLFW_PRESS) {
            pressed_.push_back(key);
        }
        ImGui_ImplGlfw_KeyCallback(window_, key, code, action, mods);
    }

    GLFWwindow* window_;
    std::vector<int> pressed_;  // since the last picture
    std::vector<Press> released_;
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
        ImGui_ImplGlfw_InitForOpenGL(window, true);
        ImGui_ImplOpenGL3_Init("#version 150");
    }
    ~Gui()
    {
        ImGui_ImplOpenGL3_Shutdown();
        ImGui_ImplGlfw_Shutdown();
        ImGui::DestroyContext();
    }
    Gui(const Gui&) = delete;
    Gui& operator=(const Gui&) = delete;

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
    explicit TextScale(double& asked) : asked_(asked) {}

    /// Between pictures.
    void fit(GLFWwindow* window)
    {
        float density = 1, other = 1;
        glfwGetWindowContentScale(window, &density, &other);
        const float wanted = static_cast<float>(asked_) * std::max(density, 1.0F);
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
    /// In a picture. Returns whether it has changed.
    bool heed()
    {
        const ImGuiIO& io = ImGui::GetIO();
        constexpr double step = 1.25, least = 0.5, most = 3;
        const auto pressed = [&](int key) { return io.KeyCtrl && ImGui::IsKeyPressed(key, false); };
        const double before = asked_;
        if (pressed(GLFW_KEY_EQUAL) || pressed(GLFW_KEY_KP_ADD)) {
            asked_ = std::min(asked_ * step, most);
        } else if (pressed(GLFW_KEY_MINUS) || pressed(GLFW_KEY_KP_SUBTRACT)) {
            asked_ = std::max(asked_ / step, least);
        }
        return asked_ != before;
    }

private:
    double& asked_;
    float set_ = 0;
};

double quantile(std::vector<double> values, double share)
{
    if (values.empty()) {
        return 0;
    }
    std::ranges::sort(values);
    return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace

WindowFigures runWindow(const WindowOptions& options, ResultSink& sink)
{
    const Window window = openWindow(options);
    Gui gui(window.get());
    Keys keys(window.get());
    Textures textures;
    State state;
    state.settings = readSettings(settingsFile());
    base::useLanguage(state.settings.language);
    state.settings.textScale = options.textScale > 0 ? options.textScale : state.settings.textScale;
    TextScale scale(state.settings.textScale);
    Errands errands(options.programs, sink);
    errands.list(state);
    for (std::size_t i = 0; i < state.cases.size(); ++i) {
        state.chosen = state.cases[i].id == options.caseId ? i : state.chosen;
    }
    WindowFigures figures;
    const GLubyte* renderer = glGetString(GL_RENDERER);
    figures.display = renderer != nullptr ? reinterpret_cast<const char*>(renderer) : "unknown";
    std::vector<double> seconds;
    constexpr int none = -1;
    int shown = none;  // screen
    int due = 0;       // pictures until all has settled
    while (glfwWindowShouldClose(window.get()) == GLFW_FALSE && (options.frames == 0 || figures.frames < options.frames)) {
        if (options.frames == 0 && due == 0) {
            glfwWaitEventsTimeout(idle);
            due = 2;
        } else {
            glfwPollEvents();
        }
        const auto begun = std::chrono::steady_clock::now();
        errands.look(state);
        scale.fit(window.get());
        gui.begin();
        const bool scaled = scale.heed();
        const bool entered = shown != static_cast<int>(state.screen);
        if (entered) {
            glfwSetWindowTitle(window.get(), (std::string(tr("Palpate trainer: ")) + nameOf(state.screen)).c_str());
        }
        shown = static_cast<int>(state.screen);
        const ImVec2 size = ImGui::GetIO().DisplaySize;
        const Errand errand = drawScreen(
            state, [&](const std::string& picture) { return textures.of(picture); }, size.x, size.y, entered);
        gui.end(window.get());
        seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count());
        ++figures.frames;
        due = keys.waiting() ? 2 : std::max(due - 1, 0);
        keys.letGo();
        if (errand == Errand::quit) {
            break;
        }
        errands.run(errand == Errand::none && scaled ? Errand::keepSettings : errand, state);
        if (errand == Errand::keepSettings) {
            shown = none;  // all is drawn anew
        }
    }
    figures.frameP50 = quantile(seconds, 0.5);
    figures.frameP90 = quantile(std::move(seconds), 0.9);
    return figures;
}

}  // namespace palpate::trainer
