#include <studies/accuracy/command.h>

#include <base/build.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/progress.h>
#include <session/open.h>
#include <studies/accuracy/deep.h>
#include <studies/accuracy/figures.h>
#include <studies/accuracy/log.h>
#include <studies/accuracy/references.h>
#include <studies/accuracy/verify.h>
#include <studies/kernel/trial_errors.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr double quickSeconds = 20.0;  // per case of --quick

struct Options {
    std::vector<std::string> scenes, volumes, methods;
    std::vector<std::string> laws{"linear", "neo-hookean"};
    std::string folder, references, json;
    double mostSeconds = 60;  // per case
    bool quick = false, verify = false, depth = false;
    std::vector<std::string> settings = DeepCommand{}.settings;  // of --depth
    double speed = DeepCommand{}.speed;                          // the same [mm/s]
};

// A subject with its references, one per law.
struct Solved {
    std::string scene;
    AccuracySubject subject;
    std::vector<SolvedReference> references;
};

// A file's name without folder and ending: it is part of the pictures' names.
std::string shortName(const std::string& what)
{
    return std::filesystem::path(what).stem().string();
}

Solved solved(const std::string& what, const Options& o, command::Progress& progress)
{
    progress.show(what + ": volume");
    session::SceneChanges changes;
    changes.model = "spring";  // each method makes its own body
    auto model = std::make_shared<const haptics::SessionModel>(session::openSession(what, changes));
    Solved out{shortName(what), accuracySubject(std::move(model)), {}};
    const ReferenceFolders folders = referenceFolders(o.references);
    const auto tell = [&](const std::string& now) {
        progress.clear();
        fmt::print(stderr, "{}\n", now);
    };
    const bool asked = !o.scenes.empty() || !o.volumes.empty();
    for (const std::string& law : o.laws) {
        try {
            out.references.push_back(solvedReference(what, out.subject, law, folders, tell));
        } catch (const std::runtime_error& e) {
            if (asked) {
                throw;
            }
            tell(fmt::format("left out: {}", e.what()));
        }
    }
    return out;
}

// What is run of all methods, in their order. Throws for a name that there is none of.
std::vector<Baseline> chosen(std::vector<Baseline> all, const Options& o)
{
    std::set<std::string> names, taken;
    for (const Baseline& b : all) {
        names.insert(b.method);
    }
    for (const std::string& name : o.methods) {
        if (!names.contains(name)) {
            throw std::runtime_error(
                fmt::format("--methods {}: there is none; there are {}", name, fmt::join(names, ", ")));
        }
    }
    std::erase_if(all, [&](const Baseline& b) {
        const bool wanted = o.methods.empty() || std::ranges::find(o.methods, b.method) != o.methods.end();
        const bool named = b.setting == "fast" || b.setting == "default";
        const bool ours = b.method.starts_with("elastic");
        const bool first = taken.insert(b.method).second;
        return !wanted || (o.quick && !(ours ? named : first));
    });
    return all;
}

std::string caseName(const std::string& scene, const Baseline& method)
{
    return fmt::format("{}: {}{}{}", scene, method.method, method.setting.empty() ? "" : ", ", method.setting);
}

// Runs a method against those references that the log does not have, and logs it. Returns how many.
std::size_t runMissing(const Solved& s, const Baseline& method, const Options& o, AccuracyLog& log)
{
    std::vector<const SolvedReference*> missing;
    std::vector<const Reference*> references;
    for (const SolvedReference& r : s.references) {
        if (log.find(r.second.key, method.method, method.setting) == nullptr) {
            missing.push_back(&r);
            references.push_back(&r.first);
        }
    }
    if (missing.empty()) {
        return 0;
    }
    const AccuracyRun run = runAccuracy(method, s.subject, references, o.mostSeconds);
    for (std::size_t i = 0; i < missing.size(); ++i) {
        const ReferenceInfo& info = missing[i]->second;
        log.add(info.key, accuracyEntry(s.scene, info.law, method, run, run.results.empty() ? nullptr : &run.results[i]));
    }
    return missing.size();
}

void addScene(const Solved& s, const std::vector<Baseline>& methods, const AccuracyLog& log, json& figures)
{
    const SolvedReference* laws[2]{};
    for (const SolvedReference& r : s.references) {
        laws[r.second.law == "linear" ? 0 : 1] = &r;
        json entry = referenceEntry(r.second);
        entry["scene"] = s.scene;
        figures["references"].push_back(entry);
        for (const Baseline& method : methods) {
            if (const json* done = log.find(r.second.key, method.method, method.setting)) {
                figures["chart"].push_back(*done);
                figures["chart"].back()["scene"] = s.scene;
            }
        }
    }
    if (laws[0] != nullptr && laws[1] != nullptr) {
        figures["floors"].push_back(
            floorEntry(s.scene, errorsBetween(laws[0]->first, laws[1]->first, s.subject.path, s.subject.speed)));
    }
}

