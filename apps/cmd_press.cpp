#include <apps/command.h>
#include <base/mapped.h>
#include <command/json.h>
#include <command/options.h>

#include <base/error.h>
#include <base/outputs.h>
#include <base/vec_json.h>
#include <command/progress.h>
#include <session/open.h>
#include <studies/press/press.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <cstdio>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::apps {

using datasets::ToolKind;
using datasets::toolKinds;
using datasets::ToolSpec;
using nlohmann::json;
using studies::FilePoint;
using studies::PosePath;
using studies::PressSample;
using studies::PressSummary;

namespace {

constexpr double minRadius = 0.1, maxRadius = 100.0;  // [mm]
constexpr double maxLength = 500.0;                   // [mm]
constexpr std::size_t progressEvery = 200;            // ticks

struct PressArguments {
    std::string scene, path, at, csv, json;
    session::SceneChanges changes;
    std::string level = "elastic";
    std::optional<std::string> tool;
    std::optional<double> radius, length;  // [mm]
    std::size_t every = 1;
    bool converge = false;
};

// Everything that a run needs and gives.
struct Run {
    haptics::SessionModel model;
    PosePath path;
    std::vector<FilePoint> points;
    studies::PressOptions press;
    std::vector<PressSample> samples;
    PressSummary summary;
};

double inRange(const std::string& option, double value, double least, double most)
{
    base::failIf(!(value >= least && value <= most), "{} {:g}: must be {:g} to {:g} mm", option, value, least, most);
    return 1e-3 * value;
}

std::string_view kindName(ToolKind kind)
{
    return toolKinds[static_cast<std::size_t>(kind)];
}

// The scene's tool with what the command line says of it. What neither says is not guessed.
ToolSpec toolOf(const PressArguments& o, const ToolSpec& scene)
{
    ToolSpec tool = scene;
    if (o.tool) {
        tool.kind = static_cast<ToolKind>(std::ranges::find(toolKinds, *o.tool) - toolKinds.begin());
    }
    const bool needle = tool.kind == ToolKind::needle, other = tool.kind != scene.kind;
    base::failIf(tool.kind == ToolKind::sphere && o.length,
                 "--length-mm: the tool is a sphere, which has no length: leave it out");
    base::failIf(!needle && scene.kind == ToolKind::needle && !o.radius,
                 "--tool {}: the tool of {} is a needle: add --radius-mm for this one", o.tool.value_or(""), o.scene);
    base::failIf(other && tool.kind == ToolKind::capsule && !o.length,
                 "--tool capsule: the tool of {} is a {}: add --length-mm for this one", o.scene, kindName(scene.kind));
    tool.length = needle && other ? ToolSpec{}.length : tool.length;
    tool.radius = needle && other ? ToolSpec{}.radius : tool.radius;
    tool.radius = o.radius ? inRange("--radius-mm", *o.radius, minRadius, maxRadius) : tool.radius;
    tool.length = o.length ? inRange("--length-mm", *o.length, 0.0, maxLength) : tool.length;
    return tool;
}

json sampleFigures(const PressSample& s)
{
    return {{"seconds", s.pose.seconds},
            {"position_mm", 1e3 * s.pose.position},
            {"axis", s.pose.axis},
            {"force_n", s.force},
            {"contact_mm2", 1e6 * s.contactArea},
            {"energy_mj", 1e3 * s.energy},
            {"residual", s.residual},
            {"depth_mm", 1e3 * s.depth},
            {"behind_mm", 1e3 * s.behind},
            {"us", 1e6 * s.took}};
}

json toolFigures(const Run& run)
{
    const ToolSpec& tool = run.press.tool;
    json out{{"kind", kindName(tool.kind)}};
    out["radius_mm"] = 1e3 * tool.radius;
    if (tool.kind != ToolKind::needle) {
        out["friction"] = run.model.scene.model.elastic.friction;
    }
    if (tool.kind != ToolKind::sphere) {
        out["length_mm"] = 1e3 * tool.length;
    }
    return out;
}

json pressFigures(const PressArguments& o, const Run& run)
{
    const auto& settings = run.model.scene.model.elastic;
    const PressSummary& s = run.summary;
    json out{{"scene", o.scene},
             {"path", o.path},
             {"setting", run.model.scene.model.setting},
             {"spacing_mm", 1e3 * run.model.lattice.grid.spacing},
             {"window", settings.window},
             {"cycles", settings.cycles},
             {"strain", volume::isSmall(settings.law) ? "small" : "finite"},
             {"law", volume::nameOf(settings.law)},
             {"converged", o.converge},
             {"not_converged", s.notConverged},
             {"tool", toolFigures(run)},
             {"ticks", s.ticks},
             {"ticks_in_contact", s.inContact},
             {"windows_moved", s.windowMoves},
             {"tick_us", {{"p50", 1e6 * s.times.p50}, {"p99", 1e6 * s.times.p99}, {"max", 1e6 * s.times.max}}},
             {"peak_force_n", s.peakForce},
             {"held_from_s", s.heldFrom ? json(*s.heldFrom) : json()},
             {"passed_from_s", s.passedFrom ? json(*s.passedFrom) : json()},
             {"samples", base::mapped<json>(run.samples, sampleFigures)},
             {"displacement", json::array()}};
    for (std::size_t i = 0; i < run.points.size(); ++i) {
        out["displacement"].push_back(
            {{"at_mm", 1e3 * run.points[i].at}, {"by_mm", 1e3 * run.samples.back().displacement[i]}});
    }
    return out;
}

std::string pressTable(const Run& run)
{
    std::string text =
        "seconds,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n,contact_mm2,energy_mj,residual,depth_mm,behind_mm,us";
    for (std::size_t i = 1; i <= run.points.size(); ++i) {
        text += fmt::format(",u{0}_x_mm,u{0}_y_mm,u{0}_z_mm", i);
    }
    const auto out = std::back_inserter(text);
    for (const PressSample& s : run.samples) {
        const Vec3 p = 1e3 * s.pose.position;
        fmt::format_to(
            out, "\n{:.13g},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g},{:.10g},{:.4g},{:.10g},{:.10g},{:.1f}",
            s.pose.seconds, p.x, p.y, p.z, s.force.x, s.force.y, s.force.z, 1e6 * s.contactArea, 1e3 * s.energy, s.residual,
            1e3 * s.depth, 1e3 * s.behind, 1e6 * s.took);
        for (const Vec3& u : s.displacement) {
            fmt::format_to(out, ",{:.10g},{:.10g},{:.10g}", 1e3 * u.x, 1e3 * u.y, 1e3 * u.z);
        }
    }
    return text + '\n';
}

// A scene may have spacing, window and cycles of its own.
std::string settingInWords(const Run& run)
{
    const datasets::ModelSettings& model = run.model.scene.model;
    const bool named = model.elastic == datasets::elasticSetting(model.setting, model.elastic);
    const double spacing = 1e3 * run.model.lattice.grid.spacing;
    return named ? fmt::format("setting {}, {:g} mm", model.setting, spacing)
                 : fmt::format("setting of the scene, {:g} mm, window {}, cycles {}", spacing, model.elastic.window,
                               model.elastic.cycles);
}

void printPress(const PressArguments& o, const Run& run)
{
    const PressSummary& s = run.summary;
    fmt::print("{}: {} in {}, {}\n", o.scene, kindName(run.press.tool.kind), o.path, settingInWords(run));
    if (s.inContact == 0) {
        fmt::print("{} ticks; the tool never touches the tissue's surface\n", s.ticks);
        return;
    }
    if (s.peakForce == 0.0) {
        fmt::print("{} ticks, {} in contact, but no sample is: take a smaller --every\n", s.ticks, s.inContact);
        return;
    }
    const Vec3 p = 1e3 * s.peakAt.position;
    fmt::print("peak force {:.3f} N after {:.3f} s at {:.2f}, {:.2f}, {:.2f} mm\n", s.peakForce, s.peakAt.seconds, p.x, p.y,
               p.z);
    fmt::print("{} ticks, {} in contact; one takes {:.0f} us (p50), {:.0f} us (p99); windows moved {} times\n", s.ticks,
               s.inContact, 1e6 * s.times.p50, 1e6 * s.times.p99, s.windowMoves);
    if (s.heldFrom) {
        fmt::print(
            "from {:.3f} s on the tool is deeper than the model bears, and held back: column behind_mm says by how much\n",
            *s.heldFrom);
    }
    if (s.passedFrom) {
        fmt::print(
            "from {:.3f} s on the tool lies wholly beyond the body as it is at rest: forces there are extrapolated\n",
            *s.passedFrom);
    }
    if (s.notConverged > 0) {
        fmt::print("{} of {} samples are not solved to convergence: column residual says which\n", s.notConverged,
                   run.samples.size());
    }
}

void write(const PressArguments& o, const Run& run)
{
    if (o.csv == "-") {
        std::fputs(pressTable(run).c_str(), stdout);
    } else if (!o.csv.empty()) {
        base::writeWhole(o.csv, pressTable(run));
    }
    if (!o.json.empty()) {
        command::writeJson(o.json, pressFigures(o, run));
    }
}

void warnOfCells(const Run& run)
{
    if (const std::string wider = session::widerCells(run.model); !wider.empty()) {
        fmt::print(stderr, "palpate press: {}\n", wider);
    }
    constexpr double fewestCells = 1.25;  // of a radius, from which on the place between the nodes hardly matters
    const double spacing = run.model.lattice.grid.spacing, radius = run.press.tool.radius;
    if (run.press.tool.kind != ToolKind::needle && radius < fewestCells * spacing) {
        fmt::print(
            stderr,
            "palpate press: the tool's radius of {:g} mm is less than {:g} cells of {:g} mm: the force depends on where it "
            "lies between nodes (at one cell up to 16 % off from a radius of depth on, more with fewer); a smaller "
            "[model.elastic] spacing_mm resolves it\n",
            1e3 * radius, fewestCells, 1e3 * spacing);
    }
}

// Such a tool is there all at once: one whose middle is inside is pushed from the nearest place of the surface, and the
// first forces of one that touches are of tissue that has not given way yet.
void warnOfStartInContact(const Run& run)
{
    const ToolSpec& tool = run.press.tool;
    const studies::ToolPose& first = run.path.poses.front();
    const haptics::ProxyTool shape{tool.radius, tool.pressedLength(), first.axis};
    const double inside = -haptics::deepestPlace(run.model.surface, shape, first.position).distance;
    if (tool.kind == ToolKind::needle || inside <= 5e-5 - tool.radius) {
        return;
    }
    if (inside > 0.0) {
        fmt::print(
            stderr,
            "palpate press: the path begins with the tool's middle {:.1f} mm inside the body: forces have no meaning "
            "until the tool has been outside; start it there\n",
            1e3 * inside);
    } else {
        fmt::print(
            stderr,
            "palpate press: the path begins with the tool {:.1f} mm in the body: its first forces are too large, until "
            "the tissue has given way; start it outside\n",
            1e3 * (inside + tool.radius));
    }
}

void runPress(const PressArguments& o)
{
    base::checkOutputs({o.json, o.csv}, {o.scene, o.path, o.at});
    base::failIf(o.json == "-" && o.csv == "-",
                 "--json -, --csv -: standard output takes one of them: give the other a file");
    command::Progress progress;
    progress.show(o.scene + ": volume");
    session::SceneChanges changes = o.changes;
    changes.model = o.level;
    changes.tool = [&](const ToolSpec& scene) { return toolOf(o, scene); };
    Run run{session::openSession(o.scene, changes), {}, {}, {}, {}, {}};
    run.press = {run.model.scene.tool, o.every, o.converge};
    std::optional<Vec3> axis = studies::plannedAxis(run.model);
    if (run.press.tool.kind == ToolKind::sphere) {
        axis = axis.value_or(Vec3(0, 1, 0));
    }
    run.path = studies::loadPosePath(o.path, axis);
    if (!o.at.empty()) {
        run.points = studies::loadPoints(o.at);
    }
    progress.clear();
    warnOfCells(run);
    warnOfStartInContact(run);
    const auto ticks = static_cast<double>(run.path.ticks());
    try {
        run.summary = studies::press(run.model, run.path, run.points, run.press, [&](const PressSample& s) {
            if (run.samples.size() % progressEvery == 0) {
                progress.show(o.scene, 1e3 * (s.pose.seconds - run.path.poses.front().seconds) / ticks);
            }
            run.samples.push_back(s);
        });
    } catch (...) {
        progress.clear();
        throw;
    }
    progress.clear();
    write(o, run);
    if (o.json != "-" && o.csv != "-") {
        printPress(o, run);
    }
}

}  // namespace

