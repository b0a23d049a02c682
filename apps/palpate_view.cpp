#include <apps/replay_player.h>
#include <base/build.h>
#include <command/json.h>
#include <render/keys.h>
#include <render/viewer.h>

#include <CLI/CLI.hpp>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <exception>
#include <fstream>
#include <iomanip>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

void readSize(const std::string& text, palpate::render::ViewerOptions& options)
{
    int end = 0;
    const int read = std::sscanf(text.c_str(), "%dx%d%n", &options.width, &options.height, &end);
    if (read != 2 || static_cast<std::size_t>(end) != text.size())
        throw std::runtime_error("--size " + text + ": must be WIDTHxHEIGHT in pixels, for example 1280x960");
}

void writeFigures(const std::string& file, const palpate::render::ViewerFigures& figures)
{
    constexpr double ms = 1e3;
    nlohmann::json json{{"display", figures.display},
                        {"frames", figures.frames},
                        {"frames_per_second", figures.rate},
                        {"frame_ms_p50", figures.frameP50 * ms},
                        {"frame_ms_p90", figures.frameP90 * ms},
                        {"delay_ms_p50", figures.delayP50 * ms},
                        {"delay_ms_p99", figures.delayP99 * ms}};
    if (figures.scans > 0) {
        nlohmann::json stages;
        for (const auto& [name, seconds] : figures.scanStages)
            stages[name] = seconds * ms;
        json["ultrasound"] = {{"pictures", figures.scans},
                              {"ms_p50", figures.scanP50 * ms},
                              {"ms_p90", figures.scanP90 * ms},
                              {"first_ms", figures.firstScan * ms},
                              {"stages_ms", stages}};
    }
    palpate::command::writeJson(file, json);
}

// One line per picture, with nanoseconds.
void writeTimeline(const std::string& file, const std::vector<palpate::render::Shown>& pictures)
{
    std::ofstream out(file);
    out << "tick,published_s,read_s,done_s\n" << std::fixed << std::setprecision(9);
    for (const auto& p : pictures)
        out << p.tick << ',' << p.published << ',' << p.read << ',' << p.done << '\n';
    out.close();
    if (!out)
        throw std::runtime_error(file + ": cannot be written");
}

}  // namespace

int main(int argc, char** argv)
{
    CLI::App app(
        "Shows a Palpate session that runs in another process. --keys lists what keys and mouse do, as does the "
        "key ?.",
        "palpate-view");
    palpate::render::ViewerOptions options;
    std::string size = "1280x960", json, layout = "trainee", slices = "tinted", timeline, replay;
    app.set_version_flag("--version", std::string(palpate::base::build()));
    app.add_flag_callback(
        "--keys", [] { throw CLI::CallForVersion(palpate::render::keysInWords(), 0); }, "List what keys and mouse do");
    app.add_option("--session", options.session, "Name of the session (default: the only one that runs)");
    app.add_option("--offscreen", options.offscreen, "Write PNG files to this folder instead of opening a window");
    app.add_option("--movie", options.movie, "Write an MP4 film to this file (needs ffmpeg)");
    app.add_option("--replay", replay, "Show a record (train --record) instead of a session that runs")
        ->excludes("--session");
    app.add_option("--layout", layout, "trainee or instructor")
        ->check(CLI::IsMember({"trainee", "instructor"}))
        ->capture_default_str();
    app.add_option("--slices", slices,
                   "Of a body with an image: tissue, tinted (the image in the tissues' colours) or image")
        ->check(CLI::IsMember({"tissue", "tinted", "image"}))
        ->capture_default_str();
    app.add_flag("--ultrasound", options.ultrasound, "Begin with the ultrasound picture (key U)");
    app.add_option("--images", options.images, "Folder for ultrasound pictures that are stored (key P)")
        ->capture_default_str();
    app.add_option("--hide", options.concealed.tissues,
                   "Show this tissue as what lies around it, and not where the target is: for a test");
    app.add_flag("--no-plan", options.concealed.plan, "Without planned line and distance to the target: for a test");
    app.add_flag("!--no-steps", options.steps, "Without the steps in words, which a window shows");
    app.add_option("--result", options.result, "Figures of the session (train --json), shown when it has ended");
    app.add_flag("--hidden", options.hidden, "Draw as in a window, on a display that nobody sees (Xvfb): to measure");
    app.add_option("--timeline", timeline, "Write when which tick was shown to this file (CSV, clock CLOCK_MONOTONIC)");
    app.add_option("--size", size, "WIDTHxHEIGHT in pixels")->capture_default_str();
    app.add_option("--every", options.every, "With --offscreen: seconds of the session from one picture to the next")
        ->capture_default_str();
    app.add_option("--wait", options.wait, "Seconds without a session before giving up, and to stay when it has ended")
        ->capture_default_str();
    app.add_option("--frames", options.frames, "End after so many pictures (0: no limit)")->capture_default_str();
    app.add_option("--json", json, "Write frame times to this file (-: standard output)");
    app.failure_message([](const CLI::App*, const CLI::Error& e) {
        return std::string("palpate-view: ") + e.what() + " (palpate-view --help lists what there is)\n";
    });
    try {
        app.parse(argc, argv);
        readSize(size, options);
        options.instructor = layout == "instructor";
        using palpate::render::SliceLook;
        options.slices = slices == "tissue" ? SliceLook::tissue : slices == "image" ? SliceLook::image : SliceLook::tinted;
        std::optional<palpate::apps::ReplayPlayer> player;
        if (!replay.empty()) {
            player.emplace(replay);
            options.session = player->session();
            options.playback = &player->playback();
        }
        const auto figures = palpate::render::runViewer(options);
        if (!json.empty())
            writeFigures(json, figures);
        if (!timeline.empty())
            writeTimeline(timeline, figures.shown);
        if (player && !player->problem().empty())
            throw std::runtime_error(player->problem());
        return 0;
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "palpate-view: %s\n", e.what());
        return 1;
    }
}
