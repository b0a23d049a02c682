#include <apps/command.h>

#include <apps/figures.h>
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

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

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

nlohmann::json scoreFigures(const haptics::Score& s)
{
    return {{"total", s.total},
            {"seconds", s.seconds},
            {"path_length_mm", 1e3 * s.pathLength},
            {"inserted_path_mm", 1e3 * s.insertedPath},
            {"mean_force_n", s.meanForce},
            {"skin_contacts", s.skinContacts},
            {"redirects", s.redirects},
            {"passes", s.passes},
            {"targeting_error_mm", s.passes > 0 ? nlohmann::json(1e3 * s.targetingError) : nlohmann::json(nullptr)},
            {"best_target_fraction", s.bestTargetFraction},
            {"best_target_length_mm", 1e3 * s.bestTargetLength},
            {"vital_contacts", s.vitalContacts},
            {"vital_seconds", s.vitalSeconds},
            {"vital_depth_mm", 1e3 * s.vitalDepth},
            {"warnings", s.warnings}};
}

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

void startViewers(const Options& o, const std::string& session, std::optional<ViewerProcess>& window,
                  std::optional<ViewerProcess>& camera)
{
    if (wantsWindow(o)) {
        window.emplace(std::vector<std::string>{"--session", session, "--wait", "30"});
    }
    if (!o.pictures.empty()) {
        camera.emplace(std::vector<std::string>{"--session", session, "--wait", "30", "--offscreen", o.pictures});
    }
}

void train(const Options& o)
{
    const auto record = recordFile(o);
    if (!record.empty() && fs::exists(record)) {
        throw std::runtime_error(record.string() + ": exists already; choose another name or remove it");
    }
    const auto model = openSession(o.scene, o.changes);
    const auto info = describeSession(model, o.scene, o.device);
    TrainOptions options{o.device, sessionName(o), record, {!o.unpaced, o.seconds}};

    std::optional<ViewerProcess> window, camera;
    Trainer trainer(model, info, options);
    startViewers(o, options.session, window, camera);
    const TrainResult result = trainer.run();

    summarise(result, info);
    if (camera && camera->wait(60.0) != 0) {
        fmt::print(stderr, "palpate: {}: the pictures are not complete: the viewer ended early\n", o.pictures);
    }
    if (!o.json.empty()) {
        writeJson(o.json, figuresOf(result, info));
    }
    if (!o.report.empty()) {
        writeReport(o.report, haptics::Record(record), o.pictures);
        fmt::print("report: {}\n", o.report);
    }
    if (!record.empty()) {
        fmt::print("record: {}\n", record.string());
    }
    if (!o.pictures.empty()) {
        fmt::print("pictures: {}\n", o.pictures);
    }
    if (!result.problem.empty()) {
        throw std::runtime_error(result.problem);
    }
}

}  // namespace

void addTrain(CLI::App& app)
{
    auto o = std::make_shared<Options>();
    auto* c = app.add_subcommand("train", "Perform a procedure: a built-in scene, a scene file or a volume");
    c->add_option("SCENE", o->scene, "breast, layered, block; a scene (.toml) or a volume (.vdb)")->capture_default_str();
    c->add_option("--device", o->device, "hand (a scripted trainee), or a record (.db) whose poses are played")
        ->capture_default_str();
    c->add_option("--model", o->changes.model, "Level of the tissue model")->check(CLI::IsMember({"spring", "chainmail"}));
    c->add_option("--dffb", o->changes.dffb, "Differential force feedback")
        ->check(CLI::IsMember({"off", "thesis", "field"}));
    c->add_option("--target", o->changes.target, "Structure to sample");
    c->add_option("--seed", o->changes.seed, "Every random choice of a phantom");
    c->add_option("--seconds", o->seconds, "End after this much session time [s]")->check(CLI::PositiveNumber);
    auto* unpaced = c->add_flag("--unpaced", o->unpaced, "As fast as it goes instead of one tick per millisecond");
    c->add_flag("--view", o->view, "Open a window (default where there is a display)")->excludes(unpaced);
    c->add_flag("--no-view,--headless", o->noView, "No window")->excludes("--view");
    c->add_option("--session", o->session, "Name under which viewers find the session");
    c->add_option("--record", o->record, "Record every tick to this file (SQLite)");
    c->add_option("--report", o->report, "Write a report (HTML) to this file");
    c->add_option("--pictures", o->pictures, "Write pictures (PNG) to this folder")->excludes(unpaced);
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o] { train(*o); });
}

}  // namespace palpate::apps