void addPress(CLI::App& app)
{
    auto o = std::make_shared<PressArguments>();
    CLI::App* c = app.add_subcommand("press", "Move a tool along a path from a file, and write the tissue's raw force");
    c->add_option("SCENE", o->scene, "Built-in scene, scene file (.toml) or volume (.vdb)")->required();
    c->add_option("--path", o->path, "Poses of the tool: CSV with x_mm,y_mm,z_mm; optional: seconds, axis_x,axis_y,axis_z")
        ->type_name("FILE")
        ->required();
    command::addSetting(*c, o->changes);
    command::addChoice(*c, "--model", o->level, "Tissue model; only elastic has forces of its own", {"elastic"});
    c->add_option("--at", o->at, "Points at rest whose displacement is written: CSV with x_mm,y_mm,z_mm")
        ->type_name("FILE");
    c->add_option("--tool", o->tool, "Kind of tool (default: as in the scene)")->check(CLI::IsMember(toolKinds));
    c->add_option("--radius-mm", o->radius, "Radius of the tool [mm] (default: as in the scene)");
    c->add_option("--length-mm", o->length,
                  "Length of a needle, or between the end centres of a capsule [mm] (default: as in the scene)");
    command::addNumber(*c, "--every", o->every, "Interval between samples [ms]; the last tick is always a sample",
                       std::size_t{1}, std::size_t{10'000'000});
    c->add_flag("--converge", o->converge, "Solve each sample to convergence, instead of the few cycles of a tick");
    c->add_option("--json", o->json, "Write samples and figures to this file (- = standard output)");
    c->add_option("--csv", o->csv, "Write samples to this file, one per line (- = standard output)");
    c->final_callback([o] { runPress(*o); });
}

}  // namespace palpate::apps
