#include <apps/command.h>
#include <command/json.h>
#include <command/options.h>

#include <base/outputs.h>
#include <base/vec_json.h>
#include <planner/costs.h>
#include <session/figures.h>
#include <session/open.h>
#include <studies/commands.h>
#include <studies/tick/bench_tick.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

namespace palpate::apps {

namespace {

struct BenchArguments {
    std::string scene = "breast";
    std::vector<int> sides{64, 128, 256};
    session::SceneChanges changes;
    bool paced = false;
    std::string json;
};

nlohmann::json caseFigures(int side, const haptics::SessionModel& model, const studies::TickCase& c)
{
    const auto tick = c.contact.percentiles();
    nlohmann::json tasks;
    for (std::size_t i = 0; i < haptics::taskCount; ++i) {
        tasks[std::string(name(static_cast<haptics::Task>(i)))] = session::microseconds(c.contactTasks[i].percentiles());
    }
    return {{"voxels_per_side", side},    {"size", model.tissue->size()},  {"lattice_nodes", model.lattice.grid.count()},
            {"ticks", c.contact.count()}, {"tick_us_p50", 1e6 * tick.p50}, {"tick_us_p99", 1e6 * tick.p99},
            {"tasks_us", tasks},          {"moved_nodes", c.meanMoved},    {"all", session::timingFigures(c.all)}};
}

void printCase(int side, const studies::TickCase& c)
{
    const auto tick = c.contact.percentiles();
    fmt::print("{:>6}^3 {:>8} {:>8.1f} {:>8.1f}", side, c.contact.count(), 1e6 * tick.p50, 1e6 * tick.p99);
    for (const auto& task : c.contactTasks) {
        fmt::print(" {:>7.1f}", 1e6 * task.percentiles().p50);
    }
    fmt::print(" {:>8.0f}\n", c.meanMoved);
    std::fflush(stdout);
}

void printHead()
{
    fmt::print("ticks in contact; times in us, tasks p50\n{:>8} {:>8} {:>8} {:>8}", "voxels", "ticks", "p50", "p99");
    for (std::size_t i = 0; i < haptics::taskCount; ++i) {
        fmt::print(" {:>7}", name(static_cast<haptics::Task>(i)));
    }
    fmt::print(" {:>8}\n", "moved");
}

void benchTick(const BenchArguments& o)
{
    base::checkOutput(o.json);
    const bool tell = o.json != "-";
    auto cases = nlohmann::json::array();
    double first = 0.0;
    double most = 0.0;
    for (const int side : o.sides) {
        auto changes = o.changes;
        changes.voxelsPerSide = side;
        const auto model = session::openSession(o.scene, changes);
        if (tell && cases.empty()) {
            printHead();
        }
        const auto result = studies::benchTick(model, {o.paced, 0.0});
        if (tell) {
            printCase(side, result);
        }
        cases.push_back(caseFigures(side, model, result));
        const double p50 = result.contact.percentiles().p50;
        first = first == 0.0 ? p50 : first;
        most = std::max(most, p50);
    }
    const double growth = most / first;
    if (tell) {
        fmt::print("the largest median is {:.2f} x that of the first volume\n", growth);
    }
    command::writeJson(o.json, {{"cases", cases}, {"growth", growth}, {"scene", o.scene}});
}

struct QueryOptions {
    std::vector<int> sides{64, 128, 256};
    std::string json;
};

nlohmann::json queryFigures(const studies::QueryCase& c)
{
    const auto touch = c.touch.percentiles();
    return {{"tool", c.tool},
            {"elements_per_side", c.elementsPerSide},
            {"deformed", c.deformed},
            {"touch_us_p50", 1e6 * touch.p50},
            {"touch_us_p99", 1e6 * touch.p99},
            {"sweep_us_p50", 1e6 * c.sweep.percentiles().p50},
            {"elements_touched", c.meanTouched}};
}

void printQuery(const studies::QueryCase& c)
{
    const auto touch = c.touch.percentiles();
    fmt::print("{:>6}^3 {:<18} {:<9} {:>8.1f} {:>8.2f} {:>8.2f} {:>8.2f}\n", c.elementsPerSide, c.tool,
               c.deformed ? "deformed" : "at rest", c.meanTouched, 1e6 * touch.p50, 1e6 * touch.p99,
               1e6 * c.sweep.percentiles().p50);
    std::fflush(stdout);
}

void benchQuery(const QueryOptions& o)
{
    base::checkOutput(o.json);
    const bool tell = o.json != "-";
    if (tell) {
        fmt::print("times in us\n{:>8} {:<18} {:<9} {:>8} {:>8} {:>8} {:>8}\n", "elements", "tool", "body", "touched",
                   "touch", "p99", "sweep");
    }
    auto cases = nlohmann::json::array();
    std::vector<double> first;
    double growth = 0.0;
    for (const int side : o.sides) {
        const auto results = studies::benchQuery(side);
        for (std::size_t i = 0; i < results.size(); ++i) {
            if (tell) {
                printQuery(results[i]);
            }
            cases.push_back(queryFigures(results[i]));
            const double p50 = results[i].touch.percentiles().p50;
            if (first.size() == i) {
                first.push_back(p50);
            }
            growth = std::max(growth, p50 / first[i]);
        }
    }
    if (tell) {
        fmt::print("no median of a touch is over {:.2f} x that in the first body\n", growth);
    }
    command::writeJson(o.json, {{"cases", cases}, {"growth", growth}});
}

void addBenchQuery(CLI::App& bench)
{
    auto o = std::make_shared<QueryOptions>();
    auto* query =
        bench.add_subcommand("query", "Measure the time to find the tissue that a tool touches, for growing bodies");
    query->add_option("--elements", o->sides, "Elements along each side of the body")
        ->delimiter(',')
        ->check(CLI::Range(32, 384))
        ->capture_default_str();
    query->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    query->final_callback([o] { benchQuery(*o); });
}

}  // namespace

void addBench(CLI::App& app)
{
    auto* bench = app.add_subcommand("bench", "Measure times and errors");
    bench->require_subcommand(1);

    auto o = std::make_shared<BenchArguments>();
    auto* tick = bench->add_subcommand("tick", "Measure the time per tick and task, for phantoms of growing resolution");
    tick->add_option("SCENE", o->scene, "Scene with a phantom")->capture_default_str();
    tick->add_option("--voxels", o->sides, "Voxels along each side of the phantom")
        ->delimiter(',')
        ->check(CLI::Range(16, 1024))
        ->capture_default_str();
    command::addModel(*tick, o->changes);
    tick->add_flag("--paced", o->paced, "Run one tick per millisecond (default: as fast as possible)");
    tick->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    tick->final_callback([o] { benchTick(*o); });
    addBenchQuery(*bench);
    studies::addBenchKernel(*bench);
    planner::addBenchCosts(*bench);
    studies::addBenchLoad(*bench);
    studies::addBenchIpc(*bench);
    studies::addBenchSync(*bench);
    studies::addBenchTasks(*bench);
    studies::addBenchScale(*bench);
    studies::addBenchNeedle(*bench);
    studies::addBenchView(*bench);
}

}  // namespace palpate::apps
