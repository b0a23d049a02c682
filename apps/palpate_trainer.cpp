#include <base/build.h>
#include <base/child_process.h>
#include <command/json.h>
#include <trainer/window.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace {

using palpate::trainer::ScreenFigures;
using palpate::trainer::WindowFigures;

constexpr double ms = 1e3;

nlohmann::json json(const ScreenFigures& f)
{
    return {{"frames", f.frames},
            {"frame_ms_p50", ms * f.frameP50},
            {"frame_ms_p90", ms * f.frameP90},
            {"frame_ms_max", ms * f.frameMax}};
}

void print(const WindowFigures& figures)
{
    std::printf("drawn by %s\n%-20s %7s %8s %8s %8s  [ms]\n", figures.display.c_str(), "screen", "frames", "p50", "p90",
                "max");
    for (const ScreenFigures& f : figures.screens) {
        std::printf("%-20s %7d %8.1f %8.1f %8.1f\n", f.screen.c_str(), static_cast<int>(f.frames), ms * f.frameP50,
                    ms * f.frameP90, ms * f.frameMax);
    }
}

void writeFigures(const std::string& file, const WindowFigures& figures)
{
    nlohmann::json all = json(figures.all);
    all["display"] = figures.display;
    for (const ScreenFigures& f : figures.screens) {
        all["screens"][f.screen] = json(f);
    }
    palpate::command::writeJson(file, all);
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app("Choose a case, do it, see how it went: one window for training. palpate without arguments opens it.",
                 "palpate-trainer");
    palpate::trainer::WindowOptions options;
    std::string size = "1280x720", file;
    bool screens = false;
    std::filesystem::path sessions = palpate::trainer::sessionsFolder();
    app.set_version_flag("--version", std::string(palpate::base::build()));
    app.add_option("--size", size, "WIDTHxHEIGHT in pixels")->capture_default_str();
    app.add_option("--text-scale", options.textScale, "Of all texts; in the window Ctrl with + or -")
        ->check(CLI::Range(0.5, 3.0));
    app.add_option("--case", options.caseId, "The case that is chosen at first (palpate case list)");
    app.add_option("--sessions", sessions, "Folder for records and figures of sessions")->capture_default_str();
    auto* const frames = app.add_option("--frames", options.frames, "To measure: end after so many pictures (0: no limit)")
                             ->capture_default_str();
    app.add_flag("--screens", screens, "To measure: draw each screen so many times (--frames), with made-up sessions on it")
        ->needs(frames);
    app.add_option("--json", file, "Write frame times to this file (-: standard output)");
    app.failure_message([](const CLI::App*, const CLI::Error& e) {
        return std::string("palpate-trainer: ") + e.what() + " (palpate-trainer --help lists what there is)\n";
    });
    try {
        app.parse(argc, argv);
        int end = 0;
        const int read = std::sscanf(size.c_str(), "%dx%d%n", &options.width, &options.height, &end);
        if (read != 2 || static_cast<std::size_t>(end) != size.size() || options.width < 320 || options.height < 240 ||
            options.width > 8192 || options.height > 8192) {
            throw std::runtime_error("--size " + size + ": must be WIDTHxHEIGHT, 320x240 to 8192x8192 pixels");
        }
        options.programs = palpate::base::programFolder();
        palpate::trainer::SessionFolder sink(sessions);
        const WindowFigures figures =
            screens ? palpate::trainer::measureScreens(options, sink) : palpate::trainer::runWindow(options, sink);
        if (screens && file != "-") {
            print(figures);
        }
        if (!file.empty()) {
            writeFigures(file, figures);
        }
        return 0;
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "palpate-trainer: %s\n", e.what());
        return 1;
    }
}
