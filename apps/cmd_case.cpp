#include <apps/command.h>
#include <apps/listed.h>
#include <apps/viewers.h>
#include <base/child_process.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/shell_word.h>
#include <base/temporary_folder.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <session/devices.h>
#include <session/open.h>
#include <session/session.h>
#include <training/case.h>
#include <training/folders.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>
#include <string>
#include <vector>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using training::Case;

constexpr double pictureTimeout = 600;  // [s]
constexpr const char* pictureSize = "800x600";

struct CaseArguments {
    std::string id;
    fs::path json, picture;
    training::NewCase made;
};

nlohmann::json figuresOfCase(const Case& c)
{
    return {{"id", c.id},
            {"title", c.title},
            {"folder", c.folder.string()},
            {"scene", c.scene},
            {"picture", c.picture.string()},
            {"difficulty", c.difficulty},
            {"trains", c.trains},
            {"measures", c.measures},
            {"briefing", c.briefing},
            {"licence", c.licence},
            {"source", c.source}};
}

void list(const CaseArguments& o)
{
    const auto all = listed("cases", training::allCases);
    command::writeJson(o.json, {{"cases", base::mapped<nlohmann::json>(all, figuresOfCase)}});
    if (o.json != "-") {
        fmt::print("{:<22} {:<10}  {}\n", "case", "difficulty", "title: what it trains");
        for (const Case& c : all) {
            fmt::print("{:<22} {} of {}      {}: {}\n", c.id, c.difficulty, training::hardest, c.title,
                       fmt::join(c.trains, ", "));
        }
    }
}

void show(const CaseArguments& o)
{
    const Case c = training::findCase(o.id);
    command::writeJson(o.json, figuresOfCase(c));
    if (o.json == "-") {
        return;
    }
    fmt::print("{} ({})\ndifficulty {} of {}; trains {}\n", c.title, c.id, c.difficulty, training::hardest,
               fmt::join(c.trains, ", "));
    int step = 0;
    for (const std::string& sentence : c.briefing) {
        fmt::print("  {}. {}\n", ++step, sentence);
    }
    fmt::print("measures that matter: {}\nscene: {}\npicture: {}\nlicence: {}\n", fmt::join(c.measures, ", "), c.scene,
               c.picture.empty() ? "none" : c.picture.string(), c.licence);
    if (!c.source.empty()) {
        fmt::print("source: {}\n", c.source);
    }
    fmt::print("palpate train --case {}\n", base::shellWord(o.id));
}

void check(const CaseArguments& o)
{
    const Case c = training::findCase(o.id);
    command::Progress progress(command::Progress::Clock::ticking);
    progress.show("opening " + c.id);
    const auto faults = training::faultsOf(c);
    progress.clear();
    for (const std::string& fault : faults) {
        fmt::print("{}\n", fault);
    }
    if (c.picture.empty()) {
        fmt::print("{}: a hint: there is no picture; palpate case picture {} makes one\n",
                   (c.folder / training::caseFile).string(), base::shellWord(o.id));
    }
    base::failIf(!faults.empty(), "{}: {} {}", o.id, faults.size(), faults.size() == 1 ? "fault" : "faults");
    fmt::print("{}: good\n", c.id);
}

void make(const CaseArguments& o)
{
    command::Progress progress(command::Progress::Clock::ticking);
    progress.show("reading " + o.made.volume.string());
    const Case c = training::makeCase(o.made);
    progress.clear();
    fmt::print("{}: made; edit its case.toml, then palpate case picture and palpate case check\n", c.folder.string());
}

// The beginning of a session of the scripted hand: the tool before the body. Returns what is not to be seen.
std::vector<std::string> recordBeginning(const Case& c, const fs::path& file)
{
    const haptics::SessionModel model = session::openSession(c.scene, {});
    const haptics::SessionInfo info = session::describeSession(model, c.scene, "hand");
    session::DeviceRequest request;
    const auto device = session::openDevice(model, request, nullptr);
    haptics::Recorder recorder(file, info);
    session::Session session(model, info);
    session::RunOptions options;
    options.servo.paced = false;
    options.servo.seconds = 0.2;
    options.recorder = &recorder;
    session.run(*device, options);
    recorder.finish({});
    return tissuesToFind(model);
}

void draw(const CaseArguments& o)
{
    const Case c = training::findCase(o.id);
    const fs::path to = o.picture.empty() ? c.folder / "picture.png" : o.picture;
    base::checkOutput(to);
    const base::TemporaryFolder folder("the session that is drawn");
    command::Progress progress(command::Progress::Clock::ticking);
    progress.show("drawing " + c.id);
    const auto hidden = recordBeginning(c, folder.path() / "session.db");
    const fs::path pictures = folder.path() / "pictures";
    std::vector<std::string> words{"--replay",    (folder.path() / "session.db").string(),
                                   "--offscreen", pictures.string(),
                                   "--size",      pictureSize,
                                   "--layout",    "body",
                                   "--frames",    "1"};
    for (const std::string& tissue : hidden) {
        words.insert(words.end(), {"--hide", tissue});
    }
    base::ChildProcess viewer(base::programFolder() / "palpate-view", words, "build it with -DPALPATE_VIEWER=ON");
    std::vector<fs::path> drawn;
    if (viewer.wait(pictureTimeout) == 0) {
        for (const auto& entry : fs::directory_iterator(pictures)) {
            drawn.push_back(entry.path());
        }
    }
    base::failIf(drawn.empty(), "{}: the viewer drew no picture, or took too long", c.id);
    fs::copy_file(drawn.front(), to, fs::copy_options::overwrite_existing);
    progress.clear();
    fmt::print("{}\n", to.string());
    if (c.picture.empty() && o.picture.empty()) {
        training::namePicture(c, to.filename().string());
    }
}

}  // namespace

void addCase(CLI::App& app)
{
    auto o = std::make_shared<CaseArguments>();
    CLI::App* const c = app.add_subcommand("case", "List, show, make and check cases for trainees");
    c->require_subcommand(1);
    CLI::App* const all = c->add_subcommand("list", "List cases");
    all->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    all->final_callback([o] { list(*o); });

    const auto one = [&](const char* name, const char* what) {
        CLI::App* const sub = c->add_subcommand(name, what);
        sub->add_option("CASE", o->id, "Name or folder of the case")->required();
        return sub;
    };
    CLI::App* const shown = one("show", "Show briefing, picture and scene of a case");
    shown->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    shown->final_callback([o] { show(*o); });
    one("check", "Check a case and list its faults; exit status 1 if there are any")->final_callback([o] { check(*o); });
    CLI::App* const picture = one("picture", "Draw the picture of a case, the body with the needle in front of it");
    picture->add_option("-o,--output", o->picture, "File to write (.png; default: picture.png in the case's folder)");
    picture->final_callback([o] { draw(*o); });

    CLI::App* const made = c->add_subcommand("new", "Make a case from a volume");
    made->add_option("VOLUME", o->made.volume, "Volume (.vdb)")->required();
    made->add_option("-o,--output", o->made.folder, "Folder of the case; must not exist")->required();
    made->add_option("--title", o->made.title, "Title, a few words");
    made->add_option("--target", o->made.target, "Structure to sample (default: the first tumour)");
    command::addNumber(*made, "--difficulty", o->made.difficulty, "Difficulty, 1 to 5", 1, training::hardest);
    made->add_option("--licence", o->made.licence, "Licence of the volume");
    made->final_callback([o] { make(*o); });
}

}  // namespace palpate::apps
