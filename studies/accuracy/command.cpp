#include <base/build.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/shell_word.h>
#include <base/temporary_folder.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <session/open.h>
#include <studies/accuracy/conforming.h>
#include <studies/accuracy/deep.h>
#include <studies/accuracy/figures.h>
#include <studies/accuracy/references.h>
#include <studies/accuracy/rival.h>
#include <studies/commands.h>
#include <studies/kernel/kernel_trial.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <iterator>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr double quickSeconds = 20.0;  // per case of --quick

struct AccuracyArguments {
    std::vector<std::string> scenes, volumes, methods;
    std::vector<std::string> laws{"linear", "neo-hookean"};
    std::string folder, references, json;
    double maxSeconds = 60;  // per case
    std::vector<std::string> rivals;
    std::vector<double> rivalSpacings{4};  // [mm]
    double rivalSeconds = 600;             // per scene and mesh
    bool quick = false, verify = false, depth = false;
    std::vector<std::string> settings = DeepCommand{}.settings;  // of --depth
    double speed = DeepCommand{}.speed;                          // the same [mm/s]
};

struct Known {
    const char* name;
    const char* program;  // of ours
    const char* needs;    // another one; "" = none
    const char* setting;
    std::vector<double> spacings;  // [m]
};

const Known known[]{{"bullet", "palpate-rival-bullet", "", "explicit, Poisson 0.45", {6e-3, 4e-3}},
                    {"calculix", "palpate-rival-calculix", "ccx", "quadratic", {12e-3, 8e-3}}};

// Solvers of others for which we have a program, and which are installed here: Bullet's deformable bodies and CalculiX.
std::vector<Rival> installedRivals()
{
    std::vector<Rival> rivals;
    for (const Known& k : known) {
        const std::filesystem::path program = ourProgram(k.program);
        if (!program.empty() && (*k.needs == '\0' || !ourProgram(k.needs).empty())) {
            rivals.push_back({k.name, base::shellWord(program.string()), k.setting, k.spacings});
        }
    }
    return rivals;
}

// A subject with its references, one per law.
struct Solved {
    std::string scene;
    AccuracySubject subject;
    std::vector<SolvedReference> references;
};

// A method at one of its settings, or a rival on one of its meshes.
struct Case {
    Baseline method;
    const Rival* rival = nullptr;
    double spacing = 0;  // of the rival's mesh [m]

    // In the log: a rival's answer is one to its command and the files in it, too.
    std::string key(const ReferenceInfo& info) const
    {
        return rival == nullptr ? info.key : fmt::format("{}|{}", info.key, fingerprint(*rival));
    }
};

// A file's name without folder and ending: it is part of the pictures' names.
std::string shortName(const std::string& what)
{
    return std::filesystem::path(what).stem().string();
}

// All of ours; conforming tetrahedra where palpate-mesh is installed: asked for by name, or all methods without --quick.
std::vector<Baseline> methodsOf(const AccuracySubject& subject, const AccuracyArguments& o)
{
    std::vector<Baseline> methods = accuracyMethods(subject);
    const std::filesystem::path mesher = ourProgram("palpate-mesh");
    const bool wanted = std::ranges::find(o.methods, "tets_conforming") != o.methods.end();
    if (!mesher.empty() && (wanted || !o.quick)) {
        std::ranges::move(conformingMethods(subject, mesher), std::back_inserter(methods));
    }
    return methods;
}

// Throws for a name of --methods that neither these nor an installed rival has.
void checkMethods(const std::vector<Baseline>& all, const AccuracyArguments& o)
{
    std::set<std::string> names;
    std::ranges::transform(all, std::inserter(names, names.end()), &Baseline::method);
    std::ranges::transform(installedRivals(), std::inserter(names, names.end()), &Rival::name);
    for (const std::string& name : o.methods) {
        base::failIf(!names.contains(name), "--methods {}: there is no such method; there are {}", name,
                     fmt::join(names, ", "));
    }
}

