#include <sweep/command.h>

#include <base/build.h>
#include <base/counted.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/shell_word.h>
#include <base/temporary_folder.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <sweep/pool.h>
#include <sweep/report.h>
#include <sweep/run.h>
#include <sweep/slurm.h>
#include <sweep/table.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <signal.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace palpate::sweep {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

namespace {

constexpr std::size_t barWidth = 30;
constexpr double fileBlock = 4096;  // what a small file takes on a disk

struct SweepArguments {
    std::string plan, folder, report, json, work, shard, cases;
    std::vector<std::string> merged;  // folders of shards
    SlurmSettings slurm;
    int jobs = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    bool dry = false, onSlurm = false, retry = false, anyBuild = false, list = false, merge = false;
};

std::atomic<int> interrupts{0};

void onSignal(int)
{
    ++interrupts;
}

// Ctrl-C once: what runs is finished; twice: it is abandoned.
void heedSignals()
{
    struct sigaction action {};
    action.sa_handler = onSignal;
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    sigaction(SIGHUP, &action, nullptr);
}

std::string duration(double seconds)
{
    const auto s = static_cast<long>(seconds + 0.5);
    return s < 1      ? fmt::format("{:.1g} s", seconds)
           : s < 120  ? fmt::format("{} s", s)
           : s < 7200 ? fmt::format("{} min", s / 60)
                      : fmt::format("{:.1f} h", seconds / 3600);
}

// "[######......] 412 of 1000 cases, 8.1 a second, 72 s left".
std::string bar(std::size_t before, std::size_t done, std::size_t all, Clock::time_point begin)
{
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    const double rate = seconds > 0 ? static_cast<double>(done) / seconds : 0.0;
    const std::size_t filled = (before + done) * barWidth / all;
    std::string out = fmt::format("[{:#<{}}{:.<{}}] {} of {} cases", "", filled, "", barWidth - filled, before + done, all);
    if (done > 0) {
        out += fmt::format(", {:.3g} a {}, {} left", rate >= 0.5 ? rate : 60 * rate, rate >= 0.5 ? "second" : "minute",
                           duration(static_cast<double>(all - before - done) / rate));
    }
    return out;
}

void listAll()
{
    fmt::print("ready plans:\n");
    for (const std::string& name : builtInPlans()) {
        const auto [text, origin] = planText(name);
        const SweepPlan plan = parsePlan(text, origin, namedScene);
        fmt::print("  {:<14} {:5} cases  {}\n", name, plan.cases(), plan.about);
    }
    for (std::size_t kind = 0; kind < procedureNames.size(); ++kind) {
        fmt::print("outputs of procedure {}:\n", procedureNames[kind]);
        for (const OutputInfo& o : outputsOf(static_cast<ProcedureKind>(kind))) {
            fmt::print("  {:<24} {}\n", o.name, o.meaning);
        }
    }
}

// What a case costs, by some that are run.
struct CaseCost {
    double seconds = 0, bytes = fileBlock;
    std::size_t measured = 0;
};

// The first case that is done also builds what all share: it counts where no other one is done.
CaseCost costOf(const SweepPlan& plan)
{
    CaseRunner runner(plan, std::string(base::build()));
    std::optional<base::TemporaryFolder> place;
    if (plan.records) {
        place.emplace("the records of these cases");
    }
    const fs::path record = place ? *place / "case.db" : fs::path();
    CaseCost cost;
    std::vector<std::string> errors;
    for (const std::size_t i : std::set<std::size_t>{0, plan.cases() / 2, plan.cases() - 1}) {
        const auto begin = Clock::now();
        try {
            runner.run(i, record);
            const double took = std::chrono::duration<double>(Clock::now() - begin).count();
            cost.seconds = cost.measured < 2 ? took : std::max(took, cost.seconds);
            ++cost.measured;
        } catch (const std::runtime_error& e) {
            errors.push_back(fmt::format("case {} fails: {}", i, withoutPlace(e.what())));
        }
        std::error_code none;
        const auto size = record.empty() ? 0 : fs::file_size(record, none);
        cost.bytes = std::max(cost.bytes, fileBlock + (none ? 0.0 : static_cast<double>(size)));
        fs::remove(record, none);
    }
    if (cost.measured == 0) {
        throw std::runtime_error("every case that was tried failed: " + errors.front());
    }
    for (const std::string& error : errors) {
        fmt::print(stderr, "palpate: {}\n", error);
    }
    return cost;
}

void dryRun(const SweepArguments& o)
{
    const auto [text, origin] = o.plan.empty() ? planText((fs::path(o.folder) / "plan.toml").string()) : planText(o.plan);
    const bool own = o.plan.empty();
    const SweepPlan plan = own ? SweepFolder(o.folder, "", false).plan() : parsePlan(text, origin, namedScene);
    const auto [seconds, bytes, measured] = costOf(plan);
    const double all = seconds * static_cast<double>(plan.cases()) / o.jobs;
    const double disk = bytes * static_cast<double>(plan.cases());
    command::writeJson(o.json,
                       {{"cases", plan.cases()}, {"case_s", seconds}, {"estimated_s", all}, {"disk_mb", disk / 1e6}});
    if (o.json == "-") {
        return;
    }
    fmt::print("{}: {} = {} x {}; axes: ", plan.name, base::counted(plan.cases(), "case"),
               base::counted(plan.points.size(), "point"), base::counted(plan.repeats, "repeat"));
    for (const Axis& a : plan.axes) {
        fmt::print("{}{}", &a == &plan.axes[0] ? "" : ", ", a.name);
    }
    fmt::print("\nabout {:.3g} s a case, measured on {}: {} on {}; {:.3g} MB on the disk\n", seconds,
               base::counted(measured, "case"), duration(all),
               o.jobs == 1 ? std::string("one process") : fmt::format("{} processes", o.jobs), disk / 1e6);
}

bool isPart(const SweepArguments& o)
{
    return !o.shard.empty() || !o.cases.empty();
}

// A part of a sweep works in a folder of its own.
fs::path placeOf(const SweepArguments& o)
{
    return !o.shard.empty()   ? shardFolder(o.folder, o.shard)
           : !o.cases.empty() ? casesFolder(o.folder, casesOfList(o.cases, maxCases))  // the plan is not known yet
                              : fs::path(o.folder);
}

CasesWanted wantedOf(const SweepArguments& o, const SweepPlan& plan)
{
    CasesWanted wanted{{}, o.retry, o.anyBuild};
    wanted.cases = !o.shard.empty()   ? casesOfShard(o.shard, plan.cases())
                   : !o.cases.empty() ? casesOfList(o.cases, plan.cases())
                                      : casesOfShard("1/1", plan.cases());
    return wanted;
}

// Cases that the plan does not have are refused before there is a folder of the part: a merge would take it for a shard.
void checkPart(const SweepArguments& o, const fs::path& place)
{
    if (!isPart(o) || fs::exists(place / "plan.toml")) {
        return;
    }
    if (!o.plan.empty()) {
        const auto [text, origin] = planText(o.plan);
        wantedOf(o, parsePlan(text, origin, namedScene));
        checkPlanOfParts(o.folder, text, o.plan);
    } else if (fs::exists(fs::path(o.folder) / "plan.toml")) {
        wantedOf(o, SweepFolder(o.folder, "", false).plan());
    }
}

SlurmSettings merged(const SweepArguments& o, const SweepPlan& plan)
{
    SlurmSettings s = plan.slurm;
    for (const auto member :
         {&SlurmSettings::partition, &SlurmSettings::time, &SlurmSettings::account, &SlurmSettings::memory}) {
        s.*member = (o.slurm.*member).empty() ? s.*member : o.slurm.*member;
    }
    s.options.insert(s.options.end(), o.slurm.options.begin(), o.slurm.options.end());
    s.chunk = o.slurm.chunk > 0 ? o.slurm.chunk : s.chunk;
    return s;
}

PoolResult runCases(const SweepArguments& o, SweepFolder& folder, const std::vector<std::size_t>& cases, std::size_t all)
{
    command::Progress progress;
    const auto begin = Clock::now();
    const std::size_t before = all - cases.size();
    if (o.onSlurm) {
        const auto told = [&](std::size_t done, std::size_t running, std::size_t waiting) {
            progress.show(fmt::format("{}; {} running, {} waiting", bar(before, done, all, begin),
                                      base::counted(running, "task"), waiting));
            return interrupts == 0;
        };
        runOnSlurm(folder, cases, merged(o, folder.plan()), std::string(base::build()), told);
        const auto there =
            static_cast<std::size_t>(std::ranges::count_if(cases, [&](std::size_t i) { return folder.has(i); }));
        return {there, std::chrono::duration<double>(Clock::now() - begin).count(), 0.0};
    }
    const auto told = [&](std::size_t done, std::size_t running) {
        folder.lock().check();
        progress.show(interrupts > 0 ? fmt::format("finishing {}; Ctrl-C again aborts them", base::counted(running, "case"))
                                     : bar(before, done, all, begin));
        return interrupts == 0;
    };
    return runLocally(folder, cases, o.jobs, std::string(base::build()), told, [] { return interrupts > 1; });
}

// Table and figures of what there is; which of the wanted cases are not done.
std::vector<std::size_t> conclude(const SweepArguments& o, const SweepFolder& folder, const PoolResult& run,
                                  std::size_t begun, const std::vector<std::size_t>& wanted)
{
    const auto rows = folder.rows();
    const SweepTable table = writeTables(folder, rows);
    const auto failed =
        static_cast<std::size_t>(std::ranges::count_if(rows, [](const auto& r) { return r && r->failed(); }));
    const auto processes = static_cast<double>(std::min(begun, static_cast<std::size_t>(o.jobs)));
    const double fraction = run.seconds > 0 && processes > 0 ? run.cpuSeconds / (run.seconds * processes) : 0.0;
    const fs::path file = folder.path() / "table.csv";
    command::writeJson(o.json, {{"cases", wanted.size()},
                                {"done", table.rows.size()},
                                {"failed", failed},
                                {"seconds", run.seconds},
                                {"cpu_fraction", fraction},
                                {"table", file.string()}});
    if (o.json != "-") {
        fmt::print("{} of {}, {} failed; {} now in {:.3g} s{}\ntable: {}, {}\n", table.rows.size(),
                   base::counted(wanted.size(), "case"), failed, run.done, run.seconds,
                   run.cpuSeconds > 0 ? fmt::format(", {:.0f} % of {}", 100 * fraction,
                                                    base::counted(static_cast<std::size_t>(processes), "core"))
                                      : "",
                   file.string(), (folder.path() / "table.db").string());
    }
    if (!wanted.empty() && failed == wanted.size()) {
        const auto first = std::ranges::find_if(rows, [](const auto& r) { return r && r->failed(); });
        const std::string problem = "every case failed: " + (*first)->error;
        // Other parts may have cases that do not: who runs them all goes on to the merge, which tells.
        base::failIf(!isPart(o), "{}", problem);
        fmt::print(stderr, "palpate: {}\n", problem);
    }
    std::vector<std::size_t> missing;
    std::ranges::copy_if(wanted, std::back_inserter(missing), [&](std::size_t i) { return !rows[i]; });
    return missing;
}

void run(const SweepArguments& o)
{
    base::checkOutputs({o.json}, {o.plan});
    heedSignals();
    const fs::path place = placeOf(o);
    checkPart(o, place);
    if (isPart(o) && o.plan.empty() && !fs::exists(place / "plan.toml") && fs::exists(fs::path(o.folder) / "plan.toml")) {
        copyPlan(o.folder, place);
    }
    SweepFolder folder(place, o.plan, true);
    folder.clean();
    const CasesWanted wanted = wantedOf(o, folder.plan());
    const auto cases =
        remainingCases(folder, wanted, [](const std::string& what) { fmt::print(stderr, "palpate: {}\n", what); });
    const PoolResult result = cases.empty() ? PoolResult() : runCases(o, folder, cases, wanted.cases.size());
    const auto missing = conclude(o, folder, result, cases.size(), wanted.cases);
    base::failIf(!missing.empty(), "interrupted: {} of {} cases are done; the same command resumes",
                 wanted.cases.size() - missing.size(), wanted.cases.size());
    if (isPart(o) && o.json != "-") {
        fmt::print("when all parts are done: palpate sweep -o {} --merge\n", base::shellWord(o.folder));
    }
}

// One table of what shards have done, in their folders and in those that are named.
void merge(const SweepArguments& o)
{
    base::checkOutput(o.json);
    const std::vector<fs::path> from(o.merged.begin(), o.merged.end());
    const std::size_t came = mergeShards(o.folder, from, o.anyBuild);
    const SweepFolder folder(o.folder, o.plan, true);
    PoolResult result;
    result.done = came;
    const auto missing = conclude(o, folder, result, 0, casesOfShard("1/1", folder.plan().cases()));
    base::failIf(!missing.empty(), "{}: {} of {} cases are missing: run them with --cases {}, and merge again", o.folder,
                 missing.size(), folder.plan().cases(), listOfCases(missing));
}

void report(const SweepArguments& o)
{
    const SweepFolder folder = SweepFolder::ofResults(o.report);
    const auto rows = folder.rows();
    base::failIf(std::ranges::none_of(rows, [](const auto& r) { return r && !r->failed(); }),
                 "{}: no case is done yet: run the sweep first", o.report);
    const fs::path file = folder.path() / "report.html";
    base::writeWhole(file, sweepPage(folder.plan(), rows));
    command::writeJson(o.json, sensitivity(folder.plan(), rows));
    if (o.json != "-") {
        fmt::print("report: {}\n", file.string());
    }
}

void sweepCommand(const SweepArguments& o)
{
    // Of each process one core; and processes are forked from one thread.
    const auto alone = oneThread();
    if (o.list) {
        listAll();
    } else if (!o.work.empty()) {
        const char* const cores = std::getenv("SLURM_CPUS_PER_TASK");
        workOnChunk(o.work, cores != nullptr ? std::max(1, std::atoi(cores)) : 1, std::string(base::build()));
    } else if (!o.report.empty()) {
        report(o);
    } else if (o.folder.empty() && !o.dry) {
        throw std::runtime_error("sweep: no folder: add -o DIR");
    } else if (o.dry) {
        base::failIf(o.plan.empty() && o.folder.empty(), "sweep --dry-run: no plan: give a plan, or -o DIR");
        dryRun(o);
    } else if (o.merge) {
        merge(o);
    } else {
        run(o);
    }
}

void addParts(CLI::App& c, SweepArguments& o)
{
    auto* shard = c.add_option("--shard", o.shard, "Run only part K of N, in DIR/shards/K-of-N")->type_name("K/N");
    auto* cases = c.add_option("--cases", o.cases, "Run only these cases, e.g. 0-9,12, in a folder below DIR/shards")
                      ->type_name("LIST")
                      ->excludes(shard);
    auto* merge = c.add_option_function<std::vector<std::string>>(
        "--merge",
        [&o](const std::vector<std::string>& folders) {
            o.merge = true;
            std::ranges::remove_copy(folders, std::back_inserter(o.merged), "");
        },
        "Merge the results of shards, in DIR/shards and in these folders, into one table");
    merge->expected(0, CLI::detail::expected_max_vector_size)->type_name("[DIR..]")->excludes(shard)->excludes(cases);
}

// What would be ignored.
void refuseIgnored(CLI::App& c)
{
    const auto exclude = [&c](const char* option, std::initializer_list<const char*> others) {
        for (const char* const other : others) {
            c.get_option(option)->excludes(c.get_option(other));
        }
    };
    exclude("--slurm", {"--shard", "--cases", "--merge"});
    exclude("--dry-run", {"--shard", "--cases", "--merge", "--slurm", "--retry", "--any-build"});
    exclude("--merge", {"--jobs", "--retry"});
    exclude("--report", {"PLAN", "--output", "--dry-run", "--jobs", "--shard", "--cases", "--merge", "--slurm", "--retry",
                         "--any-build"});
    exclude("--list", {"PLAN", "--output", "--dry-run", "--jobs", "--shard", "--cases", "--merge", "--slurm", "--retry",
                       "--any-build", "--report", "--json"});
}

}  // namespace

