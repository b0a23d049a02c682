#include <apps/command.h>

#include <apps/train_attempts.h>
#include <apps/train_figures.h>
#include <apps/train_profile.h>
#include <apps/viewers.h>
#include <base/error.h>
#include <base/memory.h>
#include <base/outputs.h>
#include <base/temporary_folder.h>
#include <base/user_files.h>
#include <base/words.h>
#include <command/interrupted.h>
#include <command/json.h>
#include <command/options.h>
#include <haptics/trainee.h>
#include <report/report.h>
#include <session/falcon.h>
#include <session/faults.h>
#include <session/machine.h>
#include <session/open.h>
#include <session/rehearsal.h>
#include <session/trainer.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;

constexpr double longestSession = 86400.0;  // [s]
constexpr double picturesTimeout = 60.0;    // after the end of a session [s]
constexpr double laterTimeout = 600.0;  // for pictures that are drawn of the record, and ten times what the session took

struct TrainArguments {
    std::string scene = "breast";
    bool sceneGiven = false;
    session::SceneChanges changes;
    std::string device = "hand";
    session::FalconOptions falcon;
    std::string trainee;
    std::string task, lesionFrom;
    TrainingOptions training;
    double lesionDiameter = 10;  // [mm]
    bool sphere = false;
    std::string layout = "trainee", palette = "standard";
    bool sounds = false;
    bool view = false;
    bool noView = false;
    bool showTarget = false;  // of a palpation
    bool closeAtEnd = false;  // the window, instead of showing the result
    bool tryout = false;
    bool unpaced = false;
    bool anyway = false;
    double seconds = 0;
    std::string session, operatorName;
    std::string record, report, json, pictures;
    std::shared_ptr<base::Descriptor> room;  // for the figures, until they are written
    bool ownRecord = true;                   // false: a record only for the pictures, which is removed
    std::vector<std::string> inject;
    session::Faults faults;  // what `inject` says
};

bool wantsWindow(const TrainArguments& o)
{
    return o.view || (!o.noView && !o.unpaced && std::getenv("DISPLAY") != nullptr);
}

std::string sessionName(const TrainArguments& o)
{
    return o.session.empty() ? fmt::format("train-{}", getpid()) : o.session;
}

// A report is made from a record: without --record it lies beside the report.
fs::path recordFile(const TrainArguments& o)
{
    const bool besideReport = o.record.empty() && !o.report.empty();
    return besideReport ? fs::path(o.report).replace_extension(".db") : fs::path(o.record);
}

// Pictures of a record are those of its events, on a machine that is busy too, and no second viewer is beside the servo
// loop.
bool drawsLater(const TrainArguments& o)
{
    const bool live = recordFile(o).empty() || session::has(o.faults, session::FaultKind::stallViewer);
    return !o.pictures.empty() && (o.unpaced || !live);
}

// What would strike nothing would show nothing.
void checkFaults(const TrainArguments& o)
{
    const auto need = [&](std::initializer_list<session::FaultKind> kinds, bool there, const char* hint) {
        for (const session::FaultKind kind : kinds) {
            base::failIf(session::has(o.faults, kind) && !there, "--inject: {}", hint);
        }
    };
    need({session::FaultKind::gap, session::FaultKind::late}, !o.unpaced,
         "gap and late need a paced session: leave out --unpaced");
    need({session::FaultKind::stallViewer}, wantsWindow(o) || (!o.pictures.empty() && !o.unpaced),
         "stall-viewer stops the viewers that the session starts: add --view or --pictures");
    need({session::FaultKind::diskFull}, !recordFile(o).empty(), "disk-full needs a record: add --record");
}

void checkDevice(const TrainArguments& o)
{
    const session::DeviceKind& device = session::deviceKind(o.device);
    base::failIf(!o.trainee.empty() && o.device != "hand",
                 "--trainee {}: needs --device hand; mouse, falcon and record bring their own hand", o.trainee);
    base::failIf(device.somebodyHolds && o.unpaced,
                 "--device {}: a person holds it, at real-time pace: leave out --unpaced", o.device);
    base::failIf(device.needsViewer && !wantsWindow(o) && o.session.empty(),
                 "--device {}: needs a window to move it in: add --view, or --session NAME and open palpate-view on it",
                 o.device);
}

// The tasks are built-in scenes; that of the scene itself goes with any.
const std::vector<std::string> tasks{"core-biopsy", "us-core-biopsy", "ct-core-biopsy",
                                     "near-vessel", "behind-rib",     "find-lump"};

