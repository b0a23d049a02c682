#include <apps/command.h>

#include <apps/figures.h>
#include <apps/measures.h>
#include <apps/outputs.h>
#include <apps/report.h>
#include <apps/session.h>
#include <apps/trainer.h>
#include <apps/viewer_process.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

constexpr double longestSession = 86400.0;  // [s]
constexpr double picturesTimeout = 60.0;    // after the end of a session [s]

struct Options {
    std::string scene = "breast";
    SceneChanges changes;
    std::string device = "hand";
    bool view = false;
    bool noView = false;
    bool unpaced = false;
    double seconds = 0;
    std::string session;
    std::string record, report, json, pictures;
};

nlohmann::json coreFigures(const TrainResult& result, const haptics::SessionInfo& info)
{
    auto cores = nlohmann::json::array();
    for (const auto& core : result.cores) {
        nlohmann::json fraction = nlohmann::json::object();
        for (std::size_t i = 0; i < info.tissues.size(); ++i) {
            if (core.fraction[i] > 0.0) {
                fraction[info.tissues[i]] = core.fraction[i];
            }
        }
        cores.push_back({{"fraction", fraction},
                         {"target_fraction", core.targetFraction},
                         {"length_in_lesion_mm", 1e3 * core.targetLength},
                         {"volume_mm3", 1e9 * core.volume}});
    }
    return cores;
}

nlohmann::json figuresOf(const TrainResult& result, const haptics::SessionInfo& info)
{
    auto figures = timingFigures(result.timing);
    figures["scene"] = info.scene;
    figures["model"] = info.model;
    figures["device"] = info.device;
    figures["build"] = info.build;
    figures["contacts"] = result.contacts;
    figures["punctures"] = result.punctures;
    figures["peak_force_n"] = {
        {"basic", result.peakBasic}, {"additional", result.peakAdditional}, {"total", result.peakTotal}};
    nlohmann::json nearest = nlohmann::json::object();
    for (std::size_t i = 0; i < info.structures.size(); ++i) {
        nearest[info.structures[i]] = 1e3 * result.nearest[i];
    }
    figures["nearest_mm"] = nearest;
    figures["score"] = scoreFigures(result.score);
    figures["core"] = coreFigures(result, info);
    figures["force_hash"] = hexadecimal(result.forceHash);
    figures["peak_memory_mb"] = peakMemoryMb();
    figures["lost_records"] = result.lostRecords;
    figures["warnings"] = result.warnings;
    return figures;
}

void summarise(const TrainResult& result, const haptics::SessionInfo& info)
{
    const auto tick = result.timing.work.percentiles();
    const auto late = result.timing.lateness.percentiles();
    fmt::print(
        "{} ticks, {} missed; a tick takes {:.0f} us (p50), {:.0f} us (p99); late by {:.1f} us (p50), {:.0f} us (p99)\n",
        result.timing.ticks, result.timing.missed, 1e6 * tick.p50, 1e6 * tick.p99, 1e6 * late.p50, 1e6 * late.p99);
    fmt::print("peak force {:.2f} N (tissue {:.2f} N, guidance {:.2f} N)\n", result.peakTotal, result.peakBasic,
               result.peakAdditional);
    for (std::size_t i = 0; i < result.cores.size(); ++i) {
        const auto& core = result.cores[i];
        fmt::print("core {}: {:.0f} % {}, {:.1f} mm of it in the {}\n", i + 1, 100.0 * core.targetFraction,
                   info.structures[0], 1e3 * core.targetLength, info.structures[0]);
    }
    for (const auto& [label, value] : haptics::describe(result.score)) {
        fmt::print("  {:<28} {}\n", label, value);
    }
}

bool wantsWindow(const Options& o)
{
    return o.view || (!o.noView && !o.unpaced && std::getenv("DISPLAY") != nullptr);
}

std::string sessionName(const Options& o)
{
    return o.session.empty() ? fmt::format("train-{}", getpid()) : o.session;
}

// A report is made from a record: without --record it lies beside the report.
fs::path recordFile(const Options& o)
{
    if (!o.record.empty()) {
        return o.record;
    }
    return o.report.empty() ? fs::path() : fs::path(o.report).replace_extension(".db");
}

// Everything that would fail at the end of a session for a reason that is there at its beginning.
void checkOutputs(const Options& o)
{
    checkOutput(o.json);
    checkOutput(o.report);
    checkOutputFolder(o.pictures);
    const auto record = recordFile(o);
    checkOutput(record);
    if (!record.empty() && fs::exists(record)) {
        throw std::runtime_error(record.string() + ": exists already; choose another name or remove it" +
                                 (o.record.empty() ? " (the record beside the report)" : ""));
    }
    if (!o.report.empty() && record == fs::path(o.report)) {
        throw std::runtime_error(o.report + ": would be record and report in one: call the report .html");
    }
}

struct Viewers {
    std::optional<ViewerProcess> window, camera;
};

