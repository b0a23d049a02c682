// palpate-reference: the finite-element reference of one scene. A program of its own: what it links is under the GPL, see
// reference/NOTICE.
#include <apps/parsed_program.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/vec_json.h>
#include <command/interrupted.h>
#include <command/json.h>
#include <reference/ccx.h>
#include <reference/mesh_files.h>
#include <reference/press_path.h>
#include <reference/refill.h>
#include <reference/symmetry.h>
#include <reference/tetgen_mesh.h>
#include <reference/verification.h>
#include <session/open.h>
#include <studies/accuracy/reference_file.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <ranges>
#include <string>
#include <vector>

namespace palpate::apps {

namespace {

using nlohmann::json;

struct ReferenceArguments {
    std::string scene;
    std::string vtu, json, save, ccx, pathOf;
    std::string tool = "sphere_10mm";
    std::string law = "linear";
    std::string elements = "P2/P1";
    std::string mesher = "cgal";
    double speed = 20;          // [mm/s]
    double size = 2.5;          // [mm]
    double press = 0;           // [mm]; 0 = as far as the trial goes
    double radius = 0;          // [mm]; 0 = as the tool's name says
    double length = 0;          // of a capsule [mm]; 0 = a sphere
    std::vector<double> looks;  // depths [mm]; none = those of the trial
    std::string mirrored;       // of x, y, z
    bool retreat = false;
    bool all = false;
    bool progress = false;
    bool verify = false;
};

double cpuSeconds()
{
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

template <typename... Args>
void say(fmt::format_string<Args...> format, Args&&... args)
{
    fmt::print(stderr, format, std::forward<Args>(args)...);
    std::fflush(stderr);
}

studies::TrialTool toolNamed(const std::string& name)
{
    std::vector<std::string> names;
    for (const auto& tool : studies::trialTools()) {
        if (tool.kind == studies::TrialKind::sphere && tool.name == name) {
            return tool;
        }
        if (tool.kind == studies::TrialKind::sphere) {
            names.push_back(tool.name);
        }
    }
    throw base::error("--tool {}: the reference is pressed by a sphere: {}", name, fmt::join(names, ", "));
}

studies::TrialTool toolOf(const ReferenceArguments& o)
{
    studies::TrialTool tool = toolNamed(o.tool);
    if (o.radius > 0.0) {
        tool.radius = 1e-3 * o.radius;
        tool.name = fmt::format("sphere_{:g}mm", o.radius);
    }
    if (o.length > 0.0) {
        tool.kind = studies::TrialKind::capsule;
        tool.length = 1e-3 * o.length;
        tool.name = fmt::format("capsule_{:g}mm_{:g}mm", 1e3 * tool.radius, o.length);
    }
    return tool;
}

studies::ReferencePress pressIn(const std::string& file, const studies::TrialTool& tool)
{
    const auto info = studies::loadReference(file).second;
    base::failIf(!info.press, "--path-of {}: the file has no path: it is older than November 2026", file);
    base::failIf(info.tool != tool.name, "--path-of {}: its tool is {}, not {}", file, info.tool, tool.name);
    return *info.press;
}

// Straight in, and back out by the same looks.
std::vector<studies::TrialPose> posesOf(const ReferenceArguments& o, const studies::TrialPath& path)
{
    auto poses = base::mapped<studies::TrialPose>(o.looks, [&](const double depth) {
        return studies::TrialPose{path.gap + 1e-3 * depth, 0.0};
    });
    for (std::size_t look = o.looks.size(); o.retreat && look-- > 1;) {
        poses.push_back(poses[look - 1]);
    }
    return poses;
}

std::array<bool, 3> planesOf(const ReferenceArguments& o)
{
    std::array<bool, 3> planes{};
    for (int axis = 0; axis < 3; ++axis) {
        planes[static_cast<std::size_t>(axis)] = o.mirrored.find("xyz"[axis]) != std::string::npos;
    }
    return planes;
}

// Half a tool is half its force only where the plane of symmetry goes through its middle.
void checkInPlanes(const ReferenceArguments& o, const studies::TrialPath& path)
{
    constexpr double rounding = 1e-6;  // [m]
    const auto planes = planesOf(o);
    for (int axis = 0; axis < 3; ++axis) {
        const double off = std::max(std::abs(path.start[axis]), std::abs(path.at({path.press, path.drag})[axis]));
        base::failIf(planes[static_cast<std::size_t>(axis)] && off > rounding,
                     "--mirrored {}: the tool is {:.3f} mm from the plane {} = 0: solve all of it", o.mirrored, 1e3 * off,
                     "xyz"[axis]);
    }
}

// F.vtu with a look's number before its ending.
std::string numbered(const std::string& file, std::size_t look)
{
    const std::filesystem::path path(file);
    return path.parent_path() / fmt::format("{}-{:02}{}", path.stem().string(), look + 1, path.extension().string());
}

json lookFigures(const reference::Solver& solver, const studies::ReferenceState& state, const studies::TrialPath& path)
{
    return {{"pressed_mm", 1e3 * state.pose.pressed},
            {"depth_mm", 1e3 * (state.pose.pressed - path.gap)},
            {"position_mm", 1e3 * path.at(state.pose)},
            {"dragged_mm", 1e3 * state.pose.dragged},
            {"force_n", state.force},
            {"energy_j", state.energy},
            {"strain", state.strain},
            {"largest_mm", 1e3 * state.largest},
            {"newton_steps", solver.newtonSteps()}};
}

json regionFigures(const reference::BodyMesh& body, const volume::TissueTable& table)
{
    return base::mapped<json>(std::views::iota(0UL, body.rows.size()), [&](std::size_t r) -> json {
        const std::string& name = table.rows[body.rows[r]].name;
        return {{"tissue", name}, {"voxels_ml", 1e6 * body.voxels[r]}, {"mesh_ml", 1e6 * body.volume[r]}};
    });
}

// TetGen fills the surfaces of CGAL's mesh, in a process of its own, and takes its points, which are as dense as they must
// be.
reference::BodyMesh bodyOf(const ReferenceArguments& o, const reference::PressProblem& problem)
{
    const auto options = reference::meshOptions(problem, 1e-3 * o.size);
    if (o.mesher == "cgal") {
        return reference::meshBody(problem.tissue, options);
    }
    return reference::meshBody(problem.tissue, options, [&](const reference::TetMesh& mesh) {
        return reference::fillSurfaces(reference::surfacesOf(mesh, reference::AllPoints::yes), {});
    });
}

// The last state as a problem that CalculiX can solve: what touches the tool goes where it is, the rest follows.
std::string lastAsCcx(const reference::PressProblem& problem, const reference::BodyMesh& body,
                      const reference::Solver& solver, studies::TrialPose pose)
{
    constexpr double touching = 2e-5;  // [m]
    const reference::RigidTool tool = toolAt(problem, pose);
    const auto at = [&](Vec3 rest) { return solver.displacement(std::span(&rest, 1)).front(); };
    const auto touches = [&](Vec3 rest) { return tool.distance(rest + at(rest)) < touching; };
    return ccxText(body.mesh, materialsOf(problem, body), problem.solve, {touches, at});
}

// What a run leaves: written when all of it is there.
struct Results {
    std::vector<std::pair<std::string, std::string>> files;  // name, text
    json looks = json::array();
    studies::Reference reference;
    studies::ReferenceInfo info;
};

Results solveScene(const ReferenceArguments& o, const haptics::SessionModel& model, const studies::TrialPath& path,
                   json& figures)
{
    const volume::Tissue part = reference::mirroredPart(*model.tissue, planesOf(o));
    const reference::PressProblem problem{
        part,
        model.surface,
        path,
        1e-3 * o.speed,
        model.scene.model.elastic.poissonCap,
        {.law = *volume::lawNamed(o.law),
         .elements = o.elements == "P2" ? reference::Elements::p2 : reference::Elements::p2p1,
         .progress = o.progress,
         .mirrored = planesOf(o)},
        posesOf(o, path)};
    const reference::BodyMesh body = bodyOf(o, problem);
    if (!o.ccx.empty()) {
        reference::checkCcx(body.mesh, materialsOf(problem, body), problem.solve.law, o.ccx);
    }
    const double meshed = cpuSeconds();
    say("{}: {} tetrahedra, {} mixtures, smallest angle {:.1f} degrees, {:.1f} s\n", model.scene.name,
        body.mesh.tets.size(), body.mixtures.size(), body.sharpest, meshed);

    Results out;
    const auto sink = [&](const reference::Solver& solver, std::size_t look, std::size_t looks,
                          const studies::ReferenceState& state) {
        say("{}: look {} of {}: {:.2f} mm in, {:.2f} mm along: {:.5f} {:.5f} {:.5f} N, {} Newton steps, {:.0f} s\n",
            model.scene.name, look + 1, looks, 1e3 * state.pose.pressed, 1e3 * state.pose.dragged, state.force.x,
            state.force.y, state.force.z, solver.newtonSteps(), cpuSeconds() - meshed);
        out.looks.push_back(lookFigures(solver, state, path));
        out.info.unknowns = solver.unknowns();
        if (!o.vtu.empty() && (o.all || look + 1 == looks)) {
            out.files.emplace_back(o.all ? numbered(o.vtu, look) : o.vtu, reference::vtuText(body.mesh, solver));
        }
        if (!o.ccx.empty() && look + 1 == looks) {
            out.files.emplace_back(o.ccx, lastAsCcx(problem, body, solver, state.pose));
        }
    };
    out.reference = reference::solvePath(problem, body, sink);
    out.info.tets = body.mesh.tets.size();
    out.info.seconds = cpuSeconds() - meshed;
    figures["mesh_seconds"] = meshed;
    figures["smallest_angle_deg"] = body.sharpest;
    figures["regions"] = regionFigures(body, part.table());
    return out;
}

// Figures beside closed forms; throws when one is off by more than its bound.
void verify(const ReferenceArguments& o)
{
    base::checkOutput(o.json);
    json rows = json::array();
    std::size_t over = 0;
    for (const auto& row :
         reference::verifyReference(reference::Fineness::full, [](const std::string& what) { say("{}\n", what); })) {
        const bool holds = row.errorPercent <= row.bound;
        over += holds ? 0 : 1;
        say("{:<38} {:<26} {:>10.5g} {:>10.5g} {:>8.3f} % of {:g} %{}  {}\n", row.problem, row.quantity, row.ours,
            row.reference, row.errorPercent, row.bound, holds ? "" : " OVER", row.setting);
        rows.push_back({{"problem", row.problem},
                        {"quantity", row.quantity},
                        {"setting", row.setting},
                        {"ours", row.ours},
                        {"reference", row.reference},
                        {"error_pct", row.errorPercent},
                        {"bound_pct", row.bound},
                        {"source", row.source}});
    }
    command::writeJson(o.json, {{"verification", rows}});
    base::failIf(over > 0, "{} of {} figures are off by more than their bounds", over, rows.size());
}

void run(const ReferenceArguments& o)
{
    if (o.verify) {
        base::failIf(!o.scene.empty(), "--verify: solves problems of its own: leave it or the scene out");
        verify(o);
        return;
    }
    base::failIf(o.scene.empty(), "no scene: give one, or --verify");
    base::checkOutputs({o.vtu, o.json, o.save, o.ccx}, {o.scene, o.pathOf});
    base::failIf(o.vtu.empty() && o.json.empty() && o.save.empty() && o.ccx.empty(),
                 "nothing to write: name a file with --output, --json, --save or --export-ccx");
    base::failIf(!o.vtu.empty() && std::filesystem::path(o.vtu).extension() != ".vtu",
                 "{}: --output is written as .vtu, for ParaView: name it so (CalculiX: --export-ccx)", o.vtu);
    base::failIf(!o.save.empty() && o.mesher != "cgal",
                 "--save: `palpate accuracy` needs references on CGAL's mesh: leave out --mesher");
    base::failIf(
        !o.save.empty() && (!o.looks.empty() || !o.mirrored.empty()),
        "--save: `palpate accuracy` needs all looks of the trial, in the whole body: leave out --looks and --mirrored");
    const auto tool = toolOf(o);
    session::SceneChanges changes;
    changes.model = "spring";  // the kernel's own body is not needed
    const auto model = session::openSession(o.scene, changes);
    const auto place = studies::trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    auto path = studies::trialPath(*model.tissue, model.surface, place, tool, 1e-3 * o.size);
    path = o.pathOf.empty() ? path : studies::pressedBy(path, pressIn(o.pathOf, tool));
    if (o.press > 0.0) {
        path.press = path.gap + 1e-3 * o.press;
    }
    if (!o.looks.empty()) {
        path.press = path.gap + 1e-3 * std::ranges::max(o.looks);
        path.drag = 0.0;
    }
    checkInPlanes(o, path);
    json figures;
    Results results = solveScene(o, model, path, figures);
    auto& info = results.info;
    const double poissonCap = model.scene.model.elastic.poissonCap;
    info.press = studies::pressOf(path);
    info.body = studies::referenceKey(*model.tissue, path, 1e-3 * o.speed, o.law, poissonCap, false);
    info.key = studies::referenceKey(*model.tissue, path, 1e-3 * o.speed, o.law, poissonCap);
    info.scene = model.scene.name;
    info.tool = tool.name;
    info.law = o.law;
    info.elements = o.elements;
    info.speed = 1e-3 * o.speed;
    info.program = std::string(base::build());
    // The large ones last: where the disk is full by then, what the run was for is there.
    if (!o.save.empty()) {
        studies::saveReference(o.save, results.reference, info);
    }
    if (!o.json.empty()) {
        figures.update({{"scene", info.scene},
                        {"tool", info.tool},
                        {"law", info.law},
                        {"elements", info.elements},
                        {"mesher", o.mesher},
                        {"key", info.key},
                        {"tets", info.tets},
                        {"unknowns", info.unknowns},
                        {"points", results.reference.position.size()},
                        {"seconds", info.seconds},
                        {"looks", results.looks}});
        command::writeJson(o.json, figures);
    }
    for (const auto& [file, text] : results.files) {
        base::writeWhole(file, text);
    }
}

void addOptions(CLI::App& app, ReferenceArguments& o)
{
    app.add_option("scene", o.scene, "Scene: a built-in name, a file (.toml), or a volume (.vdb)");
    app.add_option("-o,--output", o.vtu, "Write the last state for ParaView (.vtu)");
    app.add_flag("--all", o.all, "With -o: write a numbered .vtu for every look")->needs("--output");
    app.add_option("--tool", o.tool, "Sphere that presses: sphere_5mm or sphere_10mm")->capture_default_str();
    app.add_option(
           "--law", o.law,
           "Material law: linear (small strain), or a law of finite strain, as in scenes, on CalculiX' neo-Hookean energy")
        ->check(CLI::IsMember(std::vector<std::string>(volume::lawNames.begin(), volume::lawNames.end())))
        ->capture_default_str();
    command::addChoice(app, "--elements", o.elements,
                       "P2, or P2/P1 (Taylor-Hood), which needs fewer tetrahedra in nearly incompressible tissue",
                       {"P2", "P2/P1"});
    command::addChoice(app, "--mesher", o.mesher,
                       "Mesher of the tetrahedra between the same surfaces: cgal, or tetgen (runs palpate-mesh)",
                       {"cgal", "tetgen"});
    command::addNumber(app, "--speed", o.speed, "Speed of the trial, which defines the looks [mm/s]", 1.0, 1000.0);
    command::addNumber(app, "--size", o.size, "Edge length of tetrahedra at the contact [mm]", 0.3, 10.0);
    app.add_option("--press", o.press, "Depth of the press [mm] (default: as in the trial)")->check(CLI::Range(0.1, 50.0));
    app.add_option("--path-of", o.pathOf, "Press where this reference does (.ref), not at the scene's entry")
        ->check(CLI::ExistingFile);
    app.add_option("--radius-mm", o.radius, "Radius of the sphere, instead of that of --tool [mm]")
        ->check(CLI::Range(0.5, 100.0));
    app.add_option("--length-mm", o.length, "Press a capsule end on, of this length between its end centres [mm]")
        ->check(CLI::Range(0.1, 300.0));
    app.add_option("--looks", o.looks,
                   "Press straight in, and solve at these depths below the first touch, e.g. 0.5,1,2 [mm]")
        ->delimiter(',')
        ->check(CLI::Range(0.001, 100.0))
        ->excludes("--press");
    app.add_flag("--retreat", o.retreat, "Also solve the way out, at the same looks")->needs("--looks");
    app.add_option("--mirrored", o.mirrored,
                   "Planes of symmetry of scene and press (xz: x = 0 and z = 0): solve one side, report the whole")
        ->check(CLI::IsMember({"x", "y", "z", "xy", "xz", "yz"}))
        ->needs("--looks");
    app.add_flag("--progress", o.progress, "Print a line per load step to standard error");
    app.add_flag("--verify", o.verify, "Solve problems with closed forms instead of a scene (minutes)");
    app.add_option("--json", o.json, "Write figures to this file (- = standard output)");
    app.add_option("--export-ccx", o.ccx, "Write the last state as input of CalculiX (.inp)");
    app.add_option("--save", o.save, "Write the reference that `palpate accuracy` reads (.ref)");
}

}  // namespace

}  // namespace palpate::apps

int main(int argc, char** argv)
{
    palpate::command::endOnSignals("palpate-reference");
    palpate::apps::ReferenceArguments options;
    return palpate::apps::runParsed(
        argc, argv, "palpate-reference", "Meshes a scene, solves it with finite elements, and writes both",
        [&](CLI::App& app) { palpate::apps::addOptions(app, options); }, [&] { palpate::apps::run(options); });
}