void applyTask(TrainArguments& o)
{
    const bool ownScene = !o.task.empty() && o.task != "core-biopsy" && o.task != "find-lump";
    base::failIf(ownScene && o.sceneGiven, "--task {}: has a scene of its own: leave out {}", o.task, o.scene);
    if (ownScene || (o.task == "find-lump" && !o.sceneGiven)) {
        o.scene = o.task;
    }
    o.changes.palpate = o.changes.palpate || (o.task == "find-lump" && o.sceneGiven);
    o.changes.seedElsewhere = !o.trainee.empty() || o.changes.palpate || !o.lesionFrom.empty() || o.scene == "find-lump";
    if (!o.lesionFrom.empty()) {
        datasets::Insert lesion;
        lesion.diameter = o.lesionDiameter * 1e-3;
        lesion.spiculated = !o.sphere;
        lesion.seed = o.changes.seed.value_or(1);
        o.changes.lesion = session::LesionFrom{o.lesionFrom, lesion};
    }
}

// Everything that would fail at the end of a session for a reason that is there at its beginning.
void checkOutputs(const TrainArguments& o)
{
    base::checkNames({o.report, o.record});
    base::checkOutputs({o.json, o.report}, {o.scene});
    base::checkOutputFolder(o.pictures);
    if (drawsLater(o)) {
        checkViewer();
    }
    const auto record = recordFile(o);
    base::checkOutputs({o.json, record}, {});
    const std::string taken = record.empty() ? std::string() : haptics::nameTaken(record);
    base::failIf(!taken.empty(), "{}: {}{}", record.native(), taken,
                 o.record.empty() ? " (the record beside the report)" : "");
    base::failIf(!o.report.empty() && record == fs::path(o.report),
                 "{}: is the name of the record too: call the report .html", o.report);
}

// Writes all that was asked for, whatever of it fails, and adds what failed to the problem of `result`. Returns what there
// is now, as it is told.
std::vector<std::pair<const char*, std::string>> writeOutputs(const TrainArguments& o, const haptics::SessionInfo& info,
                                                              const haptics::SessionModel& model, Viewers& viewers,
                                                              double sessionTook, const Conclusion& conclusion,
                                                              session::TrainResult& result)
{
    const auto blame = [&result](const std::string& what) {
        result.problem += result.problem.empty() ? what : "; " + what;
    };
    const auto attempt = [&blame](const auto& write) {
        try {
            write();
            return true;
        } catch (const std::runtime_error& e) {
            blame(e.what());
            return false;
        }
    };
    std::vector<std::pair<const char*, std::string>> there;
    const bool wanted = o.view || session::deviceKind(o.device).needsViewer;
    if (wanted && viewers.window && viewers.window->wait(0) > 0) {
        blame("the window failed, see its message above: check the display (DISPLAY), or add --headless");
    }
    if (viewers.camera && viewers.camera->wait(picturesTimeout) != 0) {
        blame(o.pictures + ": the pictures are not complete: the viewer failed or took too long");
    }
    if (drawsLater(o)) {
        attempt([&] { drawRecord(recordFile(o), o.pictures, laterTimeout + 10 * sessionTook); });
    }
    if (!o.report.empty()) {
        const fs::path pictures = fs::is_directory(o.pictures) ? o.pictures : "";  // not there when the viewer failed
        if (attempt([&] { report::writeReport(o.report, haptics::Record(recordFile(o)), pictures, recordFile(o)); })) {
            there.emplace_back("report", o.report);
        }
    }
    if (!o.json.empty()) {
        attempt([&] { command::writeJson(o.json, figuresOf(result, info, model, conclusion)); });
    }
    for (const auto& [name, file] :
         {std::pair<const char*, std::string>{"record", o.ownRecord ? recordFile(o).string() : ""},
          {"pictures", o.pictures}}) {
        if (std::error_code none; !file.empty() && fs::exists(file, none)) {
            there.emplace_back(name, file);
        }
    }
    return there;
}

// The session's model, unless it asks for more than this machine has: before a record, a window or a device's thread is
// there.
haptics::SessionModel openModel(TrainArguments& o)
{
    if (!o.anyway) {
        o.changes.memory = base::availableMemory();
    }
    haptics::SessionModel model = session::openSession(o.scene, o.changes);
    const std::string why = o.anyway ? "" : session::whyTooSlow(session::rehearse(model), !o.unpaced);
    base::failIf(!why.empty(), "{}: {}", o.scene, why);
    if (const std::string wider = session::widerCells(model); !wider.empty()) {
        fmt::print(stderr, "palpate: warning: {}: {}\n", o.scene, wider);
    }
    return model;
}

