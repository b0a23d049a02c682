#include <studies/commands.h>

#include <base/child_process.h>
#include <base/outputs.h>
#include <command/json.h>
#include <command/options.h>
#include <session/figures.h>
#include <session/open.h>
#include <studies/tick/bench_tick.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <sched.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace palpate::studies {

namespace {

constexpr double sessionSeconds = 5.0;
constexpr double longestRun = 600.0;  // stress-ng ends by then, also when this program was killed [s]

struct LoadArguments {
    std::string scene = "breast";
    session::SceneChanges changes;
    int runs = 3;
    bool idle = false;
    std::string json;
};

// One paced session in a thread of its own, as `train` runs it.
struct Run {
    bool realTime = false;  // SCHED_FIFO was asked for and permitted
    haptics::ServoTiming timing;
    std::vector<std::string> warnings;
};

Run runBeside(const haptics::SessionModel& model, bool realTime)
{
    Run run;
    std::thread servo([&] {
        std::optional<haptics::RealTimeClaim> claim;
        if (realTime) {
            run.warnings = claim.emplace().warnings();
        }
        run.realTime = sched_getscheduler(0) == SCHED_FIFO;
        run.timing = benchTick(model, {true, sessionSeconds, 0}).all;
    });
    servo.join();
    return run;
}

void print(const Run& run)
{
    const auto late = run.timing.lateness.percentiles();
    fmt::print("{:<12} {:>7} {:>7} {:>7} {:>8} {:>8.0f} {:>8.0f} {:>8.0f} {:>8.0f}\n",
               run.realTime ? "SCHED_FIFO" : "ordinary", run.timing.ticks, run.timing.missed, run.timing.overruns,
               run.timing.longestGap, 1e6 * late.p50, 1e6 * late.p99, 1e6 * late.p999, 1e6 * late.max);
    std::fflush(stdout);
}

void benchLoad(const LoadArguments& o)
{
    base::checkOutput(o.json);
    const bool tell = o.json != "-";
    const auto model = session::openSession(o.scene, o.changes);
    std::unique_ptr<base::ChildProcess> load;
    if (!o.idle) {
        load = std::make_unique<base::ChildProcess>(
            "stress-ng", std::vector<std::string>{"--cpu", "0", "--quiet", "--timeout", fmt::format("{}", longestRun)},
            "install it (Debian: apt-get install stress-ng), or measure without load: --idle");
        std::this_thread::sleep_for(std::chrono::seconds(1));  // until its workers are there
    }
    if (tell) {
        fmt::print("lateness of ticks in us, beside {}\n{:<12} {:>7} {:>7} {:>7} {:>8} {:>8} {:>8} {:>8} {:>8}\n",
                   o.idle ? "nothing" : "stress-ng on every core", "scheduling", "ticks", "missed", "overran", "gap [ms]",
                   "p50", "p99", "p99.9", "max");
    }
    auto cases = nlohmann::json::array();
    std::vector<std::string> warnings;
    for (const bool realTime : {false, true}) {
        for (int i = 0; i < o.runs; ++i) {
            const Run run = runBeside(model, realTime);
            if (tell) {
                print(run);
            }
            auto figures = session::timingFigures(run.timing);
            figures["asked_for_real_time"] = realTime;
            figures["sched_fifo"] = run.realTime;
            cases.push_back(std::move(figures));
            warnings = run.warnings;
        }
    }
    for (const auto& warning : warnings) {
        fmt::print(stderr, "palpate: {}\n", warning);
    }
    command::writeJson(o.json, {{"scene", o.scene},
                                {"cores", std::thread::hardware_concurrency()},
                                {"load", !o.idle},
                                {"warnings", warnings},
                                {"cases", cases}});
}

}  // namespace

void addBenchLoad(CLI::App& bench)
{
    auto o = std::make_shared<LoadArguments>();
    auto* load = bench.add_subcommand(
        "load", "Measure the lateness of ticks while stress-ng loads every core, with and without real-time priority");
    load->add_option("SCENE", o->scene, "Built-in scene, scene file (.toml) or volume (.vdb)")->capture_default_str();
    command::addModel(*load, o->changes);
    command::addNumber(*load, "--runs", o->runs, "Sessions of each kind", 1, 20);
    load->add_flag("--idle", o->idle, "Run without load, for comparison");
    load->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    load->final_callback([o] { benchLoad(*o); });
}

}  // namespace palpate::studies
