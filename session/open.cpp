#include <session/open.h>

#include <base/build.h>
#include <base/error.h>
#include <base/inputs.h>
#include <base/process.h>
#include <base/utc.h>
#include <datasets/insert.h>
#include <datasets/scene_text.h>
#include <haptics/replay.h>
#include <haptics/score.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <unistd.h>

#include <algorithm>
#include <array>
#include <memory>
#include <system_error>

namespace palpate::session {

namespace {

using datasets::Scene;

// The fraction of guidance in trial K of N: all in the first, none in the last.
double gainOfTrial(const std::string& trial)
{
    int k = 0, n = 0, read = 0;
    const bool two = std::sscanf(trial.c_str(), "%5d/%5d%n", &k, &n, &read) == 2;
    base::failIf(!two || static_cast<std::size_t>(read) != trial.size() || n < 2 || k < 1 || k > n,
                 "--trial {}: must be K/N, trial K of N, with N 2 or more and K from 1 to N", trial);
    return static_cast<double>(n - k) / (n - 1);
}

void changeDffb(datasets::DffbParameters& dffb, const std::string& choice, const std::optional<std::string>& trial)
{
    using datasets::DffbMode;
    if (choice == "off" || choice == "thesis") {
        dffb.mode = choice == "off" ? DffbMode::off : DffbMode::thesis;
    } else if (choice == "field" || dffb.mode == DffbMode::off) {
        dffb.mode = DffbMode::field;
    }
    if (choice == "fade" && trial) {
        dffb.gain *= gainOfTrial(*trial);
        dffb.fade = 0.0;
    } else if (choice == "fade" && dffb.fade <= 0.0) {
        dffb.fade = fadeSeconds;
    }
}

// A fingertip looks for the target instead of a needle.
void palpated(Scene& scene)
{
    scene.task = datasets::SessionTask::find;
    scene.dffb.mode = datasets::DffbMode::off;
    scene.script.clear();
    if (scene.tool.kind == datasets::ToolKind::needle) {
        scene.tool.kind = datasets::ToolKind::capsule;
        scene.tool.radius = 6e-3;
        scene.tool.length = 30e-3;
    }
}

void change(Scene& scene, const SceneChanges& changes)
{
    if (changes.model) {
        scene.model.level = datasets::modelLevelCalled(*changes.model);
    }
    if (changes.setting) {
        scene.model.setting = *changes.setting;
        scene.model.elastic = datasets::elasticSetting(*changes.setting, scene.model.elastic);
    }
    base::failIf(changes.trial && changes.dffb != "fade",
                 "--trial: says how far a study's guidance has faded: add --dffb fade");
    if (changes.dffb) {
        changeDffb(scene.dffb, *changes.dffb, changes.trial);
    }
    scene.device = changes.arm.value_or(scene.device);
    scene.source.inserts.insert(scene.source.inserts.end(), changes.inserts.begin(), changes.inserts.end());
    if (changes.palpate) {
        palpated(scene);
    }
    scene.target = changes.target.value_or(scene.target);
    std::erase_if(scene.vital, [&](const datasets::VitalStructure& vital) { return vital.name == scene.target; });
    scene.source.phantom.seed = changes.seed.value_or(scene.source.phantom.seed);
    if (changes.voxelsPerSide) {
        scene.source.phantom.numbers["voxels_per_side"] = *changes.voxelsPerSide;
    }
}

bool anyOf(const SceneChanges& c)
{
    return c.model || c.setting || c.arm || c.dffb || c.trial || c.target || c.seed || c.voxelsPerSide || c.palpate ||
           c.tool || !c.inserts.empty();
}

// The text must stay the scene: a replay is built from it.
Scene changed(Scene scene, SceneChanges changes, const std::string& origin)
{
    const bool elastic = changes.model.value_or(std::string(name(scene.model.level))) == "elastic";
    if (changes.fit && elastic && !changes.setting && !scene.model.settingNamed) {
        changes.setting = changes.fit(scene);
    }
    if (!anyOf(changes)) {
        return scene;
    }
    const bool idleSeed = changes.seed && !changes.seedElsewhere;
    base::failIf(!scene.source.file.empty() && (idleSeed || changes.voxelsPerSide),
                 "{}: the volume is no phantom: {} changes nothing", origin, idleSeed ? "--seed" : "--voxels");
    change(scene, changes);
    base::failIf(changes.setting && scene.model.level != datasets::ModelLevel::elastic,
                 "{}: the tissue model is {}: --setting changes nothing; add --model elastic", origin,
                 name(scene.model.level));
    Scene again = datasets::parseScene(datasets::sceneText(scene), origin);
    again.tissueChanges = scene.tissueChanges;  // the same, with their lines in the file
    if (changes.tool) {
        again.tool = changes.tool(again.tool);
    }
    return again;
}

// The volume with the lesion of --lesion-from in it, which becomes the target where no other is asked for.
volume::Tissue withLesion(volume::Tissue tissue, SceneChanges& changes)
{
    if (!changes.lesion) {
        return tissue;
    }
    changes.inserts.push_back(datasets::placeLesion(tissue, changes.lesion->from, changes.lesion->shape));
    changes.target = changes.target.value_or(changes.lesion->shape.name);
    return datasets::withInserts(tissue, changes.inserts);
}

// A record or a label map where a scene is asked for: as a scene it would be refused for its first byte.
void refuseNoScene(const std::filesystem::path& file)
{
    const std::filesystem::path end = file.extension() == ".gz" ? file.stem().extension() : file.extension();
    base::failIf(end == ".db",
                 "{}: is no scene: a record is shown by 'palpate-view --replay' and scored by 'palpate score'; give a "
                 "scene (.toml) or a volume (.vdb)",
                 file.native());
    constexpr std::array<const char*, 9> labels{".nii", ".hdr", ".img", ".nrrd", ".nhdr", ".mha", ".mhd", ".mgz", ".dcm"};
    base::failIf(std::ranges::find(labels, end) != labels.end(),
                 "{}: is no scene: 'palpate import' makes a volume (.vdb) of a label map first", file.native());
}

// What a record's scene reads: where it was, or beside the record, if both were moved. The volume's hash in the record
// tells whether it is that one.
std::filesystem::path fileOfRecord(const std::string& record, const std::filesystem::path& file)
{
    std::error_code none;
    if (file.empty() || std::filesystem::exists(file, none)) {
        return file;
    }
    const std::filesystem::path beside = std::filesystem::path(record).parent_path() / file.filename();
    base::failIf(!std::filesystem::exists(beside, none),
                 "{}: its session reads {}, which is not there: bring it back, or copy it beside the record", record,
                 file.native());
    return beside;
}

}  // namespace

volume::Tissue loadVolume(const std::filesystem::path& file)
{
    std::error_code none;
    base::failIf(std::filesystem::is_directory(file, none), "{}: is a folder: give a volume (.vdb)", file.native());
    return volume::Tissue::load(file);
}

haptics::SessionModel openSession(const std::string& what, SceneChanges changes)
{
    const std::filesystem::path path(what);
    if (path.extension() == ".vdb") {
        auto alone = loadVolume(path);
        auto tissue = std::make_shared<const volume::Tissue>(withLesion(std::move(alone), changes));
        // What is no session aims at nothing. A scene has a target all the same: the largest structure, without a way to
        // it.
        const bool aims = !changes.tool || changes.target || !datasets::lesionOf(*tissue).empty();
        if (!aims) {
            changes.target = datasets::largestStructure(*tissue);
            base::failIf(changes.target->empty(), "{}: the volume holds no tissue, only air: import one with tissue", what);
        }
        auto scene = changed(
            datasets::sceneForVolume(std::filesystem::absolute(path), *tissue, changes.target.value_or("")), changes, what);
        auto model = haptics::buildModel(std::move(scene), std::move(tissue), !changes.tool);
        model.approach.isPlanned = model.approach.isPlanned && aims;
        return model;
    }
    base::failIf(changes.lesion.has_value(),
                 "{}: --lesion-from {}: needs the phantom's volume (.vdb) for SCENE; `palpate import` makes it", what,
                 changes.lesion ? changes.lesion->from.string() : "");
    auto builtIn = datasets::builtInScene(what);
    std::error_code none;
    base::failIf(!builtIn && std::filesystem::is_directory(path, none),
                 "{}: is a folder: give a scene (.toml) or a volume (.vdb)", what);
    if (!builtIn && std::filesystem::is_symlink(path, none) && !std::filesystem::exists(path, none)) {
        throw base::error("{}: {}", what, base::whyNoFile(path));
    }
    base::failIf(!builtIn && !std::filesystem::exists(path, none), "{}: no such scene or volume; built-in scenes are: {}",
                 what, fmt::join(datasets::builtInScenes(), ", "));
    if (!builtIn) {
        refuseNoScene(path);
    }
    auto scene = changed(builtIn ? *builtIn : datasets::loadScene(path), changes, what);
    scene.source.phantom.memory = changes.memory;
    return haptics::buildModel(std::move(scene), !changes.tool);
}

std::string widerCells(const haptics::SessionModel& model)
{
    constexpr double rounding = 1e-9;  // relative
    const datasets::ModelSettings& asked = model.scene.model;
    const bool isElastic = asked.level == datasets::ModelLevel::elastic;
    const double wanted = isElastic ? asked.elastic.spacing : asked.spacing, has = model.lattice.grid.spacing;
    return has <= (1.0 + rounding) * wanted ? ""
                                            : fmt::format(
                                                  "the body has cells of {:.4g} mm: with the {:g} mm of [{}] spacing_mm it "
                                                  "would have over 4 million",
                                                  1e3 * has, 1e3 * wanted, isElastic ? "model.elastic" : "model");
}

haptics::SessionModel reopenSession(const std::string& file, const haptics::SessionInfo& info)
{
    Scene scene = datasets::parseRecordedScene(info.sceneText, info.sceneOrigin);
    scene.source.file = fileOfRecord(file, scene.source.file);
    scene.tissues = fileOfRecord(file, scene.tissues).string();
    const std::string changed = fmt::format(
        "{}: the volume or the tissue table of this session has changed since it was recorded; replay it with those it was "
        "recorded with{}",
        file, scene.source.file.empty() ? "" : fmt::format(" (now {})", scene.source.file.native()));
    auto model = [&] {
        try {
            return haptics::buildModel(scene);
        } catch (const std::runtime_error& e) {
            // Another volume may lack what the scene aims at.
            throw scene.source.file.empty() ? std::runtime_error(e.what()) : base::error("{}: {}", changed, e.what());
        }
    }();
    base::failIf(haptics::modelHash(model) != info.volumeHash, "{}", changed);
    const std::string contradiction = haptics::contradictionIn(info, model);
    base::failIf(!contradiction.empty(), "{}: was changed: {}", file, contradiction);
    return model;
}

void startHere(haptics::SessionInfo& info)
{
    info.host = base::hostName();
    info.started = base::utc();
}

haptics::SessionInfo describeSession(const haptics::SessionModel& model, const std::string& origin,
                                     const std::string& device)
{
    haptics::SessionInfo info = haptics::infoOf(model);
    info.sceneOrigin = origin;
    info.device = device;
    info.build = std::string(base::build());
    startHere(info);
    info.seed = model.scene.source.phantom.seed;
    return info;
}

}  // namespace palpate::session