// Only a session that keeps time needs ticks that fit in it. `fitted` says what was taken and why, once the scene is open.
std::function<std::string(const datasets::Scene&)> fitToMachine(std::string& fitted)
{
    return [&fitted](const datasets::Scene& scene) {
        const session::FittingSetting fitting = session::fittingHere(session::machineCache(), session::loadOf(scene));
        fitted = fmt::format("setting {}: {}", fitting.setting, fitting.reason);
        return fitting.setting;
    };
}

void applyTraining(TrainArguments& o, Training& training)
{
    if (const std::string scene = training.scene(); !scene.empty()) {
        base::failIf(o.sceneGiven || !o.task.empty(), "--case: a case has a scene of its own: leave out SCENE and --task");
        o.scene = scene;
        o.sceneGiven = true;
    }
    if (o.record.empty() && o.report.empty()) {
        o.record = training.record().string();
    }
}

// What else there is to say after a session, a line each.
void tell(const std::string& fitted, const std::vector<std::pair<const char*, std::string>>& written,
          const std::vector<std::string>& kept)
{
    if (!fitted.empty()) {
        fmt::print("{} (--setting changes it)\n", fitted);
    }
    for (const auto& [name, file] : written) {
        fmt::print("{}: {}\n", name, file);
    }
    for (const std::string& line : kept) {
        fmt::print("{}\n", line);
    }
}

// Where the figures lie that the window shows at the end: of a session that somebody holds.
std::optional<base::TemporaryFolder> forResult(const TrainArguments& o)
{
    const bool shown = session::deviceKind(o.device).somebodyHolds && wantsWindow(o) && !o.closeAtEnd;
    return shown ? std::optional<base::TemporaryFolder>(std::in_place, "the result that the window shows") : std::nullopt;
}

ViewersWanted viewersFor(const TrainArguments& o, const Training& training, const haptics::SessionModel& model,
                         const fs::path& result)
{
    ViewersWanted wanted;
    wanted.session = sessionName(o);
    wanted.title = training.title();
    wanted.layout = o.layout;
    wanted.pictures = drawsLater(o) ? "" : o.pictures;
    wanted.images = !o.ownRecord || recordFile(o).empty() ? fs::path() : base::imagesBeside(recordFile(o));
    wanted.result = result;
    wanted.hidden = o.showTarget ? std::vector<std::string>() : tissuesToFind(model);
    wanted.test = o.training.test;
    wanted.palette = o.palette;
    wanted.sounds = o.sounds;
    wanted.leftHanded = training.leftHanded();
    wanted.tryout = o.tryout ? o.seconds : 0;
    wanted.window = wantsWindow(o);
    wanted.handIsHere = session::deviceKind(o.device).needsViewer;
    return wanted;
}

// A tryout is a short session for nothing: in a body that is quickly there.
void applyTryout(TrainArguments& o)
{
    constexpr double tryoutSeconds = 30;
    if (!o.tryout) {
        return;
    }
    base::failIf(!session::deviceKind(o.device).somebodyHolds,
                 "--tryout: a person must hold the tool: add --device mouse or --device falcon");
    o.scene = o.sceneGiven ? o.scene : "layered";
    o.seconds = o.seconds > 0 ? o.seconds : tryoutSeconds;
    o.view = o.closeAtEnd = true;
}

void prepare(TrainArguments& o, Training& training)
{
    applyTryout(o);
    for (const auto& text : o.inject) {
        const auto faults = session::parseFaults(text);
        o.faults.insert(o.faults.end(), faults.begin(), faults.end());
    }
    applyTraining(o, training);
    checkDevice(o);
    checkFaults(o);
    checkOutputs(o);
    o.room = roomForFigures(o.json);
}

// In a test the hand does not begin on the plan. Which place it is follows from --seed, and else is another each time; the
// record has it.
std::optional<std::uint64_t> startOf(const TrainArguments& o, haptics::SessionInfo& info)
{
    if (!o.training.test || !session::deviceKind(o.device).needsViewer) {
        return std::nullopt;
    }
    const std::uint64_t start = o.changes.seed ? *o.changes.seed : std::random_device()();
    info.extra.emplace_back("start_seed", fmt::format("{}", start));
    return start;
}

