#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <datasets/scene_text.h>
#include <haptics/recorder.h>
#include <session/open.h>
#include <studies/commands.h>
#include <studies/stability/figures.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <vector>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr std::uint64_t ticksPerFlush = 256;

// The scene as a file would have it: its volume is one.
haptics::SessionModel modelIn(const StabilityScene& scene, const std::string& device, datasets::ModelLevel level,
                              const std::filesystem::path& volume)
{
    auto session = scene.session;
    session.model.level = level;
    session.device = device;
    session.source.file = volume;
    auto parsed = datasets::parseScene(datasets::sceneText(session), volume);
    return haptics::buildModel(std::move(parsed));
}

// Where the volume of a record goes.
std::filesystem::path volumeBeside(const std::filesystem::path& record)
{
    base::failIf(record.extension() != ".db", "{}: is no name of a record: it must end in .db", record.native());
    auto volume = std::filesystem::absolute(record).lexically_normal();
    return volume.replace_extension(".vdb");
}

// Runs a cell once more and records it as a session that `palpate replay` and the viewer play; its volume is written beside
// it. Baselines: poses and forces; `replay` then says where Palpate's forces differ from theirs.
CellResult recordCell(const Cell& cell, const StabilityModels& models, const std::filesystem::path& file)
{
    const auto& scene = models.scene(cell.scene);
    const auto& method = models.method(cell.method);
    const auto volume = volumeBeside(file);
    for (const auto& there : {file, volume}) {
        base::failIf(std::filesystem::exists(there), "{}: exists already; choose another name or remove it",
                     there.native());
    }
    scene.tissue->save(volume);
    const auto model = modelIn(scene, cell.device, method.level, volume);
    auto info = session::describeSession(model, volume.string(), cell.device);
    info.rate = cell.rate;
    info.extra.emplace_back("stability_cell", cell.id());
    haptics::Recorder recorder(file, info);
    std::uint64_t ticks = 0;
    const Trace trace = runSession(cell, scene, method, model,
                                   [&](const haptics::DeviceSample& sample, Vec3 force, const RunningMethod& running) {
                                       haptics::TickRecord record;
                                       if (running.record) {
                                           record = *running.record();
                                       } else {
                                           record.tick = ticks;
                                           record.device = sample;
                                           record.proxy = sample.position;
                                           record.basic = record.total = force;
                                       }
                                       recorder.push(record);
                                       if (++ticks % ticksPerFlush == 0) {
                                           recorder.flush();
                                       }
                                   });
    recorder.finish({});
    base::failIf(!recorder.error().empty(), "{}: {}", file.native(), recorder.error());
    const Bounded bounded = cell.held ? scene.held : scene.released;
    return {cell, bounded, figureOf(bounded.figure, trace, scene)};
}

constexpr std::size_t maxNamed = 6;  // failed cells in the last line

struct StabilityArguments {
    std::string folder, json, cell, record;
    MatrixChoice choice;
    std::uint64_t seed = 1, fuzz = 0;
    int jobs = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    bool fuzzOnly = false;
};

json runCells(const StabilityArguments& o, StabilityModels& models, command::Progress& progress)
{
    const auto cells = matrixCells(models, o.choice);
    base::failIf(
        cells.empty(),
        "no cell is left: the needle pierces tissue in these scenes, and none of these methods supports that: choose "
        "others");
    progress.show("models of the scenes");
    models.prepare(cells);
    std::vector<CellResult> results(cells.size());
    onThreads(
        cells.size(), o.jobs, [&](std::size_t i) { results[i] = runCell(cells[i], models); },
        [&](std::size_t done) { progress.show(fmt::format("{} of {} cells", done, cells.size())); });
    return base::mapped<json>(results, cellEntry);
}

// Throws for cells of the default method that fail.
void checkCells(const json& cells, const StabilityModels& models)
{
    const std::string& ours = models.methods().front().name;
    std::vector<std::string> failed;
    for (const json& cell : cells) {
        if (cell.at("method") == ours && !cell.at("pass").get<bool>()) {
            failed.push_back(cell.at("id"));
        }
    }
    if (!failed.empty()) {
        const std::size_t count = failed.size();
        const std::string more = count > maxNamed ? fmt::format(" and {} more", count - maxNamed) : "";
        failed.resize(std::min(count, maxNamed));
        throw base::error("{} cell{} of the default method failed: {}{}", count, count == 1 ? "" : "s",
                          fmt::join(failed, ", "), more);
    }
}

// Throws for hostile sessions that fail.
void checkFuzz(const json& fuzzed)
{
    for (const char* const key : {"crashes", "over_cap", "over_slew", "non_finite", "pulled"}) {
        base::failIf(fuzzed.at(key) != 0, "hostile sessions: {} = {}: see failed_seeds in the figures (--json)", key,
                     fuzzed.at(key).dump());
    }
}

