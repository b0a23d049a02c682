#include <apps/command.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <base/shell_word.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <datasets/approach.h>
#include <datasets/insert.h>
#include <datasets/scene_text.h>
#include <session/open.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <stdexcept>

namespace palpate::apps {

namespace {

namespace fs = std::filesystem;
using datasets::Proposal;
using datasets::Scene;

constexpr double handle = 0.03;  // of the needle that stays outside [m]

struct SceneArguments {
    fs::path volume, output, json;
    std::string target, margin, lesionIn, lesionSize, lesionTissue = "idc_high_grade";
    std::vector<std::string> vital;
    std::uint64_t seed = 1;
    int proposals = 5, choose = 1;
    bool strict = false;
};

// Biopsy needles in the order in which they are tried: a large core first, a short throw where there is no room.
struct Needle {
    const char* name;
    double radius, notchRadius, throwLength, notch;  // [m]
};
constexpr std::array<Needle, 4> needles{{{"14 G, 22 mm throw", 1.05e-3, 0.8e-3, 22e-3, 20e-3},
                                         {"16 G, 22 mm throw", 0.825e-3, 0.6e-3, 22e-3, 20e-3},
                                         {"18 G, 22 mm throw", 0.635e-3, 0.45e-3, 22e-3, 20e-3},
                                         {"18 G, 11 mm throw", 0.635e-3, 0.45e-3, 11e-3, 9e-3}}};
constexpr std::array<double, 5> needleLengths{0.1, 0.12, 0.16, 0.2, 0.25};  // [m]

void checkStructure(const volume::Tissue& tissue, const std::string& option, const std::string& name)
{
    if (!tissue.labelsNamed(name).empty()) {
        return;
    }
    throw base::error("{} {}: the volume has no structure or tissue of this name; it has {}", option, name,
                      fmt::join(datasets::solidNames(tissue), ", "));
}

// The scene without a way in.
Scene sceneOf(const SceneArguments& o, const volume::Tissue& tissue, const std::optional<datasets::Insert>& lesion)
{
    const std::string target = lesion ? lesion->name : o.target;
    Scene scene = datasets::sceneForVolume(o.volume, tissue, target);
    if (!o.vital.empty()) {
        scene.vital.clear();
        for (const std::string& name : o.vital) {
            checkStructure(tissue, "--vital", name);
            const bool isThere = std::ranges::find(scene.vital, name, &datasets::VitalStructure::name) != scene.vital.end();
            base::failIf(name == scene.target || isThere, "--vital {}: is {}: leave it out", name,
                         isThere ? "named twice" : "the target");
            scene.vital.push_back({.name = name});
        }
        base::failIf(scene.vital.size() > datasets::maxVital, "--vital: {} names: give {} at most", scene.vital.size(),
                     datasets::maxVital);
    }
    if (lesion) {
        scene.source.inserts.push_back(*lesion);
    }
    return scene;
}

struct FoundWays {
    std::string needle;
    std::vector<Proposal> ways;
};

// Ways in with the first needle that has one; sets the scene's tool.
FoundWays findWays(Scene& scene, const SceneArguments& o, const volume::Tissue& tissue, const std::optional<double>& margin)
{
    std::string why;
    for (const Needle& needle : needles) {
        scene.tool.radius = needle.radius;
        scene.tool.notchRadius = needle.notchRadius;
        scene.tool.throwLength = needle.throwLength;
        scene.tool.notchLength = needle.notch;
        scene.tool.length = needleLengths.back() - handle;
        try {
            return {needle.name, datasets::proposeApproaches(scene, tissue, static_cast<std::size_t>(o.proposals), margin)};
        } catch (const std::runtime_error& e) {
            why = why.empty() ? e.what() : why;
        }
    }
    throw std::runtime_error(why);
}

double needleLengthFor(const Scene& scene, const Proposal& way)
{
    const double wanted =
        std::max(way.length, datasets::firingDepth(scene.tool, way.length) + scene.tool.throwLength) + handle;
    const auto longEnough = std::ranges::lower_bound(needleLengths, wanted);
    return longEnough == needleLengths.end() ? needleLengths.back() : *longEnough;
}

// The volume's file as the scene should name it: relative where it lies beside or below the scene.
fs::path fileFor(const fs::path& volume, const fs::path& scene)
{
    const fs::path folder = fs::absolute(scene).parent_path().lexically_normal();
    const fs::path file = fs::absolute(volume).lexically_normal();
    const fs::path relative = file.lexically_relative(folder);
    return relative.empty() || *relative.begin() == ".." ? file : relative;
}

std::string pointText(Vec3 p)
{
    const auto tenth = [](double metres) { return std::round(1e4 * metres) / 10 + 0.0; };  // no negative zero
    return fmt::format("{:.1f} {:.1f} {:.1f}", tenth(p.x), tenth(p.y), tenth(p.z));
}

double degrees(double angle)
{
    return angle * 180.0 / std::numbers::pi;
}

std::string clearanceText(const Proposal& way)
{
    constexpr double seen = datasets::comfort - 0.05e-3;
    return way.clearance >= seen ? fmt::format("> {:g}", 1e3 * datasets::comfort)
                                 : fmt::format("{:.1f}", 1e3 * way.clearance);
}

void writeScene(Scene scene, const SceneArguments& o, const FoundWays& found, const Proposal& way,
                const std::vector<std::string>& warnings)
{
    scene.entry = way.approach.entry;
    scene.aim = way.approach.aim;
    scene.tool.length = needleLengthFor(scene, way);
    scene.source.file = fileFor(o.volume, o.output);
    scene.name = o.output.stem().string();
    std::string comment = fmt::format(
        "# Proposed by palpate scene: way {} of {}, {:.1f} mm to the aim, {} mm from what must not be touched; {}, {:.0f} "
        "mm long.\n# The viewer looks at the plane of this line.\n",
        o.choose, found.ways.size(), 1e3 * way.length, clearanceText(way), found.needle, 1e3 * scene.tool.length);
    for (const std::string& warning : warnings) {
        comment += fmt::format("# Warning: {}\n", warning);
    }
    const std::string text = comment + datasets::sceneText(scene);
    datasets::parseScene(text, o.output);  // what cannot be read back is not written
    base::writeWhole(o.output, text);
}

std::string crossingText(const Proposal& way)
{
    const auto parts = base::mapped<std::string>(way.verdict.crossings, [&](const datasets::Crossing& c) {
        return fmt::format("{} {:.0f}", c.structure, std::max(1.0, 1e3 * c.length));
    });
    return fmt::format("{}", fmt::join(parts, ", "));
}

nlohmann::json crossingFigures(const Proposal& way)
{
    return base::mapped<nlohmann::json>(way.verdict.crossings, [](const datasets::Crossing& c) {
        return nlohmann::json{{"structure", c.structure}, {"mm", 1e3 * c.length}};
    });
}

// What is not safe to rely on, of the way that is written and of the volume.
std::vector<std::string> warningsOf(const volume::Tissue& tissue, const Proposal& way)
{
    std::vector<std::string> warnings = way.verdict.warnings;
    for (const volume::Structure& s : tissue.structures()) {
        if (s.name.rfind("invented_", 0) == 0) {
            warnings.push_back(fmt::format("{} is invented: no image shows what the way crosses there", s.name));
        }
    }
    return warnings;
}

nlohmann::json wayFigures(const Scene& scene, const FoundWays& found, const SceneArguments& o)
{
    nlohmann::json ways = nlohmann::json::array();
    const auto triple = [](Vec3 p) { return nlohmann::json{1e3 * p.x, 1e3 * p.y, 1e3 * p.z}; };
    for (const Proposal& p : found.ways) {
        ways.push_back({{"entry_mm", triple(p.approach.entry)},
                        {"aim_mm", triple(p.approach.aim)},
                        {"length_mm", 1e3 * p.length},
                        {"clearance_mm", 1e3 * p.clearance},
                        {"angle_deg", degrees(p.angle)},
                        {"off_centre_mm", 1e3 * p.offCentre},
                        {"crosses", crossingFigures(p)},
                        {"corridor", p.verdict.corridor},
                        {"warnings", p.verdict.warnings}});
    }
    const auto vital = base::mapped<std::string>(scene.vital, &datasets::VitalStructure::name);
    return {{"scene", o.output.string()}, {"target", scene.target}, {"vital", vital},
            {"needle", found.needle},     {"chosen", o.choose},     {"ways", ways}};
}

void printWays(const Scene& scene, const FoundWays& found, const SceneArguments& o)
{
    const auto vital = base::mapped<std::string>(scene.vital, &datasets::VitalStructure::name);
    fmt::print("target   {}\nvital    {}\nneedle   {}\n\n", scene.target,
               vital.empty() ? "none" : fmt::format("{}", fmt::join(vital, ", ")), found.needle);
    fmt::print("way  entry [mm, LPS]         aim [mm, LPS]           length [mm]  clearance [mm]  slant [deg]\n");
    for (std::size_t i = 0; i < found.ways.size(); ++i) {
        const Proposal& p = found.ways[i];
        fmt::print("{:>3}{} {:<23} {:<23} {:>11.1f}  {:>14}  {:>11.0f}{}\n", i + 1,
                   static_cast<int>(i) + 1 == o.choose ? "*" : " ", pointText(p.approach.entry), pointText(p.approach.aim),
                   1e3 * p.length, clearanceText(p), degrees(p.angle),
                   p.offCentre > 0.5e-3 ? fmt::format("  notch {:.0f} mm beyond the aim", 1e3 * p.offCentre) : "");
        fmt::print("     crosses [mm] {}{}\n", crossingText(p),
                   p.verdict.corridor.empty() ? "" : fmt::format("; {}", p.verdict.corridor));
    }
}

void runScene(const SceneArguments& o)
{
    base::checkNames({o.output});
    base::checkOutputs({o.output, o.json}, {o.volume});
    const auto margin = o.margin.empty() ? std::nullopt : std::optional(base::lengthFrom("--margin", o.margin, 0, 6e-3));
    command::Progress progress;
    progress.show("loading the volume");
    volume::Tissue tissue = session::loadVolume(o.volume);
    std::optional<datasets::Insert> lesion;
    if (!o.lesionIn.empty()) {
        checkStructure(tissue, "--lesion-in", o.lesionIn);
        datasets::Insert shape;
        shape.tissue = o.lesionTissue;
        shape.diameter = base::lengthFrom("--lesion", o.lesionSize.empty() ? "15mm" : o.lesionSize, 1e-3, 0.1);
        shape.seed = o.seed;
        lesion = datasets::placeLesionIn(tissue, o.lesionIn, shape);
        tissue = datasets::withInserts(tissue, std::vector<datasets::Insert>{*lesion});
    } else if (!o.target.empty()) {
        checkStructure(tissue, "--target", o.target);
    }
    Scene scene = sceneOf(o, tissue, lesion);
    progress.show("looking for ways in");
    const FoundWays found = findWays(scene, o, tissue, margin);
    base::failIf(o.choose > static_cast<int>(found.ways.size()), "--choose {}: there are {} ways: choose one of these",
                 o.choose, found.ways.size());
    const Proposal& chosen = found.ways[static_cast<std::size_t>(o.choose - 1)];
    const std::vector<std::string> warnings = warningsOf(tissue, chosen);
    progress.clear();
    for (const std::string& warning : warnings) {
        base::failIf(o.strict, "{}: {}: no scene is written with --strict", o.volume.native(), warning);
        fmt::print(stderr, "warning: {}\n", warning);
    }
    writeScene(scene, o, found, chosen, warnings);
    if (o.json != "-") {
        printWays(scene, found, o);
        fmt::print("\n{}: way {} written; run it with: palpate train {}\n", o.output.string(), o.choose,
                   base::shellWord(o.output.string()));
    }
    command::writeJson(o.json, wayFigures(scene, found, o));
}

}  // namespace

void addScene(CLI::App& app)
{
    const auto o = std::make_shared<SceneArguments>();
    CLI::App* command =
        app.add_subcommand("scene", "Propose ways from the skin to a target in a volume, and write a biopsy as a scene");
    command->add_option("volume", o->volume, "Volume (.vdb)")->type_name("V.vdb")->required();
    command->add_option("-o,--output", o->output, "Scene to write")->type_name("S.toml")->required();
    auto* target =
        command->add_option("--target", o->target, "Structure to sample; default: the first tumour")->type_name("NAME");
    command
        ->add_option("--vital", o->vital,
                     "Structures that must not be touched, as a,b,c; default: all tissue of role vital")
        ->type_name("NAMES")
        ->delimiter(',');
    command
        ->add_option("--margin", o->margin,
                     "Smallest distance of the needle to vital structures and bone [mm]; default: the largest possible of "
                     "4, 2.5 and 1.5")
        ->type_name("MM");
    command->add_flag("--strict", o->strict, "Fail, instead of writing a scene with warnings");
    command->add_option("--proposals", o->proposals, "Maximum number of ways to show (default: 5)")
        ->check(CLI::Range(1, 50));
    command->add_option("--choose", o->choose, "Number of the way to write (default: 1, the best)")
        ->check(CLI::Range(1, 50));
    auto* in = command->add_option("--lesion-in", o->lesionIn, "Put a lesion into this structure, as the target")
                   ->type_name("NAME")
                   ->excludes(target);
    command->add_option("--lesion", o->lesionSize, "Diameter of the lesion [mm] (default: 15)")->type_name("MM")->needs(in);
    command->add_option("--lesion-tissue", o->lesionTissue, "Tissue of the lesion (default: idc_high_grade)")
        ->type_name("NAME")
        ->needs(in);
    command->add_option("--seed", o->seed, "Seed of the lesion's position and shape (default: 1)")
        ->needs(in)
        ->check(command::seedFault, "a whole number");
    command->add_option("--json", o->json, "Write figures to this file (- = standard output)")->type_name("FILE");
    command->final_callback([o] { runScene(*o); });
}

}  // namespace palpate::apps
