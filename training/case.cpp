#include <training/case.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/nearest.h>
#include <base/png.h>
#include <datasets/scene.h>
#include <datasets/toml_section.h>
#include <haptics/measures.h>
#include <session/open.h>
#include <training/folders.h>
#include <training/toml_lists.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <stdexcept>

namespace palpate::training {

namespace fs = std::filesystem;
using datasets::Section;

namespace {

// A file that the case names: inside its folder, so that the folder can be given away.
fs::path fileIn(const Section& top, const Case& made, std::string_view key, const std::string& name)
{
    const fs::path file(name);
    top.refuseIf(file.is_absolute() || file.lexically_normal().native().starts_with(".."), key,
                 "must lie in the case's folder");
    top.refuseIf(!fs::is_regular_file(made.folder / file), key,
                 fmt::format("there is no such file in {}", made.folder.string()));
    return made.folder / file;
}

void readScene(Section& top, Case& made)
{
    const auto scene = top.word("scene");
    const auto volume = top.word("volume");
    top.missingIf(!scene && !volume, "scene",
                  "a built-in scene, or a file (.toml) in the folder; or volume = \"FILE.vdb\"");
    top.refuseIf(scene && volume, "volume", "there is a scene too: the scene names its volume itself");
    if (volume) {
        made.scene = fileIn(top, made, "volume", *volume).string();
        return;
    }
    if (fs::path(*scene).extension() == ".toml") {
        made.scene = fileIn(top, made, "scene", *scene).string();
        return;
    }
    const auto builtIn = datasets::builtInScenes();
    top.refuseIf(std::ranges::find(builtIn, *scene) == builtIn.end(), "scene",
                 "there is no such built-in scene" + base::meant(*scene, builtIn));
    made.scene = *scene;
}

bool isPng(const fs::path& file)
{
    std::ifstream in(file, std::ios::binary);
    std::string head(base::pngSignature.size(), '\0');
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    return in && head == base::pngSignature;
}

// A volume alone has the standard biopsy on it.
datasets::Scene sceneOf(const Case& made)
{
    auto builtIn = datasets::builtInScene(made.scene);
    const bool volume = fs::path(made.scene).extension() == ".vdb";
    return builtIn ? *builtIn : volume ? datasets::Scene() : datasets::loadScene(made.scene);
}

// Empty, or what a scene is that its sessions never have this measure.
std::string lackOf(const datasets::Scene& scene, const std::string& key)
{
    using Task = datasets::SessionTask;
    using Listed = haptics::Measure::Listed;
    const auto measures = haptics::measures();
    const Listed listed = std::ranges::find(measures, key, &haptics::Measure::key)->listed;
    const bool ofMarks = key.starts_with("mark"), ofCores = listed == Listed::ifFired || key == "passes";
    if ((ofMarks && scene.task != Task::find) || (ofCores && scene.task != Task::biopsy) ||
        (listed == Listed::ifTouch && scene.task != Task::touch) ||
        (listed == Listed::ifAdvance && scene.task != Task::advance)) {
        constexpr std::array tasks{"biopsy", "palpation", "touch of the skin", "way in without a core"};
        return tasks[static_cast<std::size_t>(scene.task)];
    }
    if (key == "vital_margin_mm") {
        // Of the needle's tip inside.
        if (scene.task == Task::find || scene.task == Task::touch || scene.tool.kind != datasets::ToolKind::needle) {
            return "session without a needle in the tissue";
        }
        if (scene.vital.empty()) {
            return "scene without [[vital]]";
        }
    }
    if (listed == Listed::ifProbe && scene.probe.kind == datasets::ProbeKind::none) {
        return "scene without [probe]";
    }
    return listed == Listed::ifCt && scene.ct.slices == 0 ? "scene without [ct]" : "";
}

}  // namespace

void checkMeasure(const Section& section, std::string_view key, const std::string& measure)
{
    const auto keys = base::mapped<std::string>(haptics::measures(), &haptics::Measure::key);
    section.refuseIf(
        std::ranges::find(keys, measure) == keys.end(), key,
        fmt::format("there is no measure {}{}", measure, base::meant(measure, keys, " (docs/score.md lists them)")));
}

std::string called(Section& section, std::string_view key, std::string_view what)
{
    const auto word = section.word(key);
    section.missingIf(!word, key, what);
    return *word;
}

Case loadCase(const fs::path& given)
{
    Case made;
    const fs::path folder = given.filename() == caseFile ? given.parent_path() : given;
    made.folder = fs::absolute(folder.empty() ? fs::path(".") : folder).lexically_normal();
    if (!made.folder.has_filename()) {  // "case/"
        made.folder = made.folder.parent_path();
    }
    made.id = made.folder.filename().string();
    const fs::path file = made.folder / caseFile;
    const toml::table table = datasets::parseToml(datasets::readText(file), file.string());
    Section top(table, file.string(), "");
    made.title = called(top, "title", "a few words");
    readScene(top, made);
    if (const auto picture = top.word("picture")) {
        made.picture = fileIn(top, made, "picture", *picture);
    }
    const auto difficulty = top.integer("difficulty", "", 1, hardest);
    top.missingIf(!difficulty, "difficulty", "1 to 5");
    made.difficulty = static_cast<int>(*difficulty);
    made.briefing = top.words("briefing");
    top.missingIf(made.briefing.empty(), "briefing", "a list of the task's steps, a sentence each");
    made.trains = top.words("trains");
    made.measures = top.words("measures");
    for (const std::string& measure : made.measures) {
        checkMeasure(top, "measures", measure);
    }
    made.licence = called(top, "licence", "who may use the case and its volume, e.g. \"CC0-1.0\"");
    made.source = top.word("source").value_or("");
    top.finish();
    return made;
}

bool isCaseFolder(const fs::path& what)
{
    std::error_code none;
    return fs::is_regular_file(what / caseFile, none);
}

std::vector<Case> allCases(std::vector<std::string>* faults)
{
    auto all = loadedOf<Case>("cases", isCaseFolder, loadCase, faults);
    std::ranges::sort(all, [](const Case& a, const Case& b) {
        return a.difficulty != b.difficulty ? a.difficulty < b.difficulty : a.title < b.title;
    });
    return all;
}

Case findCase(const std::string& id)
{
    if (isCaseFolder(id) || fs::path(id).filename() == caseFile) {
        return loadCase(id);
    }
    const bool name = !id.empty() && id.find('/') == std::string::npos;
    for (const fs::path& folder : dataFolders("cases")) {
        if (name && isCaseFolder(folder / id)) {
            return loadCase(folder / id);
        }
    }
    std::error_code none;
    base::failIf(fs::is_directory(id, none), "{}: no case: there is no {} in it", id, caseFile);
    throw base::error("{}: there is no such case{} (palpate case list)", id,
                      base::meant(id, base::mapped<std::string>(allCases(), &Case::id)));
}

std::string sceneName(const Case& of)
{
    const fs::path scene(of.scene);
    return scene.extension() == ".vdb" ? scene.stem().string() : sceneOf(of).name;
}

std::string measureFault(const Case& of, const std::string& measure)
{
    const std::string lack = lackOf(sceneOf(of), measure);
    return lack.empty() ? "" : fmt::format("{} has no value in case {}: it is a {}", measure, of.id, lack);
}

std::vector<std::string> faultsOf(const Case& made)
{
    std::vector<std::string> faults;
    const std::string file = (made.folder / caseFile).string();
    const auto add = [&](const std::string& what) { faults.push_back(file + ": " + what); };
    if (!made.picture.empty() && !isPng(made.picture)) {
        add(fmt::format("picture: {} is no PNG", made.picture.filename().string()));
    }
    if (made.trains.empty()) {
        add("trains: is missing: say what the case trains");
    }
    if (made.measures.empty()) {
        add("measures: is missing: name the measures that matter");
    }
    if (made.licence.starts_with("not stated")) {
        add("licence: is not stated");
    }
    try {
        const haptics::SessionModel model = session::openSession(made.scene, {});
        for (const std::string& key : made.measures) {
            if (const std::string lack = lackOf(model.scene, key); !lack.empty()) {
                add(fmt::format("measures: {} has no value in a {}", key, lack));
            }
        }
    } catch (const std::runtime_error& e) {
        faults.emplace_back(e.what());
    }
    return faults;
}

}  // namespace palpate::training
