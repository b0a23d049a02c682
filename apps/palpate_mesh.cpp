// palpate-mesh: a volume as conforming tetrahedra. A program of its own: what it links is under the GPL and the AGPL, see
// reference/NOTICE.
#include <apps/parsed_program.h>
#include <base/error.h>
#include <base/outputs.h>
#include <command/interrupted.h>
#include <command/json.h>
#include <command/progress.h>
#include <datasets/scene.h>
#include <reference/mesh_files.h>
#include <reference/tetgen/child.h>
#include <reference/volume_mesh.h>
#include <session/open.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <ctime>
#include <filesystem>
#include <string>
#include <string_view>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct MeshArguments {
    std::string volume, json;
    fs::path output;
    double size = 3;     // [mm]
    double largest = 0;  // [mm]; 0 = two and a half times the size
    std::string surface = "cgal";
};

// A volume (.vdb), a scene (.toml), or a built-in scene by its name.
volume::Tissue openVolume(const std::string& what)
{
    const fs::path file(what);
    if (file.extension() == ".toml") {
        const datasets::Scene scene = datasets::loadScene(file);
        base::failIf(scene.gravity.given,
                     "{}: [gravity]: only the volume without gravity is meshed: leave this section out", what);
        return datasets::sceneVolume(scene);
    }
    if (const auto scene = datasets::builtInScene(what); scene && !fs::exists(file)) {
        return datasets::sceneVolume(*scene);
    }
    base::failIf(file.extension().empty() && !fs::exists(file),
                 "{}: is neither a volume (.vdb) nor a built-in phantom: these are {}", what,
                 fmt::join(datasets::builtInScenes(), ", "));
    return session::loadVolume(file);
}

json figuresOf(const reference::MeshQuality& q, const volume::TissueTable& table)
{
    json tissues = json::array();
    for (const auto& t : q.tissues) {
        tissues.push_back({{"tissue", table.rows[t.row].name},
                           {"row", t.row},
                           {"voxels_ml", 1e6 * t.voxels},
                           {"mesh_ml", 1e6 * t.mesh},
                           {"volume_error_pct", t.percent()},
                           {"thickness_mm", 1e3 * t.thickness},
                           {"thinner_than_mesh", t.thin},
                           {"tetrahedra", t.tets},
                           {"least_dihedral_deg", t.minDihedral}});
    }
    return {{"points", q.points},
            {"tetrahedra", q.tets},
            {"faces_outside", q.outside},
            {"faces_between_tissues", q.between},
            {"faces_shared_by_more_than_two", q.overShared},
            {"flipped", q.flipped},
            {"least_dihedral_deg", q.minDihedral},
            {"largest_dihedral_deg", q.largestDihedral},
            {"median_least_dihedral_deg", q.medianDihedral},
            {"tetrahedra_under_10_deg", q.under10},
            {"least_radius_ratio", q.worstRadii},
            {"shortest_edge_mm", 1e3 * q.shortest},
            {"longest_edge_mm", 1e3 * q.longest},
            {"worst", {{"element", q.worst}, {"at_mm", {1e3 * q.worstAt.x, 1e3 * q.worstAt.y, 1e3 * q.worstAt.z}}}},
            {"tissues", tissues}};
}

void printQuality(const MeshArguments& o, const reference::MeshQuality& q, const volume::TissueTable& table, double seconds)
{
    fmt::print("{}: {} points, {} tetrahedra, edges {:.2f} to {:.2f} mm, {:.1f} s of processor time\n\n", o.output.string(),
               q.points, q.tets, 1e3 * q.shortest, 1e3 * q.longest, seconds);
    fmt::print("{:<20} {:>11} {:>11} {:>8} {:>10} {:>8} {:>10}\n", "tissue", "voxels, ml", "mesh, ml", "error, %",
               "tetrahedra", "least, °", "thick, mm");
    for (const auto& t : q.tissues) {
        fmt::print("{:<20} {:>11.3f} {:>11.3f} {:>8.2f} {:>10} {:>8.1f} {:>10.2f}{}\n", table.rows[t.row].name,
                   1e6 * t.voxels, 1e6 * t.mesh, t.percent(), t.tets, t.minDihedral, 1e3 * t.thickness,
                   t.thin ? "  thinner than the mesh" : "");
    }
    fmt::print("\ndihedral angles: {:.1f} to {:.1f} degrees, median of the least {:.1f}; {} of {} tetrahedra under 10\n",
               q.minDihedral, q.largestDihedral, q.medianDihedral, q.under10, q.tets);
    fmt::print("worst tetrahedron: number {}, at {:.1f} {:.1f} {:.1f} mm\n", q.worst + 1, 1e3 * q.worstAt.x,
               1e3 * q.worstAt.y, 1e3 * q.worstAt.z);
    fmt::print("faces: {} outside, {} between tissues, {} of more than two tetrahedra; {} tetrahedra flipped\n", q.outside,
               q.between, q.overShared, q.flipped);
}