Solved solved(const std::string& what, const AccuracyArguments& o, command::Progress& progress)
{
    progress.show(what + ": volume");
    session::SceneChanges changes;
    changes.model = "spring";  // each method makes its own body
    auto model = std::make_shared<const haptics::SessionModel>(session::openSession(what, changes));
    Solved out{shortName(what), accuracySubject(std::move(model)), {}};
    checkMethods(methodsOf(out.subject, o), o);  // before minutes of solving
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

// What is run of all methods, in their order.
std::vector<Baseline> chosen(std::vector<Baseline> all, const AccuracyArguments& o)
{
    std::set<std::string> taken;
    std::erase_if(all, [&](const Baseline& b) {
        const bool wanted = o.methods.empty() || std::ranges::find(o.methods, b.method) != o.methods.end();
        const bool named = b.setting == "fast" || b.setting == "default";
        const bool ours = b.method.starts_with("elastic");
        const bool first = taken.insert(b.method).second;
        return !wanted || (o.quick && !(ours ? named : first));
    });
    return all;
}

std::vector<Rival> rivalsOf(const AccuracyArguments& o)
{
    const auto spacings = base::mapped<double>(o.rivalSpacings, [&](const double mm) { return 1e-3 * mm; });
    std::vector<Rival> rivals;
    for (const std::string& text : o.rivals) {
        Rival rival = rivalOf(text, spacings);
        base::failIf(std::ranges::find(rivals, rival.name, &Rival::name) != rivals.end(),
                     "--rival {}: there is another one called {}: write NAME=COMMAND", text, rival.name);
        rivals.push_back(std::move(rival));
    }
    return rivals;
}

bool asked(const Rival& rival, const AccuracyArguments& o)
{
    return std::ranges::any_of(o.rivals, [&](const std::string& text) { return rivalOf(text, {}).name == rival.name; });
}

// Those that were asked for, and those that are installed: without --quick all, but for the names of the former.
std::vector<Rival> allRivals(const AccuracyArguments& o)
{
    std::vector<Rival> rivals = rivalsOf(o);
    for (Rival& rival : installedRivals()) {
        const bool wanted = std::ranges::find(o.methods, rival.name) != o.methods.end();
        if (!asked(rival, o) && (wanted || (o.methods.empty() && !o.quick))) {
            rivals.push_back(std::move(rival));
        }
    }
    return rivals;
}

std::vector<Case> casesOf(const Solved& s, const std::vector<Rival>& rivals, const AccuracyArguments& o)
{
    std::vector<Baseline> methods = methodsOf(s.subject, o);
    for (const Rival& rival : rivals) {
        base::failIf(std::ranges::find(methods, rival.name, &Baseline::method) != methods.end(),
                     "--rival: {} is a method of this command: write another NAME=COMMAND", rival.name);
    }
    auto cases = base::mapped<Case>(chosen(std::move(methods), o), [&](Baseline& method) {
        return Case{std::move(method), nullptr, 0};
    });
    for (const Rival& rival : rivals) {
        const bool first = o.quick && !asked(rival, o);
        for (const double spacing : std::span(rival.spacings).first(first ? 1 : rival.spacings.size())) {
            cases.push_back({{rival.name, settingOf(rival, spacing), nullptr}, &rival, spacing});
        }
    }
    return cases;
}

AccuracyRun run(const Solved& s, const Case& what, std::span<const Reference* const> references, const AccuracyArguments& o)
{
    if (what.rival == nullptr) {
        return runAccuracy(what.method, s.subject, references, o.maxSeconds);
    }
    const auto answered = [&](const std::filesystem::path& folder) {
        return runRival(*what.rival, what.spacing, s.scene, s.subject, references, folder, o.rivalSeconds);
    };
    if (o.folder.empty()) {
        const base::TemporaryFolder folder("the files of a rival");
        return answered(folder.path());
    }
    return answered(std::filesystem::path(o.folder) / "rivals" / what.rival->name /
                    fmt::format("{}-{:g}mm", s.scene, 1e3 * what.spacing));
}

// Runs a case against those references that the log does not have, and logs it. Returns how many. What has failed may have
// been mended, or has another limit now.
std::size_t runMissing(const Solved& s, const Case& what, const AccuracyArguments& o, AccuracyLog& log)
{
    std::vector<const SolvedReference*> missing;
    std::vector<const Reference*> references;
    for (const SolvedReference& r : s.references) {
        const json* const done = log.find(what.key(r.second), what.method.method, what.method.setting);
        if (done == nullptr || done->contains("failure")) {
            missing.push_back(&r);
            references.push_back(&r.first);
        }
    }
    if (missing.empty()) {
        return 0;
    }
    const AccuracyRun result = run(s, what, references, o);
    for (std::size_t i = 0; i < missing.size(); ++i) {
        const ReferenceInfo& info = missing[i]->second;
        json entry =
            accuracyEntry(s.scene, info.law, what.method, result, result.results.empty() ? nullptr : &result.results[i]);
        if (what.rival != nullptr) {
            entry["rival"] = what.rival->command;
        }
        log.add(what.key(info), entry);
    }
    return missing.size();
}

void addScene(const Solved& s, const std::vector<Case>& cases, const AccuracyLog& log, json& figures)
{
    const auto linear = std::ranges::find(s.references, "linear", [](const SolvedReference& r) { return r.second.law; });
    for (const SolvedReference& r : s.references) {
        json entry = referenceEntry(r.second);
        entry["scene"] = s.scene;
        figures["references"].push_back(entry);
        for (const Case& c : cases) {
            if (const json* done = log.find(c.key(r.second), c.method.method, c.method.setting)) {
                figures["chart"].push_back(*done);
                figures["chart"].back()["scene"] = s.scene;
            }
        }
        if (linear != s.references.end() && r.second.law != "linear") {
            figures["floors"].push_back(
                floorEntry(s.scene, r.second.law, errorsBetween(linear->first, r.first, s.subject.path, s.subject.speed)));
        }
    }
}

std::vector<Solved> solveAll(const AccuracyArguments& o, const std::vector<std::string>& subjects,
                             command::Progress& progress)
{
    std::vector<Solved> all;
    for (const std::string& what : subjects) {
        base::failIf(std::ranges::find(all, shortName(what), &Solved::scene) != all.end(),
                     "{}: there is another scene called {} in this run: rename one", what, shortName(what));
        all.push_back(solved(what, o, progress));
    }
    std::erase_if(all, [](const Solved& s) { return s.references.empty(); });
    base::failIf(all.empty(), "no scene has a reference: see the lines above");
    return all;
}

json runAll(const AccuracyArguments& o, const std::vector<std::string>& subjects)
{
    const std::vector<Rival> rivals = allRivals(o);
    command::Progress progress;
    const std::vector<Solved> all = solveAll(o, subjects, progress);
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
        const std::vector<Case> cases = casesOf(all[i], rivals, o);
        for (std::size_t m = 0; m < cases.size(); ++m) {
            const Baseline& b = cases[m].method;
            progress.show(fmt::format("scene {} of {}, method {} of {}: {}: {}{}{}", i + 1, all.size(), m + 1, cases.size(),
                                      all[i].scene, b.method, b.setting.empty() ? "" : ", ", b.setting));
            ran += runMissing(all[i], cases[m], o, log);
        }
        addScene(all[i], cases, log, figures);
    }
    progress.clear();
    figures["cases_run"] = ran;
    figures["cases_resumed"] = figures["chart"].size() - ran;
    markFronts(figures);
    return figures;
}