void train(TrainArguments o)
{
    if (wantsWindow(o)) {
        base::useLanguage();
    }
    Training training(o.training);
    prepare(o, training);
    std::optional<base::TemporaryFolder> temporary;
    if (o.unpaced && !o.pictures.empty() && recordFile(o).empty()) {
        o.record = temporary.emplace("the record that the pictures are drawn of").path() / "session.db";
        o.ownRecord = false;
    }
    const auto record = recordFile(o);
    applyTask(o);
    training.change(o.changes);
    const std::shared_ptr<falcon::Driver> falcon = o.device == "falcon" ? session::openFalcon(o.falcon) : nullptr;
    if (const auto arm = session::deviceKind(o.device).arm; !arm.empty()) {
        o.changes.arm = o.changes.arm.value_or(std::string(arm));
    }
    std::string fitted;
    o.changes.fit = o.unpaced ? nullptr : fitToMachine(fitted);
    const auto model = openModel(o);
    const auto seed = o.changes.seed.value_or(1);
    auto info = session::describeSession(model, o.scene,
                                         o.trainee.empty() ? o.device : fmt::format("{} (seed {})", o.trainee, seed));
    info.name = sessionName(o);
    info.operatorName = o.operatorName;
    training.describe(info);
    if (!fitted.empty()) {
        info.extra.emplace_back("setting", fitted);
    }
    session::TrainOptions options;
    options.device = {o.device, o.trainee, seed, std::move(falcon), startOf(o, info)};
    options.session = sessionName(o);
    options.record = record;
    options.servo = {!o.unpaced, o.seconds};
    options.faults = o.faults;

    // Before the record is made, so that a viewer that cannot be started leaves none.
    const std::optional<base::TemporaryFolder> resultFolder = forResult(o);
    const fs::path toShow = resultFolder ? resultFolder->path() / "result.json" : fs::path();
    Viewers viewers(viewersFor(o, training, model, toShow));
    options.stallViewers = [&viewers](bool stopped) { viewers.stall(stopped); };
    if (viewers.window) {
        options.lookAfter = [&viewers] { return viewers.lookAfter(); };
    }
    const auto begun = std::chrono::steady_clock::now();
    session::TrainResult result = runToItsEnd(model, info, options);
    const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    training.markCut(result, o.record);
    const bool learns = !fitted.empty() && o.faults.empty();  // delays that were asked for are not the machine's
    const auto next = learns ? session::learnFrom(session::machineCache(), model.scene, result.timing) : std::string();
    const Conclusion conclusion = training.conclude(info, result, record);
    o.room.reset();
    const auto written = writeOutputs(o, info, model, viewers, took, conclusion, result);
    if (o.json != "-" && !o.tryout) {
        summarise(result, info, model, next);
        tell(fitted, written, conclusion.lines);
    }
    if (resultFolder && result.signal == 0) {
        command::writeJson(toShow, figuresOf(result, info, model, conclusion));
        std::fflush(stdout);
        viewers.waitForWindow();
    }
    if (result.signal != 0) {
        throw command::Interrupted(
            result.signal, fmt::format("interrupted ({}): the session was ended in order{}{}", strsignal(result.signal),
                                       result.problem.empty() ? "" : "; ", result.problem));
    }
    base::failIf(!result.problem.empty(), "{}", result.problem);
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

// Empty, or what is wrong with a value of --operator: a record would refuse it.
std::string operatorFault(const std::string& text)
{
    const bool control =
        std::ranges::any_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; });
    return text.empty() || text.size() > 200 || control ? "must be 1 to 200 bytes of text in one line" : "";
}

}  // namespace

