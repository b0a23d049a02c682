#include <sweep/slurm.h>

#include <base/child_process.h>
#include <base/descriptor.h>
#include <base/error.h>
#include <base/outputs.h>
#include <base/process.h>
#include <base/shell_word.h>
#include <base/split.h>
#include <sweep/lock.h>
#include <sweep/pool.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <set>
#include <string_view>
#include <thread>

namespace palpate::sweep {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::size_t usualTasks = 100;
constexpr std::size_t maxTasks = 1000;  // of an array: what a cluster allows by default (MaxArraySize 1001)
constexpr int maxLosses = 3;
constexpr auto askEvery = std::chrono::milliseconds(500);
constexpr auto settleTime = std::chrono::seconds(2);  // for files of another machine to be seen here
constexpr int maxSilence = 600;                       // looks in a row that the controller may leave unanswered

struct Answer {
    int status = 0;           // 127: there is no such program
    std::string text, error;  // standard output; standard error
};

// A file in memory that takes what a program prints: as much as it likes, on two streams at once.
class Printed {
public:
    Printed() : file_(::memfd_create("palpate-slurm", MFD_CLOEXEC))
    {
        base::failIf(!file_, "no memory for the answer of a program ({})", std::strerror(errno));
    }
    int stream() const noexcept { return *file_; }
    // Without the line's end.
    std::string text() const
    {
        std::string text;
        std::array<char, 4096> part{};
        ::lseek(*file_, 0, SEEK_SET);
        for (ssize_t n = 0; (n = ::read(*file_, part.data(), part.size())) > 0;) {
            text.append(part.data(), static_cast<std::size_t>(n));
        }
        return text.erase(text.find_last_not_of('\n') + 1);
    }

private:
    base::Descriptor file_;
};

// Warnings, such as one of a configuration that differs, are no part of an answer.
Answer ask(const std::vector<std::string>& words)
{
    const Printed out, err;
    const auto [pid, error] = base::start({words, {-1, out.stream(), err.stream()}});
    if (error == ENOENT) {
        return {127, "", ""};
    }
    base::failIf(error != 0, "{}: cannot be started ({})", words[0], std::strerror(error));
    const int status = base::exitStatus(pid);
    return {status, out.text(), err.text()};
}

std::string oneLine(std::string text)
{
    std::replace(text.begin(), text.end(), '\n', ';');
    return text;
}

using Chunk = std::vector<std::size_t>;

// A job array and the chunks that its tasks still work on.
struct Submission {
    std::string job;
    std::map<std::size_t, Chunk> tasks;
};

class Cluster {
public:
    Cluster(SweepFolder& folder, const SlurmSettings& settings) : folder_(folder), settings_(settings)
    {
        std::error_code failed;
        fs::create_directories(folder.path() / "slurm", failed);
    }
    ~Cluster() { cancel(); }
    Cluster& operator=(Cluster&&) = delete;

    void submit(const std::vector<std::size_t>& cases)
    {
        const std::size_t usual = (cases.size() + usualTasks - 1) / usualTasks;
        const std::size_t wanted = settings_.chunk > 0 ? static_cast<std::size_t>(settings_.chunk) : usual;
        const std::size_t chunk = std::max(wanted, (cases.size() + maxTasks - 1) / maxTasks);
        Submission s;
        json chunks = json::array();
        for (std::size_t at = 0; at < cases.size(); at += chunk) {
            const Chunk part(cases.begin() + static_cast<std::ptrdiff_t>(at),
                             cases.begin() + static_cast<std::ptrdiff_t>(std::min(at + chunk, cases.size())));
            s.tasks[chunks.size()] = part;
            chunks.push_back(part);
        }
        const std::string name = fmt::format("{}-{}", folder_.lock().id(), ++submissions_);
        const fs::path file = folder_.path() / "slurm" / (name + ".json");
        const fs::path script = folder_.path() / "slurm" / (name + ".sh");
        base::writeWhole(
            file, json{{"folder", folder_.path().string()}, {"lock", folder_.lock().id()}, {"chunks", chunks}}.dump());
        base::writeWhole(script, scriptText(file, chunks.size()));
        const Answer answer = ask({"sbatch", "--parsable", script.string()});
        if (answer.status != 0) {
            // The next try has names of its own.
            std::error_code none;
            fs::remove(file, none);
            fs::remove(script, none);
            fs::remove(file.parent_path(), none);  // where nothing else is in it
        }
        base::failIf(answer.status != 0, "sbatch: {}",
                     answer.status == 127 ? "there is no Slurm here: run without --slurm" : oneLine(answer.error));
        s.job = answer.text.substr(answer.text.rfind('\n') + 1);
        s.job = s.job.substr(0, s.job.find(';'));
        jobs_.push_back(std::move(s));
    }

    // Asks which tasks are there; gives the cases of those that have ended without a row for each.
    std::vector<std::size_t> look()
    {
        running = waiting = 0;
        std::vector<std::size_t> lost;
        for (Submission& s : jobs_) {
            const Answer answer = ask({"squeue", "-h", "-r", "-j", s.job, "-o", "%K %T"});
            const bool gone = answer.error.find("Invalid job id") != std::string::npos;
            if (answer.status != 0 && !gone) {
                base::failIf(++silence_ > maxSilence, "squeue: {}", oneLine(answer.error));
                running += s.tasks.size();
                continue;
            }
            silence_ = 0;
            takeIn(s, gone ? "" : answer.text, lost);
        }
        std::erase_if(jobs_, [](const Submission& s) { return s.tasks.empty(); });
        return lost;
    }

    bool idle() const { return jobs_.empty(); }
    void cancel()
    {
        for (const Submission& s : jobs_) {
            ask({"scancel", s.job});
        }
        jobs_.clear();
    }