// A rival that failed is in the table with its reason and spoils nothing else; but --rival asked for it.
void checkRivals(const json& figures, const AccuracyArguments& o)
{
    std::set<std::string> names, failures;  // laws of one run share their failures
    std::ranges::transform(rivalsOf(o), std::inserter(names, names.end()), &Rival::name);
    for (const json& e : figures["chart"]) {
        if (e.contains("failure") && names.contains(e["method"].get<std::string>())) {
            failures.insert(fmt::format("rival {}, {}, {}: {}", e["method"].get<std::string>(),
                                        e["scene"].get<std::string>(), e["setting"].get<std::string>(),
                                        e["failure"].get<std::string>()));
        }
    }
    base::failIf(!failures.empty(), "{}", fmt::join(failures, "; "));
}

void checkLaws(const AccuracyArguments& o)
{
    base::failIf(o.laws.empty(), "--law: name one of {}, or more", fmt::join(volume::lawNames, ", "));
    for (const std::string& law : o.laws) {
        base::failIf(!volume::lawNamed(law), "--law {}: there is no such law; there are {}", law,
                     fmt::join(volume::lawNames, ", "));
    }
}

void accuracyCommand(AccuracyArguments o)
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
        o.maxSeconds = std::min(o.maxSeconds, quickSeconds);
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
    command::writeJson(o.json, figures);
    checkRivals(figures, o);
}

}  // namespace