void addTrain(CLI::App& app)
{
    auto o = std::make_shared<TrainArguments>();
    auto* c = app.add_subcommand("train", "Perform a procedure in a built-in scene, a scene file or a volume");
    auto* scene = c->add_option("SCENE", o->scene,
                                fmt::format("{}; a scene (.toml), a volume (.vdb) or a case's folder",
                                            fmt::join(datasets::builtInScenes(), ", ")))
                      ->capture_default_str();
    addTrainingOptions(*c, o->training);
    c->add_option("--task", o->task,
                  "core-biopsy: of the scene's target; us-core-biopsy, ct-core-biopsy, near-vessel, behind-rib: biopsies "
                  "with their own scenes; find-lump: palpate for position and size")
        ->check(CLI::IsMember(tasks));
    c->add_flag("--palpate", o->changes.palpate, "Find the scene's target with a fingertip");
    c->add_option("--lesion-from", o->lesionFrom,
                  "Put a lesion into the volume, at a position from this file (.loc of a VICTRE phantom) chosen by --seed");
    command::addNumber(*c, "--lesion-mm", o->lesionDiameter, "Diameter of the lesion [mm]", 2.0, 50.0);
    c->add_flag("--lesion-sphere", o->sphere, "Make the lesion a sphere, without lobes and spikes");
    c->add_option("--device", o->device, session::devicesInWords())->capture_default_str();
    command::addFalconOptions(*c, o->falcon);
    c->add_option("--trainee", o->trainee, "Skill of the simulated hand (errors, tremor, decisions), varied by --seed")
        ->check(CLI::IsMember(haptics::skillNames()));
    command::addModel(*c, o->changes);
    command::addSetting(*c, o->changes);
    c->add_option("--arm", o->changes.arm,
                  "Haptic device of stabiliser and simulated hand (default: the scene's; falcon with --device falcon)")
        ->check(CLI::IsMember(haptics::deviceNames()));
    c->add_option("--dffb", o->changes.dffb,
                  "Differential force feedback (default: as in the scene); fade: its gain falls over the session or trials")
        ->check(CLI::IsMember(session::dffbChoices));
    c->add_option("--trial", o->changes.trial, "With --dffb fade: trial K/N; all guidance in the first, none in the last");
    c->add_option("--target", o->changes.target, "Structure to sample (default: as in the scene)");
    c->add_option("--seed", o->changes.seed, "Seed of random choices (default: the scene's; 1 for --trainee and lesion)")
        ->check(command::seedFault, "a whole number");
    c->add_option("--seconds", o->seconds, "Maximum session time [s] (0: no limit)")->check(secondsFault, "0 to 86400");
    auto* unpaced = c->add_flag("--unpaced", o->unpaced, "Run as fast as possible, instead of one tick per millisecond");
    c->add_flag("--view", o->view, "Open a window (default if there is a display)")->excludes(unpaced);
    command::addChoice(*c, "--layout", o->layout, "Layout of the window", {"trainee", "instructor"});
    command::addChoice(*c, "--palette", o->palette,
                       "Colours of the window: standard, or colour-blind (with patterns in slices)",
                       {"standard", "colour-blind"});
    c->add_flag("--sounds", o->sounds, "Play sounds for warnings (in the window)");
    c->add_flag("--tryout", o->tryout, "Learn the controls in 30 s, step by step; no record, no score")
        ->excludes("--case", "--exercise", "--profile", "--test", unpaced);
    c->add_flag("--no-view,--headless", o->noView, "Open no window")->excludes("--view");
    c->add_flag("--show-target", o->showTarget, "Show the target of a palpation, which the window hides");
    c->add_flag("--close-at-end", o->closeAtEnd,
                "With mouse or falcon: close the window at the end of the session, instead of showing its result");
    c->add_option("--session", o->session, "Name under which viewers find the session (default: train-PID)");
    c->add_option("--operator", o->operatorName, "Person at the device, or a pseudonym (default: name of the profile)")
        ->check(operatorFault, "up to 200 bytes of text");
    c->add_option("--record", o->record, "Record every tick to this file (SQLite)")->excludes("--tryout");
    c->add_option("--report", o->report, "Write a report (HTML) here, and a record (.db) beside it")->excludes("--tryout");
    c->add_option("--pictures", o->pictures,
                  "Write pictures (PNG) to this folder; without a window they are drawn from the record, at the end");
    c->add_flag("--anyway", o->anyway, "Start even if ticks are far too slow or a phantom needs more than the free memory");
    c->add_option("--inject", o->inject,
                  "Inject faults at session times: gap=50ms@2s, late=5ms/500ms@2s, nan@2s, jump=100mm/20ms@2s, "
                  "unplug=200ms@2s, stall-viewer=1s@2s, disk-full@2s; several separated by commas")
        ->take_all();
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o, scene, c] {
        command::checkFalconOptions(*c, o->device == "falcon");
        o->sceneGiven = scene->count() > 0;
        if (o->sceneGiven && o->training.caseId.empty() && training::isCaseFolder(o->scene)) {
            o->training.caseId = o->scene;
            o->sceneGiven = false;
        }
        train(*o);
    });
}

}  // namespace palpate::apps