    std::size_t running = 0, waiting = 0;  // tasks, at the last look

private:
    std::string scriptText(const fs::path& file, std::size_t tasks) const
    {
        std::string out = "#!/bin/sh\n";
        const auto option = [&](const std::string& text) { out += "#SBATCH " + text + "\n"; };
        option("--job-name=palpate-sweep");
        option(fmt::format("--array=0-{}", tasks - 1));
        option("--ntasks=1");
        // In the folder's name sbatch replaces nothing.
        const std::string logs = (folder_.path() / "slurm").string();
        option(fmt::format("--output=\"{}/%A_%a.log\"", fmt::join(base::splitAt('%', logs), "%%")));
        for (const auto& [name, value] : {std::pair<const char*, const std::string&>{"partition", settings_.partition},
                                          {"time", settings_.time},
                                          {"account", settings_.account},
                                          {"mem", settings_.memory}}) {
            if (!value.empty()) {
                option(fmt::format("--{}={}", name, value));
            }
        }
        for (const std::string& more : settings_.options) {
            option(more);
        }
        return out + fmt::format("exec {} sweep --work {}\n", base::shellWord((base::programFolder() / "palpate").string()),
                                 base::shellWord(file.string()));
    }

    void takeIn(Submission& s, const std::string& queue, std::vector<std::size_t>& lost)
    {
        const std::set<std::size_t> there = tasksIn(queue);
        std::vector<std::string> cancel{"scancel"};
        for (auto task = s.tasks.begin(); task != s.tasks.end();) {
            const bool done = std::ranges::all_of(task->second, [&](std::size_t i) { return folder_.has(i); });
            if (!done && !isGone(s.job, task->first, there)) {
                ++task;
                continue;
            }
            if (!done) {
                cancel.push_back(fmt::format("{}_{}", s.job, task->first));
            }
            std::ranges::copy_if(task->second, std::back_inserter(lost), [&](std::size_t i) { return !folder_.has(i); });
            task = s.tasks.erase(task);
        }
        if (cancel.size() > 1) {
            ask(cancel);  // what the queue does not show and works all the same would work beside its successor
        }
    }

    // Counts them by their state. Lines of something else are passed over.
    std::set<std::size_t> tasksIn(const std::string& queue)
    {
        std::set<std::size_t> there;
        for (const std::string_view line : base::splitAt('\n', queue)) {
            const auto blank = line.find(' ');
            if (const auto task = base::numberIn<std::size_t>(line.substr(0, blank)); task && blank != std::string::npos) {
                there.insert(*task);
                ++(line.substr(blank + 1).starts_with("PENDING") ? waiting : running);
            }
        }
        return there;
    }

    // Whether it has been out of the queue for as long as its files may take to be seen.
    bool isGone(const std::string& job, std::size_t task, const std::set<std::size_t>& there)
    {
        if (there.contains(task)) {
            seenGone_.erase({job, task});
            return false;
        }
        const auto now = std::chrono::steady_clock::now();
        return now - seenGone_.try_emplace({job, task}, now).first->second >= settleTime;
    }

    SweepFolder& folder_;
    const SlurmSettings& settings_;
    std::vector<Submission> jobs_;
    std::map<std::pair<std::string, std::size_t>, std::chrono::steady_clock::time_point> seenGone_;
    int submissions_ = 0, silence_ = 0;
};

}  // namespace

bool runOnSlurm(SweepFolder& folder, const std::vector<std::size_t>& cases, const SlurmSettings& settings,
                const std::string& build, const SlurmTold& told)
{
    Cluster cluster(folder, settings);
    std::map<std::size_t, int> losses;
    std::vector<std::size_t> left = cases;
    cluster.submit(cases);
    while (!cluster.idle()) {
        std::this_thread::sleep_for(askEvery);
        folder.lock().check();
        std::vector<std::size_t> again;
        for (const std::size_t i : cluster.look()) {
            if (++losses[i] < maxLosses) {
                again.push_back(i);
                continue;
            }
            SweepRow row;
            row.index = i;
            row.build = build;
            row.error =
                fmt::format("lost {} times: its task was killed, timed out or its node failed; see slurm/*.log", maxLosses);
            folder.write(row);
        }
        if (!again.empty()) {
            cluster.submit(again);
        }
        std::erase_if(left, [&](std::size_t i) { return folder.has(i); });
        if (!told(cases.size() - left.size(), cluster.running, cluster.waiting)) {
            cluster.cancel();
            return false;
        }
    }
    return true;
}

void workOnChunk(const fs::path& file, int jobs, const std::string& build)
{
    std::ifstream in(file);
    const json submission = json::parse(in, nullptr, false);
    const char* const task = std::getenv("SLURM_ARRAY_TASK_ID");
    const std::size_t number = task != nullptr ? static_cast<std::size_t>(std::strtoul(task, nullptr, 10)) : 0;
    base::failIf(!submission.is_object() || !submission.contains("chunks") || number >= submission["chunks"].size(),
                 "{}: holds no chunk for this task", file.native());
    SweepFolder folder(submission.at("folder").get<std::string>(), "", false);
    const auto lock = submission.at("lock").get<std::string>();
    std::vector<std::size_t> cases = submission["chunks"][number];
    std::erase_if(cases, [&](std::size_t i) { return folder.has(i); });
    const auto told = [&](std::size_t, std::size_t) {
        base::failIf(FolderLock::holder(folder.path()) != lock,
                     "{}: the run that submitted this task is over: the task ends", folder.path().native());
        return true;
    };
    runLocally(folder, cases, jobs, build, told, [] { return false; });
}

}  // namespace palpate::sweep