void addAccuracy(CLI::App& app)
{
    auto o = std::make_shared<AccuracyArguments>();
    auto* accuracy = app.add_subcommand(
        "accuracy", "Compare error and time per tick of Palpate and of other methods with finite elements, in charts");
    accuracy->add_option("-o,--output", o->folder,
                         "Folder for charts (PNG, HTML), CSV and JSON; an interrupted run resumes there");
    accuracy
        ->add_option(
            "--scenes", o->scenes,
            "Scenes: built-in names or files (default: block, layered, plate, pair, breast; with --depth all stored)")
        ->delimiter(',');
    accuracy->add_option("--volume", o->volumes, "Volumes (.vdb)")->delimiter(',');
    accuracy->add_option("--methods", o->methods, "Methods by name, e.g. elastic,xpbd,bullet (default: all)")
        ->delimiter(',');
    accuracy->add_option(
        "--references", o->references,
        "Folder of references, searched first, where new ones are stored (default: ~/.cache/palpate/references)");
    accuracy->add_option("--law", o->laws, "Material laws of the references")->delimiter(',')->capture_default_str();
    command::addNumber(*accuracy, "--limit", o->maxSeconds,
                       "Maximum time of a method in one scene [s]; a slower method is left out", 1.0, 1e6);
    auto* rival = accuracy->add_option(
        "--rival", o->rivals,
        "External solver of the same push, as COMMAND or NAME=COMMAND; may be repeated (docs/accuracy.md)");
    rival->allow_extra_args(false);
    accuracy->add_option("--rival-mesh-mm", o->rivalSpacings, "Spacings of the meshes for --rival [mm]")
        ->delimiter(',')
        ->check(CLI::Range(1.0, 50.0))
        ->capture_default_str()
        ->needs(rival);
    command::addNumber(*accuracy, "--rival-limit", o->rivalSeconds, "Maximum time of a rival in one scene on one mesh [s]",
                       1.0, 1e6);
    accuracy->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    accuracy->add_flag("--quick", o->quick, "Only few methods, scenes block and plate: a minute");
    auto* verify = accuracy->add_flag("--verify", o->verify, "No charts: compare kernel and reference with closed forms");
    auto* depth = accuracy->add_flag(
        "--depth", o->depth,
        "Compare the force alone, from first touch to two radii deep and back, with stored finite elements");
    for (const char* const charts : {"--rival", "--volume", "--methods", "--law", "--references", "--limit"}) {
        depth->excludes(accuracy->get_option(charts));
        verify->excludes(accuracy->get_option(charts));
    }
    for (const char* const written : {"--output", "--scenes", "--depth"}) {
        verify->excludes(accuracy->get_option(written));
    }
    accuracy->add_option("--settings", o->settings, "With --depth: settings of level elastic")
        ->delimiter(',')
        ->capture_default_str()
        ->needs(depth);
    command::addNumber(*accuracy, "--speed", o->speed, "With --depth: speed of the tool [mm/s]", 1.0, 1000.0)->needs(depth);
    accuracy->final_callback([o] { accuracyCommand(*o); });
}

}  // namespace palpate::studies
