#include <apps/viewers.h>

#include <base/error.h>

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <utility>

namespace palpate::apps {

namespace {

constexpr const char* howToDraw = "build it with -DPALPATE_VIEWER=ON, or leave out --pictures";

}  // namespace

Viewers::Viewers(ViewersWanted wanted) : wanted_(std::move(wanted))
{
    if (wanted_.window) {
        openWindow();
    }
    if (!wanted_.pictures.empty()) {
        start(camera, {"--offscreen", wanted_.pictures});
    }
}

bool Viewers::lookAfter()
{
    const std::lock_guard lock(guard_);
    if (wanted_.handIsHere && window && window->wait(0) >= 0) {
        return false;
    }
    const auto now = std::chrono::steady_clock::now();
    if (!window || !window->killed() || now - opened_ <= std::chrono::milliseconds(500)) {
        return true;
    }
    try {
        openWindow();
    } catch (const std::exception& e) {
        // The session goes on without it.
        fmt::print(stderr, "palpate: {}\n", e.what());
    }
    return true;
}

void Viewers::waitForWindow()
{
    constexpr double longer = 400;  // than the window shows a result [s]
    if (window) {
        window->wait(longer);
    }
}

void Viewers::stall(bool stopped)
{
    const std::lock_guard lock(guard_);
    for (auto* viewer : {&window, &camera}) {
        if (*viewer) {
            (*viewer)->stall(stopped);
        }
    }
}

void Viewers::openWindow()
{
    std::vector<std::string> arguments{"--layout", wanted_.layout, "--palette", wanted_.palette};
    const auto add = [&](bool asked, std::initializer_list<std::string> words) {
        arguments.insert(arguments.end(), words.begin(), asked ? words.end() : words.begin());
    };
    for (const std::string& tissue : wanted_.hidden) {
        add(true, {"--hide", tissue});
    }
    add(wanted_.test, {"--no-plan", "--no-steps"});
    add(wanted_.sounds, {"--sounds"});
    add(wanted_.leftHanded, {"--hand", "left"});
    add(wanted_.tryout > 0, {"--tryout", fmt::format("{:g}", wanted_.tryout)});
    add(!wanted_.images.empty(), {"--images", wanted_.images.string()});
    add(!wanted_.result.empty(), {"--result", wanted_.result.string()});
    start(window, std::move(arguments));
    opened_ = std::chrono::steady_clock::now();
}

void Viewers::start(std::optional<base::ChildProcess>& viewer, std::vector<std::string> arguments) const
{
    arguments.insert(arguments.end(), {"--session", wanted_.session, "--wait", "30"});
    if (!wanted_.title.empty()) {
        arguments.push_back("--title=" + wanted_.title);
    }
    viewer.emplace(base::programFolder() / "palpate-view", arguments,
                   "build it with -DPALPATE_VIEWER=ON, or run with --no-view");
}

std::vector<std::string> tissuesToFind(const haptics::SessionModel& model)
{
    std::vector<std::string> names;
    if (model.scene.tool.kind == datasets::ToolKind::needle) {
        return names;
    }
    for (const auto& structure : model.tissue->structures()) {
        const auto& labels = model.structures[0].labels;
        if (std::ranges::find(labels, structure.value) != labels.end()) {
            names.push_back(model.tissue->table().rows[structure.tissue].name);
        }
    }
    return names;
}

void checkViewer()
{
    const auto viewer = base::programFolder() / "palpate-view";
    base::failIf(!std::filesystem::exists(viewer), "{}: cannot be started: it is missing; {}", viewer.native(), howToDraw);
}

void drawRecord(const std::filesystem::path& record, const std::string& pictures, double timeout)
{
    base::ChildProcess viewer(base::programFolder() / "palpate-view",
                              {"--replay", record.string(), "--offscreen", pictures}, howToDraw);
    base::failIf(viewer.wait(timeout) != 0, "{}: the pictures are not complete: the viewer failed or took too long",
                 pictures);
}

}  // namespace palpate::apps