void run(const MeshArguments& o)
{
    base::failIf(o.volume.empty(), "no volume: name one (.vdb), or a built-in phantom: {}",
                 fmt::join(datasets::builtInScenes(), ", "));
    base::failIf(o.output.empty(), "nothing to write: name a file with -o, which ends in {}", reference::meshFileEndings());
    base::failIf(o.largest > 0.0 && o.largest < o.size,
                 "--largest {:g}: must be at least the {:g} mm of --size, which is the edge length on surfaces", o.largest,
                 o.size);
    reference::checkMeshFile(o.output);
    base::checkOutputs({o.output, o.json}, {o.volume});
    const volume::Tissue tissue = openVolume(o.volume);
    command::Progress progress(command::Progress::Clock::ticking);
    reference::VolumeMeshOptions options;
    options.size = 1e-3 * o.size;
    options.largest = 1e-3 * (o.largest > 0.0 ? o.largest : 2.5 * o.size);
    options.surface = o.surface == "nets" ? reference::SurfaceKind::nets : reference::SurfaceKind::cgal;
    options.progress = [&](const std::string& what) { progress.show(what); };
    const reference::VolumeMesh made = reference::meshVolume(tissue, options);
    progress.show("writing");
    base::writeWhole(o.output, reference::meshText(made.mesh, tissue.table(), o.output));
    progress.clear();
    const double seconds = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
    if (o.json != "-") {
        printQuality(o, made.quality, tissue.table(), seconds);
    }
    if (!o.json.empty()) {
        json figures = figuresOf(made.quality, tissue.table());
        figures.update({{"volume", o.volume},
                        {"output", o.output.string()},
                        {"size_mm", o.size},
                        {"largest_mm", 1e3 * options.largest},
                        {"surface", o.surface}});
        command::writeJson(o.json, figures);
    }
}

void addOptions(CLI::App& app, MeshArguments& o)
{
    app.add_option("volume", o.volume, "Volume (.vdb), scene (.toml), or a built-in phantom by its name");
    app.add_option("-o,--output", o.output, "Mesh to write: " + reference::meshFileEndings())->type_name("FILE");
    command::addNumber(app, "--size", o.size, "Edge length on tissue surfaces [mm]; shorter where a tissue is thin", 0.2,
                       50.0)
        ->type_name("MM");
    app.add_option("--largest", o.largest, "Edge length away from surfaces [mm] (default: 2.5 times --size)")
        ->check(CLI::Range(0.2, 200.0))
        ->type_name("MM");
    command::addChoice(app, "--surface", o.surface,
                       "Method for the surfaces: cgal, or nets (surface nets on voxels of --size)", {"cgal", "nets"});
    app.add_option("--json", o.json, "Write figures to this file (- = standard output)")->type_name("FILE");
}

}  // namespace

}  // namespace palpate::apps

int main(int argc, char** argv)
{
    // The program starts itself so, with nothing but TetGen to do.
    if (argc == 4 && std::string_view(argv[1]) == "--tetgen-job") {
        return palpate::reference::runTetGenJob(argv[2], argv[3]);
    }
    palpate::command::endOnSignals("palpate-mesh");
    palpate::apps::MeshArguments options;
    return palpate::apps::runParsed(
        argc, argv, "palpate-mesh", "Meshes a volume with conforming tetrahedra, one region per tissue",
        [&](CLI::App& app) { palpate::apps::addOptions(app, options); }, [&] { palpate::apps::run(options); });
}