void startViewers(const Options& o, const std::string& session, Viewers& viewers)
{
    if (wantsWindow(o)) {
        viewers.window.emplace(std::vector<std::string>{"--session", session, "--wait", "30"});
    }
    if (!o.pictures.empty()) {
        viewers.camera.emplace(std::vector<std::string>{"--session", session, "--wait", "30", "--offscreen", o.pictures});
    }
}

// Writes all that was asked for, whatever of it fails, and adds what failed to the problem of `result`.
void writeOutputs(const Options& o, const haptics::SessionInfo& info, Viewers& viewers, TrainResult& result)
{
    const auto blame = [&result](const std::string& what) {
        result.problem += result.problem.empty() ? what : "; " + what;
    };
    const auto attempt = [&blame](const auto& write) {
        try {
            write();
        } catch (const std::runtime_error& e) {
            blame(e.what());
        }
    };
    if (viewers.camera && viewers.camera->wait(picturesTimeout) != 0) {
        blame(o.pictures + ": the pictures are not complete: the viewer failed or took too long");
    }
    if (!o.json.empty()) {
        attempt([&] { writeJson(o.json, figuresOf(result, info)); });
    }
    if (!o.report.empty()) {
        const fs::path pictures = fs::is_directory(o.pictures) ? o.pictures : "";  // not there when the viewer failed
        attempt([&] { writeReport(o.report, haptics::Record(recordFile(o)), pictures); });
    }
}

void train(const Options& o)
{
    checkOutputs(o);
    const auto record = recordFile(o);
    const auto model = openSession(o.scene, o.changes);
    const auto info = describeSession(model, o.scene, o.device);
    const TrainOptions options{o.device, sessionName(o), record, {!o.unpaced, o.seconds}};

    // Before the record is made, so that a viewer that cannot be started leaves none.
    Viewers viewers;
    startViewers(o, options.session, viewers);
    Trainer trainer(model, info, options);
    TrainResult result = trainer.run();
    writeOutputs(o, info, viewers, result);

    if (o.json != "-") {
        summarise(result, info);
        for (const auto& [name, file] : {std::pair<const char*, std::string>{"report", o.report},
                                         {"record", record.string()},
                                         {"pictures", o.pictures}}) {
            if (!file.empty()) {
                fmt::print("{}: {}\n", name, file);
            }
        }
    }
    if (!result.problem.empty()) {
        throw std::runtime_error(result.problem);
    }
}

// Empty, or what is wrong with a value of --seconds.
std::string secondsFault(const std::string& text)
{
    double seconds = -1.0;
    const bool number = CLI::detail::lexical_cast(text, seconds);
    // The negation also catches what is not a number.
    return !number || !(seconds >= 0.0 && seconds <= longestSession)
               ? fmt::format("{}: must be 0 to {:g} s (0: to the end of the script)", text, longestSession)
               : "";
}

}  // namespace

void addTrain(CLI::App& app)
{
    auto o = std::make_shared<Options>();
    auto* c = app.add_subcommand("train", "Perform a procedure: a built-in scene, a scene file or a volume");
    c->add_option("SCENE", o->scene, "breast, layered, block, plate, pair; a scene (.toml) or a volume (.vdb)")
        ->capture_default_str();
    c->add_option("--device", o->device, "hand (a scripted trainee), or a record (.db) whose poses are played")
        ->capture_default_str();
    c->add_option("--model", o->changes.model, "Level of the tissue model")->check(CLI::IsMember(datasets::modelLevels));
    c->add_option("--setting", o->changes.setting, "How fine level elastic is")
        ->check(CLI::IsMember(datasets::elasticSettings()));
    c->add_option("--dffb", o->changes.dffb, "Differential force feedback")
        ->check(CLI::IsMember({"off", "thesis", "field"}));
    c->add_option("--target", o->changes.target, "Structure to sample");
    c->add_option("--seed", o->changes.seed, "Every random choice of a phantom")->check(CLI::NonNegativeNumber);
    c->add_option("--seconds", o->seconds, "End after this much session time [s]")->check(secondsFault, "0 to 86400");
    auto* unpaced = c->add_flag("--unpaced", o->unpaced, "As fast as it goes instead of one tick per millisecond");
    c->add_flag("--view", o->view, "Open a window (default where there is a display)")->excludes(unpaced);
    c->add_flag("--no-view,--headless", o->noView, "No window")->excludes("--view");
    c->add_option("--session", o->session, "Name under which viewers find the session");
    c->add_option("--record", o->record, "Record every tick to this file (SQLite)");
    c->add_option("--report", o->report, "Write a report (HTML) to this file");
    c->add_option("--pictures", o->pictures, "Write pictures (PNG) to this folder")->excludes(unpaced);
    c->add_option("--json", o->json, "Write figures to this file (- = standard output, and nothing else there)");
    c->final_callback([o] { train(*o); });
}

}  // namespace palpate::apps
