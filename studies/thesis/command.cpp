#include <studies/commands.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/quantiles.h>
#include <base/temporary_folder.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <datasets/phantom_random.h>
#include <studies/thesis/figures.h>
#include <studies/thesis/tasks_scene.h>
#include <studies/transfer/transfer.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <utility>

namespace palpate::studies {

namespace {

using Clock = std::chrono::steady_clock;

struct ThesisArguments {
    std::vector<std::size_t> objects;
    std::string level = "elastic", setting = "default";
    int voxels = 0;  // along a side of the block
    int frames = 6;
    std::uint64_t seed = 1;
    bool noView = false;
    std::string folder, chart, json;
};

constexpr double objectStiffness = 500.0;  // of the loop's spheres [N/m]

std::vector<std::size_t> standardObjects()
{
    std::vector<std::size_t> objects(thesisObjects.begin(), thesisObjects.end());
    objects.insert(objects.end(), {1'000, 10'000, 100'000, 1'000'000});
    return objects;
}

datasets::ModelSettings settingsOf(const ThesisArguments& o)
{
    datasets::ModelSettings settings;
    settings.level = datasets::modelLevelCalled(o.level);
    settings.setting = o.setting;
    settings.elastic = datasets::elasticSetting(o.setting);
    return settings;
}

double seconds(Clock::time_point t)
{
    return std::chrono::duration<double>(t.time_since_epoch()).count();
}

ViewerTimes viewerTimes(const std::vector<TimelinePicture>& pictures, Clock::time_point started)
{
    std::vector<double> read, picture;
    for (const auto& p : pictures) {
        read.push_back(p.read - p.published);
        picture.push_back(p.done - p.read);
    }
    return {pictures.front().done - seconds(started), base::upperMedian(std::move(read)),
            base::upperMedian(std::move(picture)), pictures.size()};
}

// Events with graphics on, beside a viewer. Returns why there are none, or nothing.
std::string timeGraphics(haptics::SessionModel& model, const EventOptions& options, TasksCase& result)
{
    const auto program = base::programFolder() / "palpate-view";
    if (!std::filesystem::exists(program)) {
        return "palpate-view is not beside palpate: build it with -DPALPATE_VIEWER=ON";
    }
    const base::TemporaryFolder scratch("what the viewers write");
    const auto timeline = scratch / "timeline.csv";
    const std::string session = fmt::format("bench-tasks-{}", getpid());
    haptics::Broadcast broadcast(session, model, channel::handIsViewers);
    const auto started = Clock::now();
    base::ChildProcess viewer(
        program, {"--session", session, "--hidden", "--size", "640x480", "--wait", "1", "--timeline", timeline.string()},
        "build it with -DPALPATE_VIEWER=ON");
    const Graphics graphics{broadcast, [&] { return viewer.wait(-1.0) >= 0 || viewer.killed(); }};
    const auto times = timeEvents(model, eventsWith(taskEvents, true), &graphics, options);
    broadcast.finish();
    constexpr double patience = 20.0;  // [s]
    if (times.empty() || viewer.wait(patience) != 0) {
        return "no viewer could draw (its message is above)";
    }
    result.viewer = viewerTimes(readTimeline(timeline), started);
    result.events.insert(result.events.end(), times.begin(), times.end());
    return "";
}

TasksCase measure(const ThesisArguments& o, std::size_t objects, std::string& graphics)
{
    const InclusionSpec spec{objects, o.voxels, o.seed};
    const EventOptions options{o.frames};
    TasksCase result;
    result.objects = objects;
    const auto scene = inclusionScene(settingsOf(o));
    {
        const ObjectScene loop(inclusionsOf(spec), objectStiffness);
        const std::vector<TaskEvent> events{taskEvents[1], taskEvents[3], taskEvents[7], taskEvents[9]};
        result.loop = timeEvents(loop, scene.dffb, events, {(o.frames + 1) / 2});
    }
    const auto start = Clock::now();
    auto model = haptics::buildModel(scene, inclusionTissue(spec));
    result.build = std::chrono::duration<double>(Clock::now() - start).count();
    result.voxels = base::countOf(model.tissue->size());
    result.events = timeEvents(model, eventsWith(taskEvents, false), nullptr, options);
    if (graphics.empty()) {
        graphics = timeGraphics(model, options, result);
    }
    const auto order = [](const auto& t) {
        return std::ranges::find(taskEvents, t.event, &TaskEvent::name) - taskEvents.begin();
    };
    std::ranges::sort(result.events, {}, order);
    return result;
}

// In an order of chance, so that a machine that gets slower with time does not look like objects that cost time.
std::vector<std::size_t> shuffled(std::vector<std::size_t> objects, std::uint64_t seed)
{
    datasets::Random random(seed);
    for (std::size_t i = 0; i + 1 < objects.size(); ++i) {
        std::swap(objects[i], objects[i + random.bits() % (objects.size() - i)]);
    }
    return objects;
}

void benchTasks(const ThesisArguments& o)
{
    base::checkOutput(o.json);
    base::checkOutput(o.chart);
    base::checkOutputFolder(o.folder);
    auto objects = o.objects;
    std::ranges::sort(objects);
    objects.erase(std::ranges::unique(objects).begin(), objects.end());
    base::failIf(objects.size() < 3, "--objects: give three different numbers or more, for a line fit");
    if (const int least = voxelsFor(objects.back()); o.voxels != 0 && o.voxels < least) {
        throw base::error("--voxels {}: {} objects need {} or more", o.voxels, objects.back(), least);
    }
    command::Progress progress;
    TasksResult result;
    result.level = o.level == "elastic" ? fmt::format("elastic, {}", o.setting) : o.level;
    std::string without = o.noView ? "--no-view" : "";
    for (const std::size_t n : shuffled(objects, o.seed)) {
        progress.show(fmt::format("{} of {}: {} objects", result.cases.size() + 1, objects.size(), n));
        result.cases.push_back(measure(o, n, without));
    }
    progress.clear();
    std::ranges::sort(result.cases, {}, &TasksCase::objects);
    result.graphics = without.empty() ? "measured" : "left out: " + without;
    const auto figures = tasksFigures(result);
    if (o.json != "-") {
        printTasks(figures);
    }
    if (!o.chart.empty()) {
        writeTasksChart(figures, o.chart);
    }
    if (!o.folder.empty()) {
        writeTasksFolder(o.folder, figures);
    }
    command::writeJson(o.json, figures);
}

}  // namespace

void addBenchTasks(CLI::App& bench)
{
    auto o = std::make_shared<ThesisArguments>();
    o->objects = standardObjects();
    auto* c = bench.add_subcommand("tasks",
                                   "Measure the thesis's tasks and events for growing numbers of objects, and compare them "
                                   "with its figures and with a loop over objects");
    c->add_option("--objects", o->objects,
                  "Numbers of objects, three or more (default: 25 to 600 as in Table 2 of the thesis, and on to 10^6)")
        ->delimiter(',')
        ->check(CLI::Range(1, 8'000'000));
    command::addNumber(*c, "--voxels", o->voxels,
                       "Voxels along a side of the block (0: as few as separate the objects, at least 64)", 0, 800);
    command::addChoice(*c, "--model", o->level, "Level of the tissue model", datasets::modelLevels);
    command::addChoice(*c, "--setting", o->setting, "Resolution of level elastic", datasets::elasticSettings());
    command::addNumber(*c, "--frames", o->frames, "Frames of 33 ticks, for each event and number of objects", 1, 1000);
    c->add_option("--seed", o->seed, "Seed of the objects' positions and of the order of measurement")
        ->capture_default_str()
        ->check(command::seedFault, "a whole number");
    c->add_flag("--no-view", o->noView, "Start no viewer, and leave out the events with graphics");
    c->add_option("-o,--output", o->folder, "Folder for tasks.json, tasks.html and tasks.png");
    c->add_option("--chart", o->chart, "Write the chart to this file (PNG)");
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o] { benchTasks(*o); });
}

}  // namespace palpate::studies