json runAll(const Options& o, const std::vector<std::string>& subjects)
{
    command::Progress progress;
    std::vector<Solved> all;
    for (const std::string& what : subjects) {
        if (std::ranges::find(all, shortName(what), &Solved::scene) != all.end()) {
            throw std::runtime_error(
                fmt::format("{}: there is another scene called {} in this run: rename one", what, shortName(what)));
        }
        all.push_back(solved(what, o, progress));
    }
    std::erase_if(all, [](const Solved& s) { return s.references.empty(); });
    if (all.empty()) {
        throw std::runtime_error("no scene has a reference: see the lines above");
    }
    std::filesystem::path file;
    if (!o.folder.empty()) {
        std::filesystem::create_directories(o.folder);
        file = std::filesystem::path(o.folder) / "cases.jsonl";
    }
    AccuracyLog log(file, std::string(base::build()));
    json figures{{"build", std::string(base::build())},
                 {"chart", json::array()},
                 {"floors", json::array()},
                 {"references", json::array()},
                 {"verification", json::array()}};
    std::size_t ran = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
        const auto methods = chosen(accuracyMethods(all[i].subject), o);
        for (std::size_t m = 0; m < methods.size(); ++m) {
            progress.show(fmt::format("scene {} of {}, method {} of {}: {}", i + 1, all.size(), m + 1, methods.size(),
                                      caseName(all[i].scene, methods[m])));
            ran += runMissing(all[i], methods[m], o, log);
        }
        addScene(all[i], methods, log, figures);
    }
    progress.clear();
    figures["cases_run"] = ran;
    figures["cases_resumed"] = figures["chart"].size() - ran;
    markFronts(figures);
    return figures;
}

void checkLaws(const Options& o)
{
    if (o.laws.empty()) {
        throw std::runtime_error("--law: name linear, neo-hookean, or both");
    }
    for (const std::string& law : o.laws) {
        if (law != "linear" && law != "neo-hookean") {
            throw std::runtime_error(fmt::format("--law {}: there is none; there are linear, neo-hookean", law));
        }
    }
}

void accuracyCommand(Options o)
{
    base::checkOutput(o.json);
    base::checkOutputFolder(o.folder);
    checkLaws(o);
    if (o.verify) {
        verifyCommand(o.quick, o.json);
        return;
    }
    if (o.depth) {
        deepCommand({o.scenes, o.settings, o.speed, o.quick, o.folder, o.json});
        return;
    }
    if (o.quick) {
        o.mostSeconds = std::min(o.mostSeconds, quickSeconds);
    }
    std::vector<std::string> subjects = o.scenes;
    if (subjects.empty() && o.volumes.empty()) {
        subjects = o.quick ? std::vector<std::string>{"block", "plate"}
                           : std::vector<std::string>{"block", "layered", "plate", "pair", "breast"};
    }
    subjects.insert(subjects.end(), o.volumes.begin(), o.volumes.end());
    const json figures = runAll(o, subjects);
    if (o.json != "-") {
        printAccuracy(figures);
    }
    if (!o.folder.empty()) {
        const auto pictures = writeAccuracyFolder(o.folder, figures);
        if (o.json != "-") {
            fmt::print("\n{} cases ({} from before) in {}: accuracy.html, accuracy.csv, accuracy.json, {} pictures\n",
                       figures["chart"].size(), figures["cases_resumed"].get<std::size_t>(), o.folder, pictures.size());
        }
    }
    if (!o.json.empty()) {
        command::writeJson(o.json, figures);
    }
}

}  // namespace

void addAccuracy(CLI::App& app)
{
    auto o = std::make_shared<Options>();
    auto* accuracy = app.add_subcommand(
        "accuracy", "Charts error against time per tick: Palpate, and what others would use, against finite elements");
    accuracy->add_option("-o,--output", o->folder,
                         "Folder for charts (PNG, HTML), CSV and JSON; a run that was stopped goes on there");
    accuracy->add_option("--scenes", o->scenes, "Scenes: built-in names or files (default: all built-in)")->delimiter(',');
    accuracy->add_option("--volume", o->volumes, "Volumes (.vdb)")->delimiter(',');
    accuracy->add_option("--methods", o->methods, "Methods by name, e.g. elastic,xpbd (default: all)")->delimiter(',');
    accuracy->add_option("--references", o->references,
                         "Folder of solved references, and for new ones (default: ~/.cache/palpate/references)");
    accuracy->add_option("--law", o->laws, "Laws of the references")->delimiter(',')->capture_default_str();
    accuracy
        ->add_option("--limit", o->mostSeconds, "Most seconds for a method's ticks in one scene; beyond, it is left out")
        ->check(CLI::Range(1.0, 1e6))
        ->capture_default_str();
    accuracy->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    accuracy->add_flag("--quick", o->quick, "Few methods, scenes block and plate: a minute");
    accuracy->add_flag("--verify", o->verify, "No charts: our kernel and the reference against closed forms");
    auto* depth = accuracy->add_flag(
        "--depth", o->depth, "The force alone: first touch, two radii deep and back, against stored finite elements");
    accuracy->add_option("--settings", o->settings, "With --depth: settings of level elastic")
        ->delimiter(',')
        ->capture_default_str()
        ->needs(depth);
    accuracy->add_option("--speed", o->speed, "With --depth: of the tool [mm/s]")
        ->check(CLI::Range(1.0, 1000.0))
        ->capture_default_str()
        ->needs(depth);
    accuracy->final_callback([o] { accuracyCommand(*o); });
}

}  // namespace palpate::studies