void recordOne(const StabilityArguments& o, StabilityModels& models)
{
    const Cell cell = cellOf(models, o.cell);
    models.prepare({cell});
    const CellResult r = o.record.empty() ? runCell(cell, models) : recordCell(cell, models, o.record);
    const json cells = json::array({cellEntry(r)});
    command::writeJson(o.json, {{"cells", cells}});
    if (o.json != "-") {
        fmt::print("{}: {} {:.4g} {}, bound {:g}: {}\n", o.cell, name(r.bounded.figure), r.figure, unit(r.bounded.figure),
                   r.bounded.bound, r.pass() ? "pass" : "FAIL");
    }
    checkCells(cells, models);
}

void stabilityCommand(const StabilityArguments& o)
{
    std::vector<std::filesystem::path> outputs{o.json};
    if (!o.record.empty()) {
        outputs.insert(outputs.end(), {o.record, volumeBeside(o.record)});
    }
    base::checkOutputs(outputs, {});
    base::checkOutputFolder(o.folder);
    base::failIf(o.cell.empty() && !o.record.empty(), "--record: needs a cell: add --case SCENE/METHOD/DEVICE/GRIP/RATE");
    StabilityModels models;
    if (!o.cell.empty()) {
        recordOne(o, models);
        return;
    }
    command::Progress progress;
    json figures{{"cells", json::array()},
                 {"theory", json::array()},
                 {"limits", json::array()},
                 {"fuzz", fuzzEntry({})},
                 {"seed", o.seed}};
    if (!o.fuzzOnly) {
        figures["cells"] = runCells(o, models, progress);
        progress.show("limits against formulas");
        addTheory(figures);
    }
    if (o.fuzz > 0) {
        const auto told = [&](std::size_t done) { progress.show(fmt::format("{} of {} hostile sessions", done, o.fuzz)); };
        figures["fuzz"] = fuzzEntry(fuzz(models, o.seed, o.fuzz, o.jobs, told));
    }
    progress.clear();
    if (o.json != "-") {
        printStability(figures);
        if (o.fuzz > 0) {
            fmt::print("\nhostile sessions: {}\n", figures["fuzz"].dump());
        }
    }
    if (!o.folder.empty()) {
        writeStabilityFolder(o.folder, figures);
    }
    command::writeJson(o.json, figures);
    checkCells(figures.at("cells"), models);
    checkFuzz(figures.at("fuzz"));
}

}  // namespace

void addStability(CLI::App& app)
{
    auto o = std::make_shared<StabilityArguments>();
    auto* c = app.add_subcommand(
        "stability", "Find where haptic methods fail: scenes, methods, devices, grips and rates, compared with bounds");
    c->add_option("-o,--output", o->folder, "Folder for stability.html, .json, .csv and charts (PNG)");
    c->add_option("--scenes", o->choice.scenes, "Scenes or kinds of scenes by name, e.g. plate,slide (default: all)")
        ->delimiter(',');
    c->add_option("--methods", o->choice.methods, "Methods by name, e.g. elastic,god_object (default: all)")
        ->delimiter(',');
    c->add_option("--devices", o->choice.devices, "Simulated devices: premium, touch, falcon (default: all)")
        ->delimiter(',');
    auto* rates = c->add_option("--rates", o->choice.rates, "Rates of the force loop [Hz]")
                      ->delimiter(',')
                      ->check(CLI::Range(100, 20000))
                      ->capture_default_str();
    c->add_flag("--quick", o->choice.quick, "Some scenes, one device, 1 kHz: under a minute");
    auto* fuzzed = c->add_option("--fuzz", o->fuzz, "Also run this many hostile sessions of Palpate's own levels")
                       ->check(CLI::Range(1, 100'000'000));
    c->add_flag("--fuzz-only", o->fuzzOnly, "Run only the hostile sessions")->needs(fuzzed);
    c->add_option("--seed", o->seed, "Seed of the hostile sessions")
        ->capture_default_str()
        ->check(command::seedFault, "a whole number");
    auto* one = c->add_option("--case", o->cell, "Run one cell, by its id");
    for (const char* const ofMatrix :
         {"--output", "--scenes", "--methods", "--devices", "--rates", "--quick", "--fuzz", "--fuzz-only", "--seed"}) {
        one->excludes(c->get_option(ofMatrix));
    }
    c->add_option("--record", o->record, "With --case: record it as a session (.db), its volume beside it (.vdb)");
    command::addNumber(*c, "--jobs", o->jobs, "Number of threads (default: all cores); the figures do not depend on it", 1,
                       1024);
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o, rates] {
        if (o->choice.quick && rates->count() == 0) {
            o->choice.rates = {1000};
        }
        stabilityCommand(*o);
    });
}

}  // namespace palpate::studies
