#include <studies/commands.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/progress.h>
#include <session/open.h>
#include <studies/kernel/bench_kernel.h>
#include <studies/kernel/figures.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

namespace palpate::studies {

namespace {

struct KernelArguments {
    std::vector<std::string> scenes;
    std::vector<std::string> settings = datasets::elasticSettings();
    std::vector<std::string> tools;
    std::vector<std::string> volumes;
    std::vector<double> speeds{20, 100};  // [mm/s]
    std::string folder, json;
    bool quick = false;
};

std::vector<std::string> toolNames()
{
    return base::mapped<std::string>(trialTools(), [&](const auto& tool) { return tool.name; });
}

void printHead()
{
    fmt::print(
        "errors in % of the largest displacement and of the force: median (worst) over the looks; tick in us\n"
        "{:<10} {:<12} {:>5} {:<8} {:>7} {:>7} {:>7} {:>15} {:>15} {:>15} {:>15} {:>6}\n",
        "scene", "tool", "mm/s", "setting", "nodes", "p50", "p99", "rms", "near", "max", "force", "rest");
}

void printCase(const KernelCase& c)
{
    const auto cell = [&](double TrialErrors::*figure) {
        const auto spread = spreadOf(c.result.looks, figure);
        return fmt::format("{:.2f} ({:.2f})", spread.median, spread.worst);
    };
    fmt::print("{:<10} {:<12} {:>5g} {:<8} {:>7} {:>7.1f} {:>7.1f} {:>15} {:>15} {:>15} {:>15} {:>6.2f}\n", c.scene, c.tool,
               1e3 * c.speed, c.setting, c.nodes, 1e6 * c.result.p50, 1e6 * c.result.p99, cell(&TrialErrors::rms),
               cell(&TrialErrors::near), cell(&TrialErrors::max), cell(&TrialErrors::force), atRest(c.result).rms);
    std::fflush(stdout);
}

void printOperator(const OperatorBench& bench)
{
    const auto [linear, finite] = std::pair(operatorCost(false), operatorCost(true));
    fmt::print(
        "\nthe operator does {:g} additions and {:g} multiplications per cell ({:g} and {:g} at finite strain), and has "
        "to move {:g} bytes\n",
        linear.additions, linear.multiplications, finite.additions, finite.multiplications, linear.bytes);
    for (const auto& set : bench.sets) {
        fmt::print("{:<12} {:.1f} additions, {:.1f} multiplications, {:.1f} of both per ns; copies {:.0f} GB/s\n", set.name,
                   1e-9 * set.rates.additions, 1e-9 * set.rates.multiplications, 1e-9 * set.rates.both,
                   1e-9 * set.rates.bytes);
    }
    fmt::print("{:<12} {:<7} {:>6} {:>12} {:>12} {:>7}\n", "operator", "strain", "window", "ns per node", "bound", "share");
    for (const auto& c : bench.cases) {
        fmt::print("{:<12} {:<7} {:>6} {:>12.2f} {:>12.2f} {:>6.0f}%\n", c.set, c.finiteStrain ? "finite" : "small",
                   c.window, 1e9 * c.secondsPerNode, 1e9 * c.boundPerNode, 100.0 * c.boundFraction());
    }
}

// What a tick in contact asks of the machine, for people: of the first case of the headline's setting; and of each case how
// near it is to that.
void printWork(const std::vector<KernelCase>& cases, const std::string& setting, const MachineRates& rates)
{
    const auto shown = std::ranges::find(cases, setting, &KernelCase::setting);
    if (shown == cases.end()) {
        return;
    }
    fmt::print("\na tick in contact of {}, {}, {}, {:g} mm/s\n{:<12} {:>7} {:>9} {:>9} {:>9}\n", shown->setting,
               shown->scene, shown->tool, 1e3 * shown->speed, "operation", "calls", "nodes", "kB", "bound us");
    for (const KernelWork& w : shown->work) {
        fmt::print("{:<12} {:>7.1f} {:>9.0f} {:>9.0f} {:>9.1f}  {}\n", w.operation, w.calls, w.nodes, 1e-3 * w.bytes,
                   1e6 * minTime(std::span(&w, 1), rates), w.purpose);
    }
    fmt::print("\n{:<10} {:<12} {:>5} {:<8} {:>14} {:>9} {:>7}\n", "scene", "tool", "mm/s", "setting", "us, processor",
               "bound us", "share");
    for (const KernelCase& c : cases) {
        const double bound = minTime(c.work, rates);
        fmt::print("{:<10} {:<12} {:>5g} {:<8} {:>14.0f} {:>9.0f} {:>6.0f}%\n", c.scene, c.tool, 1e3 * c.speed, c.setting,
                   1e6 * c.result.cpu, 1e6 * bound, 100.0 * bound / c.result.cpu);
    }
}

// Each case with rivals, for people.
void printRivals(const std::vector<KernelCase>& cases)
{
    fmt::print("\nthe same pushes at {} without windows\n{:<10} {:<12} {:>12} {:>12} {:>22} {:>10} {:>10} {:>22}\n",
               "default", "scene", "tool", "full, warm", "from rest", "one grid at equal rms", "chainmail", "nothing",
               "force, no increment");
    for (const auto& c : cases) {
        if (!c.rivals) {
            continue;
        }
        const auto error = [](const TrialResult& r) {
            return fmt::format("{:.1f}%", spreadOf(r.looks, &TrialErrors::rms).median);
        };
        fmt::print("{:<10} {:<12} {:>11.0f}x {:>11.0f}x {:>21.1f}x {:>10} {:>10} {:>21.1f}%\n", c.scene, c.tool,
                   c.rivals->full.warm / c.result.mean, c.rivals->full.fromRest / c.result.mean,
                   singleGridRatio(c, &TrialErrors::rms), error(c.rivals->chainMail), error(c.rivals->nothing),
                   spreadOf(c.rivals->standing.looks, &TrialErrors::force).median);
    }
}

void checkNames(const KernelArguments& o)
{
    const auto known = toolNames();
    for (const std::string& tool : o.tools) {
        base::failIf(std::ranges::find(known, tool) == known.end(), "--tools {}: there is no such tool; there are {}", tool,
                     fmt::join(known, ", "));
    }
    for (const std::string& setting : o.settings) {
        datasets::elasticSetting(setting);
    }
    for (const double speed : o.speeds) {
        base::failIf(!(speed >= 1.0 && speed <= 1000.0), "--speeds {:g}: must be 1 to 1000 mm/s", speed);
    }
}

KernelRequest requestOf(const KernelArguments& o)
{
    KernelRequest request;
    request.settings = o.settings;
    std::ranges::copy_if(trialTools(), std::back_inserter(request.tools), [&](const auto& tool) {
        return o.tools.empty() || std::ranges::find(o.tools, tool.name) != o.tools.end();
    });
    request.speeds = base::mapped<double>(o.speeds, [](double speed) { return 1e-3 * speed; });
    const bool standard = std::ranges::find(o.settings, "default") != o.settings.end();
    request.rivalsOf = standard ? "default" : o.settings.back();
    request.rivalCycles = o.quick ? 1 : 4;
    return request;
}

// One scene, tool and speed, and settings of few nodes: seconds.
void shorten(KernelArguments& o)
{
    const auto first = [](auto& list, auto standard) {
        if (list.empty()) {
            list.push_back(standard);
        }
        list.resize(1);
    };
    if (o.scenes.empty() && o.volumes.empty()) {
        o.scenes = {"block"};
    }
    o.scenes.resize(std::min<std::size_t>(o.scenes.size(), 1));
    o.volumes.resize(std::min<std::size_t>(o.volumes.size(), o.scenes.empty() ? 1 : 0));
    first(o.tools, std::string("sphere_5mm"));
    first(o.speeds, 20.0);
    std::erase(o.settings, "fine");
    if (o.settings.empty()) {
        o.settings = {"default"};
    }
}

// All before the first measurement, which takes minutes: one of them may be none.
std::vector<haptics::SessionModel> modelsOf(const KernelArguments& o, command::Progress& progress)
{
    std::vector<std::string> subjects = o.scenes;
    subjects.insert(subjects.end(), o.volumes.begin(), o.volumes.end());
    return base::mapped<haptics::SessionModel>(subjects, [&](const std::string& subject) {
        progress.show(subject + ": volume");
        session::SceneChanges changes;
        changes.model = "spring";  // the bodies are made here, one per setting
        return session::openSession(subject, changes);
    });
}

void benchKernelCommand(KernelArguments o)
{
    base::checkOutput(o.json);
    base::checkOutputFolder(o.folder);
    checkNames(o);
    if (o.quick) {
        shorten(o);
    } else if (o.scenes.empty() && o.volumes.empty()) {
        o.scenes = {"block", "layered", "plate", "pair", "breast"};
    }
    const bool tell = o.json != "-";
    const auto request = requestOf(o);
    std::vector<KernelCase> cases;
    command::Progress progress;
    const auto models = modelsOf(o, progress);
    progress.clear();
    if (tell) {
        printHead();
    }
    for (const haptics::SessionModel& model : models) {
        benchKernel(
            model, request, [&](const std::string& what) { progress.show(what); },
            [&](const KernelCase& c) {
                progress.clear();
                if (tell) {
                    printCase(c);
                }
                cases.push_back(c);
            });
    }
    progress.show("operator");
    const auto operators = benchOperator(operatorWindows(o.quick ? std::vector<std::string>{} : request.settings));
    progress.clear();
    if (tell) {
        printRivals(cases);
        printOperator(operators);
        printWork(cases, request.rivalsOf, operators.sets.back().rates);
    }
    const auto figures = kernelFigures(cases, operators, request.rivalsOf);
    if (tell) {
        printSummary(figures);
    }
    command::writeJson(o.json, figures);
    if (!o.folder.empty()) {
        writeKernelFolder(o.folder, figures, cases);
    }
}

}  // namespace

void addBenchKernel(CLI::App& bench)
{
    auto o = std::make_shared<KernelArguments>();
    auto* kernel = bench.add_subcommand(
        "kernel", "Measure error and time of level elastic, compared with the complete grid solved to convergence");
    kernel
        ->add_option("--scenes", o->scenes,
                     "Scenes: built-in names or files (default: block, layered, plate, pair, breast)")
        ->delimiter(',');
    kernel->add_option("--volume", o->volumes, "Volumes (.vdb)")->delimiter(',');
    kernel->add_option("--settings", o->settings, "Settings of level elastic")->delimiter(',')->capture_default_str();
    kernel->add_option("--tools", o->tools, fmt::format("Tools: {} (default: all)", fmt::join(toolNames(), ", ")))
        ->delimiter(',');
    kernel->add_option("--speeds", o->speeds, "Speeds of the tool [mm/s]")->delimiter(',')->capture_default_str();
    kernel->add_option("-o,--output", o->folder, "Folder for kernel.json and the chart (PNG, HTML)");
    kernel->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    kernel->add_flag("--quick", o->quick, "Only one scene, tool and speed, without setting fine: seconds");
    kernel->final_callback([o] { benchKernelCommand(*o); });
}

}  // namespace palpate::studies
