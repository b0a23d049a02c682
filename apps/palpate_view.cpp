#include <apps/parsed_program.h>
#include <apps/replay_player.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <base/words.h>
#include <command/interrupted.h>
#include <command/json.h>
#include <render/keys.h>
#include <render/tryout.h>
#include <render/viewer.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <nlohmann/json.hpp>

#include <cstdio>
#include <fstream>
#include <iomanip>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

namespace {

void readSize(const std::string& text, palpate::render::ViewerOptions& options)
{
    const auto size = palpate::base::pixelsOf(text);
    palpate::base::failIf(!size, "--size {}: must be WIDTHxHEIGHT in pixels, for example 1280x960", text);
    std::tie(options.width, options.height) = *size;
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
    palpate::base::failIf(!out, "{}: cannot be written", file);
}

// What the command line says in words.
struct Words {
    std::string size = "1280x960", json, layout = "trainee", palette = "standard", ghost, slices = "tinted", timeline,
                replay, hand = "right";
    double at = -1;  // [s]; negative: from the beginning
};

// A time as `palpate export --at` takes it, 3.2s or 3200ms, as the seconds that it is.
std::string inSeconds(std::string& time)
{
    if (const auto seconds = palpate::base::timeOf(time)) {
        time = fmt::format("{}", *seconds);
    }
    return {};
}

void addOptions(CLI::App& app, palpate::render::ViewerOptions& options, Words& words)
{
    app.add_flag_callback(
        "--keys", [] { throw CLI::CallForVersion(palpate::render::keysInWords(), 0); },
        "List keys and mouse actions, and exit");
    app.add_option("--session", options.session, "Name of the session (default: the only running one)");
    app.add_option("--offscreen", options.offscreen, "Write PNG files to this folder instead of opening a window");
    app.add_option("--movie", options.movie, "Write an MP4 film to this file (needs ffmpeg)");
    app.add_option("--replay", words.replay, "Show a record (train --record) instead of a running session")
        ->excludes("--session");
    app.add_option("--at", words.at,
                   "With --replay: start at this session time (3.2, 3.2s or 3200ms), where a window stands still")
        ->transform(CLI::Validator(inSeconds, ""))
        ->check(CLI::Range(0.0, 86400.0));
    app.add_option("--ghost", words.ghost,
                   "With --replay: also show the tool of this record in the same body, e.g. an expert's");
    palpate::command::addChoice(app, "--palette", words.palette,
                                "Colours of tissues: standard (as in the body), or colour-blind (with patterns in slices)",
                                {"standard", "colour-blind"});
    app.add_flag("--watch", options.watches, "Only watch: never take the session's hand, nor pause or end it");
    app.add_flag("--sounds", options.sounds, "Play sounds for warnings (in a window)");
    palpate::command::addChoice(app, "--hand", words.hand, "Hand that holds the mouse; left swaps its buttons",
                                {"right", "left"});
}

void addLookOptions(CLI::App& app, palpate::render::ViewerOptions& options, Words& words)
{
    palpate::command::addChoice(app, "--layout", words.layout,
                                "Layout: trainee, instructor, or body (the body alone, without text)",
                                {"trainee", "instructor", "body"});
    palpate::command::addChoice(app, "--slices", words.slices,
                                "Slices of a body with an image: tissue, tinted (image in the tissues' colours) or image",
                                {"tissue", "tinted", "image"});
    app.add_option("--title", options.title, "Heading of the picture (default: the scene's name)");
    app.add_flag("--ultrasound", options.ultrasound, "Start with the ultrasound picture (key U)");
    app.add_option("--images", options.images, "Folder for stored ultrasound pictures (key P)")->capture_default_str();
    app.add_option("--hide", options.concealed.tissues,
                   "For a test: draw this tissue like its surroundings, and hide the target; may be repeated");
    app.add_flag("--no-plan", options.concealed.plan, "For a test: hide the planned line and the distance to the target");
    app.add_flag("!--no-steps", options.steps, "Hide the steps that a window shows as text");
    app.add_option("--result", options.result, "Figures of the session (train --json), shown at its end");
    app.add_option("--tryout", options.tryout,
                   "Explain the controls step by step, in a tryout of this length [s] (default: no tryout)")
        ->check(CLI::Range(0.0, 3600.0));
    app.add_flag("--hidden", options.hidden, "To measure: draw as in a window, on an invisible display (Xvfb)");
    app.add_option("--timeline", words.timeline,
                   "Write the time at which each tick was shown to this file (CSV, CLOCK_MONOTONIC)");
    app.add_option("--size", words.size, "Size of the picture, WIDTHxHEIGHT [pixels]")->capture_default_str();
    palpate::command::addNumber(app, "--every", options.every, "With --offscreen: session time between two pictures [s]",
                                0.0, 86400.0);
    palpate::command::addNumber(app, "--wait", options.wait,
                                "Time to wait for a session, and to stay open after its end [s]", 0.0, 86400.0);
    app.add_option("--frames", options.frames, "End after this many pictures (0: no limit)")->capture_default_str();
    app.add_option("--json", words.json, "Write frame times to this file (- = standard output)");
}

void applyLook(const Words& words, palpate::render::ViewerOptions& options)
{
    using palpate::render::Layout;
    using palpate::render::Palette;
    using palpate::render::SliceLook;
    options.layout = words.layout == "instructor" ? Layout::instructor
                     : words.layout == "body"     ? Layout::body
                                                  : Layout::trainee;
    options.leftHanded = words.hand == "left";
    options.palette = words.palette == "standard" ? Palette::standard : Palette::colourBlind;
    options.slices = words.slices == "tissue"  ? SliceLook::tissue
                     : words.slices == "image" ? SliceLook::image
                                               : SliceLook::tinted;
}

// The time of --at. Beyond the record there is nothing to show.
double momentIn(const Words& words, palpate::apps::ReplayPlayer& player)
{
    const double length = player.playback().length;
    palpate::base::failIf(words.at > length + 1e-9, "{}: --at {:g}s: the record runs from 0 s to {:g} s", words.replay,
                          words.at, length);
    return words.at;
}

void run(Words& words, palpate::render::ViewerOptions& options)
{
    readSize(words.size, options);
    applyLook(words, options);
    const bool tryout = options.tryout > 0 && options.title.empty();
    options.title = tryout ? palpate::render::Tryout::heading() : palpate::base::tr(options.title);
    const auto ending = options.movie.extension();
    palpate::base::failIf(!options.movie.empty() && ending != ".mp4" && ending != ".MP4",
                          "{}: a film is an .mp4 file: name it so", options.movie.native());
    palpate::base::checkOutputs({words.json, words.timeline, options.movie}, {words.replay, words.ghost, options.result});
    std::optional<palpate::apps::ReplayPlayer> player;
    if (!words.replay.empty()) {
        player.emplace(words.replay);
        options.session = player->session();
        options.playback = &player->playback();
        options.record = words.replay;
        if (words.at >= 0)
            player->startAt(options.from = momentIn(words, *player));
        if (!words.ghost.empty())
            options.ghost = player->ghostOf(words.ghost);
    } else if (words.at >= 0 || !words.ghost.empty()) {
        throw palpate::base::error("--at, --ghost: need a record: add --replay RECORD");
    }
    const auto figures = palpate::render::runViewer(options);
    if (!words.json.empty())
        writeFigures(words.json, figures);
    if (!words.timeline.empty())
        writeTimeline(words.timeline, figures.shown);
    // Of a record every picture was asked for; a session that runs is watched for as long as one likes.
    const bool pictures = !options.offscreen.empty() || !options.movie.empty();
    const std::string what = options.movie.empty() ? "the pictures end" : options.movie.string() + " ends";
    const bool missing = !options.movie.empty() && !figures.filmed;
    const std::string nothing = options.movie.string() + ": there is no film: no picture had been drawn";
    if (missing && figures.signal != 0)
        throw palpate::command::Interrupted(figures.signal, "interrupted: " + nothing);
    if (player && pictures && figures.signal != 0)
        throw palpate::command::Interrupted(figures.signal, "interrupted: " + what + " before the record does");
    if (!options.movie.empty() && figures.signal != 0)
        std::fprintf(stderr, "palpate-view: interrupted: %s before the session does\n", what.c_str());
    if (player && !player->problem().empty())
        throw std::runtime_error(player->problem());
    palpate::base::failIf(missing, "{}", nothing);
}

}  // namespace

int main(int argc, char** argv)
{
    palpate::render::ViewerOptions options;
    Words words;
    palpate::base::useLanguage();
    return palpate::apps::runParsed(
        argc, argv, "palpate-view",
        "Shows a running Palpate session. --keys lists keys and mouse actions, as does the key ?.",
        [&](CLI::App& app) {
            addOptions(app, options, words);
            addLookOptions(app, options, words);
        },
        [&] { run(words, options); });
}