void addSweep(CLI::App& app)
{
    auto o = std::make_shared<SweepArguments>();
    auto* c =
        app.add_subcommand("sweep", "Run many cases of a scene on all cores or a cluster, and write a table and a report");
    c->add_option(
        "PLAN", o->plan,
        fmt::format("Plan with parameters and outputs (.toml, docs/sweeps.md); ready: {}; default: the plan of the folder",
                    fmt::join(builtInPlans(), ", ")));
    c->add_option("-o,--output", o->folder, "Folder of the sweep; an interrupted sweep is resumed");
    c->add_flag("--dry-run", o->dry, "Run three cases, and print the number of cases and the expected time and disk space");
    command::addNumber(*c, "--jobs", o->jobs,
                       "Number of processes, one core each (default: all cores); the table does not depend on it", 1, 1024);
    addParts(*c, *o);
    auto* slurm = c->add_flag("--slurm", o->onSlurm, "Run as a Slurm job array: submit, watch, submit lost tasks again");
    c->add_option("--partition", o->slurm.partition, "Partition of the cluster (default: as in the plan)")->needs(slurm);
    c->add_option("--time", o->slurm.time, "Time limit of a task, in a format of sbatch (default: as in the plan)")
        ->needs(slurm);
    c->add_option("--account", o->slurm.account, "Account to charge (default: as in the plan)")->needs(slurm);
    c->add_option("--memory", o->slurm.memory, "Memory of a task, e.g. 2G (default: as in the plan)")->needs(slurm);
    c->add_option("--chunk", o->slurm.chunk, "Cases per task (default: as in the plan, or for about 100 tasks)")
        ->needs(slurm)
        ->check(CLI::PositiveNumber);
    c->add_option("--sbatch", o->slurm.options, "Further option for sbatch, e.g. --sbatch=--qos=long; may be repeated")
        ->needs(slurm)
        ->allow_extra_args(false);
    c->add_flag("--retry", o->retry, "Run failed cases again");
    c->add_flag("--any-build", o->anyBuild, "Resume or merge a sweep of other builds");
    c->add_option("--report", o->report, "Write report.html into this folder of a sweep");
    c->add_flag("--list", o->list, "List ready plans, and outputs of each procedure");
    c->add_option("--work", o->work, "Work of a task of a job array")->group("");
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    refuseIgnored(*c);
    c->final_callback([o] { sweepCommand(*o); });
}

}  // namespace palpate::sweep
