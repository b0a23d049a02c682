#include <tests/apps/desktop.h>

#include <chrono>
#include <sstream>
#include <thread>

namespace palpate::apps {
namespace {

constexpr int patience = 200;  // looks
constexpr auto betweenLooks = std::chrono::milliseconds(100);

}  // namespace

// The server chooses a number that is free, and tells it when it is ready. It must not begin anew when a client goes: a
// window that connects in that moment would be cut off.
Desktop::Desktop()
{
    const std::string file = folder_ / "display";
    server_ = std::make_unique<Program>(
        "/usr/bin/env", std::vector<std::string>{
                            "sh", "-c", "exec Xvfb -displayfd 3 -screen 0 1024x768x24 -nolisten tcp -noreset 3> " + file});
    for (int i = 0; i < patience && display_.empty(); ++i) {
        std::this_thread::sleep_for(betweenLooks);
        if (const std::string told = readText(file); told.ends_with('\n'))
            display_ = ":" + told.substr(0, told.size() - 1);
    }
}

std::unique_ptr<Program> Desktop::start(const std::string& name, const std::vector<std::string>& arguments) const
{
    std::vector<std::string> words{"DISPLAY=" + display_, "LANGUAGE=en",
                                   "XDG_CONFIG_HOME=" + std::string(folder_ / "config"),
                                   std::string(PALPATE_BIN_DIR) + "/" + name};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return std::make_unique<Program>("/usr/bin/env", words);
}

std::string Desktop::xdotool(const std::vector<std::string>& words) const
{
    std::vector<std::string> all{"DISPLAY=" + display_, "xdotool"};
    all.insert(all.end(), words.begin(), words.end());
    return Program("/usr/bin/env", all).wait().out;
}

void Desktop::close(const std::string& window) const
{
    Program("/usr/bin/env", {"DISPLAY=" + display_, "python3", PALPATE_SOURCE_DIR "/tests/apps/close_window.py", window})
        .wait();
}

std::string Desktop::window(const std::string& name, double seconds) const
{
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
        std::istringstream found(xdotool({"search", "--onlyvisible", "--name", name}));
        if (std::string id; found >> id)
            return id;
        std::this_thread::sleep_for(betweenLooks);
    }
    return {};
}

void wait(double seconds)
{
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

glm::dvec3 vec(const channel::Triple& t)
{
    return {t[0], t[1], t[2]};
}

}  // namespace palpate::apps
