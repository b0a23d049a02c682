#include <apps/session.h>

#include <datasets/scene_text.h>
#include <haptics/replay.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <memory>
#include <stdexcept>

namespace palpate::apps {

namespace {

using datasets::Scene;

void change(Scene& scene, const SceneChanges& changes)
{
    if (changes.model) {
        const auto* const at = std::find(datasets::modelLevels.begin(), datasets::modelLevels.end(), *changes.model);
        assert(at != datasets::modelLevels.end());
        scene.model.level = static_cast<datasets::ModelLevel>(at - datasets::modelLevels.begin());
    }
    if (changes.setting) {
        scene.model.setting = *changes.setting;
        scene.model.elastic = datasets::elasticSetting(*changes.setting, scene.model.elastic);
    }
    if (changes.dffb) {
        scene.dffb.mode = *changes.dffb == "off"      ? datasets::DffbMode::off
                          : *changes.dffb == "thesis" ? datasets::DffbMode::thesis
                                                      : datasets::DffbMode::field;
    }
    if (changes.target) {
        scene.target = *changes.target;
    }
    if (changes.seed) {
        scene.source.phantom.seed = *changes.seed;
    }
    if (changes.voxelsPerSide) {
        scene.source.phantom.numbers["voxels_per_side"] = *changes.voxelsPerSide;
    }
}

std::string_view levelOf(const Scene& scene)
{
    return datasets::modelLevels[static_cast<std::size_t>(scene.model.level)];
}

bool anyOf(const SceneChanges& c)
{
    return c.model || c.setting || c.dffb || c.target || c.seed || c.voxelsPerSide;
}

// The text must stay the scene: a replay is built from it.
Scene changed(Scene scene, const SceneChanges& changes, const std::string& origin)
{
    if (!anyOf(changes)) {
        return scene;
    }
    if (!scene.source.file.empty() && (changes.seed || changes.voxelsPerSide)) {
        throw std::runtime_error(
            fmt::format("{}: the volume is no phantom: {} changes nothing", origin, changes.seed ? "--seed" : "--voxels"));
    }
    change(scene, changes);
    if (changes.setting && scene.model.level != datasets::ModelLevel::elastic) {
        throw std::runtime_error(fmt::format("{}: the tissue model is {}: --setting changes nothing; add --model elastic",
                                             origin, levelOf(scene)));
    }
    return datasets::parseScene(datasets::sceneText(scene), origin);
}

Scene volumeScene(const std::filesystem::path& file, const volume::Tissue& tissue, const SceneChanges& changes)
{
    return datasets::sceneForVolume(std::filesystem::absolute(file), tissue, changes.target.value_or(""));
}

}  // namespace

volume::Tissue loadVolume(const std::filesystem::path& file)
{
    if (std::filesystem::is_directory(file)) {
        throw std::runtime_error(file.string() + ": is a folder: give a volume (.vdb)");
    }
    return volume::Tissue::load(file);
}

haptics::SessionModel openSession(const std::string& what, const SceneChanges& changes)
{
    const std::filesystem::path path(what);
    if (path.extension() == ".vdb") {
        auto tissue = std::make_shared<const volume::Tissue>(loadVolume(path));
        auto scene = changed(volumeScene(path, *tissue, changes), changes, what);
        return haptics::buildModel(std::move(scene), std::move(tissue));
    }
    auto builtIn = datasets::builtInScene(what);
    if (!builtIn && std::filesystem::is_directory(path)) {
        throw std::runtime_error(what + ": is a folder: give a scene (.toml) or a volume (.vdb)");
    }
    if (!builtIn && !std::filesystem::exists(path)) {
        throw std::runtime_error(fmt::format("{}: no such scene or volume; built-in scenes are: {}", what,
                                             fmt::join(datasets::builtInScenes(), ", ")));
    }
    auto scene = changed(builtIn ? *builtIn : datasets::loadScene(path), changes, what);
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

haptics::SessionModel reopenSession(const std::string& file, const haptics::SessionInfo& info)
{
    auto scene = datasets::parseScene(info.sceneText, info.sceneOrigin);
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    auto model = haptics::buildModel(std::move(scene), std::move(tissue));
    if (haptics::modelHash(model) != info.volumeHash) {
        throw std::runtime_error(file +
                                 ": the volume or the tissue table of this session has changed since it was "
                                 "recorded; replay it with those it was recorded with");
    }
    return model;
}

haptics::SessionInfo describeSession(const haptics::SessionModel& model, const std::string& origin,
                                     const std::string& device)
{
    haptics::SessionInfo info;
    info.scene = model.scene.name;
    info.sceneText = model.scene.text;
    info.sceneOrigin = origin;
    info.volumeHash = haptics::modelHash(model);
    info.model = levelOf(model.scene);
    info.device = device;
    info.build = PALPATE_BUILD;
    info.seed = model.scene.source.phantom.seed;
    for (const auto& s : model.structures) {
        info.structures.push_back(s.name);
        info.warnDistances.push_back(s.warnDistance);
    }
    for (const auto& row : model.tissue->table().rows) {
        info.tissues.push_back(row.name);
    }
    return info;
}

}  // namespace palpate::apps
