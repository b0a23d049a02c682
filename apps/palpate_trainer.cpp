#include <apps/parsed_program.h>
#include <base/child_process.h>
#include <base/end_in_order.h>
#include <base/error.h>
#include <base/quantities.h>
#include <base/window_size.h>
#include <command/json.h>
#include <trainer/window.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>

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

struct Words {
    palpate::trainer::WindowOptions options;
    std::string size = "1280x720", json;
    bool screens = false;
    std::filesystem::path sessions = palpate::trainer::sessionsFolder();
};

void addOptions(CLI::App& app, Words& w)
{
    app.add_option("--size", w.size, "Size of the window, WIDTHxHEIGHT [pixels]")->capture_default_str();
    app.add_option("--text-scale", w.options.textScale,
                   "Scale of all texts, 0.5 to 3 (default: as last set in the window with Ctrl and + or -)")
        ->check(CLI::Range(0.5, 3.0));
    app.add_option("--case", w.options.caseId, "Case that is selected at the start (palpate case list)");
    app.add_option("--sessions", w.sessions, "Folder for records and figures of sessions")->capture_default_str();
    auto* const frames =
        app.add_option("--frames", w.options.frames, "To measure: end after this many pictures (0: no limit)")
            ->capture_default_str();
    app.add_flag("--screens", w.screens, "To measure: draw each screen --frames times, with made-up sessions")
        ->needs(frames);
    app.add_option("--json", w.json, "Write frame times to this file (- = standard output)");
}

void run(Words& w)
{
    const auto [width, height] = palpate::base::pixelsOf(w.size).value_or(std::pair(0, 0));
    palpate::base::failIf(
        width < palpate::base::leastSide || height < 240 || std::max(width, height) > palpate::base::mostSide,
        "--size {}: must be WIDTHxHEIGHT, {}x240 to {}x{} pixels", w.size, palpate::base::leastSide,
        palpate::base::mostSide, palpate::base::mostSide);
    w.options.width = width;
    w.options.height = height;
    w.options.programs = palpate::base::programFolder();
    palpate::trainer::SessionFolder sink(w.sessions);
    const palpate::base::EndInOrder untilItsEnd;
    const WindowFigures figures =
        w.screens ? palpate::trainer::measureScreens(w.options, sink) : palpate::trainer::runWindow(w.options, sink);
    if (const int signal = palpate::base::EndInOrder::signal(); signal != 0) {
        throw palpate::command::Interrupted(signal, "interrupted");
    }
    if (w.screens && w.json != "-") {
        print(figures);
    }
    if (!w.json.empty()) {
        writeFigures(w.json, figures);
    }
}

}  // namespace

int main(int argc, char** argv)
{
    Words words;
    return palpate::apps::runParsed(
        argc, argv, "palpate-trainer",
        "Opens the window for training: choose a case, perform it, see the result. palpate without arguments does the "
        "same.",
        [&](CLI::App& app) { addOptions(app, words); }, [&] { run(words); });
}
