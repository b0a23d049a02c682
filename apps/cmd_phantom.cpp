#include <apps/command.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/memory.h>
#include <base/outputs.h>
#include <base/split.h>
#include <base/vec_json.h>
#include <command/json.h>
#include <command/options.h>
#include <datasets/phantom.h>
#include <datasets/tables.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <chrono>
#include <memory>

namespace palpate::apps {

namespace {

struct PhantomArguments {
    datasets::PhantomSpec spec;
    double voxel = 1.0;  // [mm]
    std::vector<std::string> settings;
    std::filesystem::path output, tissues, json;
    bool list = false;
    bool anyway = false;
};

void listParameters(const std::string& phantom)
{
    fmt::print("{}:\n", phantom);
    for (const datasets::PhantomParameter& p : datasets::phantomParameters(phantom)) {
        if (p.word.empty()) {
            const std::string range = fmt::format("{:g} to {:g} {}", p.low, p.high, p.unit);
            fmt::print("  {:<22} {:<16} {:<14} {}\n", p.name, range, fmt::format("({:g})", p.standard), p.meaning);
        } else {
            fmt::print("  {:<22} {:<16} {:<14} {}\n", p.name, "a name", fmt::format("({})", p.word), p.meaning);
        }
    }
}

// "key=value" of --set, by the kind of the parameter.
void applySetting(datasets::PhantomSpec& spec, const std::string& setting)
{
    const std::size_t equals = setting.find('=');
    base::failIf(equals == std::string::npos || equals == 0, "--set {}: must be key=value", setting);
    const std::string key = setting.substr(0, equals), value = setting.substr(equals + 1);
    for (const datasets::PhantomParameter& p : datasets::phantomParameters(spec.name)) {
        if (p.name == key && !p.word.empty()) {
            spec.words[key] = value;
            return;
        }
    }
    const auto number = base::numberIn(value);
    base::failIf(!number, "--set {}: '{}' is not a number", setting, value);
    spec.numbers[key] = *number;
}

nlohmann::json figures(const volume::Tissue& tissue, double seconds)
{
    const volume::MemoryUse memory = tissue.memory();
    const auto labels = base::mapped<nlohmann::json>(tissue.structures(), [&](const auto& s) -> nlohmann::json {
        const std::string& name = tissue.table().rows[s.tissue].name;
        return {
            {"value", s.value}, {"name", s.name}, {"tissue", name}, {"voxels", s.voxels}, {"volume_ml", s.volume * 1e6}};
    });
    return {{"size", tissue.size()},
            {"spacing_mm", tissue.affine().spacing() * 1e3},
            {"labels", labels},
            {"memory_mb", static_cast<double>(memory.label + memory.stiffness + memory.occupancy) * 1e-6},
            {"seconds", seconds}};
}

void printSummary(const PhantomArguments& options, const volume::Tissue& tissue, double seconds)
{
    const Index3 size = tissue.size();
    fmt::print("{}: {} x {} x {} voxels of {:g} mm, made in {:.2f} s\n", options.output.string(), size.x, size.y, size.z,
               tissue.affine().spacing().x * 1e3, seconds);
    for (const volume::Structure& s : tissue.structures()) {
        fmt::print("  {:>3} {:<12} {:<16} {:>10} voxels {:>9.2f} ml\n", s.value, s.name, tissue.table().rows[s.tissue].name,
                   s.voxels, s.volume * 1e6);
    }
}

void runPhantom(PhantomArguments& options)
{
    if (options.list) {
        for (const std::string& name : datasets::phantomNames()) {
            if (options.spec.name.empty() || options.spec.name == name) {
                listParameters(name);
            }
        }
        return;
    }
    base::failIf(options.spec.name.empty() || options.output.empty(),
                 "phantom: give a phantom ({}) and a file, -o V.vdb; --list shows the parameters",
                 fmt::join(datasets::phantomNames(), ", "));
    base::checkNames({options.output});
    base::checkOutputs({options.output, options.json}, {options.tissues});
    options.spec.voxel = options.voxel * 1e-3;
    if (!options.anyway) {
        options.spec.memory = base::availableMemory();
    }
    for (const std::string& setting : options.settings) {
        applySetting(options.spec, setting);
    }
    const volume::TissueTable table =
        options.tissues.empty() ? datasets::defaultTissues() : datasets::loadTissues(options.tissues);
    const auto start = std::chrono::steady_clock::now();
    const volume::Tissue tissue = datasets::makePhantom(options.spec, table);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    tissue.save(options.output);
    if (options.json != "-") {
        printSummary(options, tissue, seconds);
    }
    command::writeJson(options.json, figures(tissue, seconds));
}

}  // namespace

void addPhantom(CLI::App& app)
{
    const auto options = std::make_shared<PhantomArguments>();
    options->spec.name.clear();
    CLI::App* command = app.add_subcommand("phantom", "Make a phantom: breast, layered or block");
    command->add_option("name", options->spec.name, "Phantom to make (--list shows all)")->type_name("NAME");
    command->add_option("-o,--output", options->output, "Volume to write (.vdb)")->type_name("V.vdb");
    command->add_option("--seed", options->spec.seed, "Seed of all random choices")
        ->capture_default_str()
        ->check(command::seedFault, "a whole number");
    command->add_option("--voxel", options->voxel, "Edge length of a voxel [mm]")->type_name("MM")->capture_default_str();
    command->add_option("--set", options->settings, "Set parameters (--list shows them)")->type_name("KEY=VALUE");
    command->add_flag("--list", options->list, "List parameters with units, ranges and defaults");
    command->add_flag("--anyway", options->anyway, "Make the phantom even if it needs more than the free memory");
    command->add_option("--tissues", options->tissues, "Tissue table instead of the built-in one")->type_name("FILE");
    command->add_option("--json", options->json, "Write figures to this file (- = standard output)")->type_name("FILE");
    command->final_callback([options] { runPhantom(*options); });
}

}  // namespace palpate::apps
