#include <studies/accuracy/rival.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/split.h>
#include <studies/accuracy/rival_files.h>
#include <studies/kernel/kernel_trial.h>

#include <fmt/format.h>

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cstdlib>
#include <iterator>
#include <numeric>
#include <sstream>
#include <stdexcept>

namespace palpate::studies {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t maxPoints = 400'000;  // of a mesh

// Words of a command that are files, as they are or in PATH.
std::vector<fs::path> filesIn(const std::string& command)
{
    const char* const path = std::getenv("PATH");
    const std::string folders = path != nullptr ? path : "";
    std::vector<fs::path> files;
    std::error_code none;
    std::istringstream words(command);
    for (std::string word; words >> word;) {
        std::erase_if(word, [](char c) { return c == '"' || c == '\''; });
        if (fs::is_regular_file(word, none)) {
            files.emplace_back(word);
            continue;
        }
        for (const std::string_view folder : base::splitAt(':', folders)) {
            const fs::path file = fs::path(folder) / word;
            if (!word.empty() && word.find('/') == std::string::npos && fs::is_regular_file(file, none)) {
                files.push_back(file);
                break;
            }
        }
    }
    return files;
}

bool isName(const std::string& text)
{
    const auto plain = [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.';
    };
    return !text.empty() && text.front() != '.' && text.front() != '-' && std::ranges::all_of(text, plain);
}

std::string nameFor(const std::string& command)
{
    const auto files = filesIn(command);
    std::string first;
    std::istringstream(command) >> first;
    return files.empty() ? fs::path(first).stem().string() : files.back().stem().string();
}

// While it is there, what ends this program ends the rival first, which is in a group of its own.
volatile pid_t rivalGroup = 0;
constexpr std::array endings{SIGINT, SIGTERM, SIGHUP, SIGQUIT};
std::array<struct sigaction, endings.size()> endingsBefore;

void onEnding(int signal)
{
    ::kill(-rivalGroup, SIGKILL);
    const auto* const at = std::find(endings.begin(), endings.end(), signal);
    ::sigaction(signal, &endingsBefore[static_cast<std::size_t>(at - endings.begin())], nullptr);
    ::raise(signal);
}

class EndsWithUs {
public:
    explicit EndsWithUs(pid_t group)
    {
        rivalGroup = group;
        struct sigaction action {};
        action.sa_handler = onEnding;
        for (std::size_t i = 0; i < endings.size(); ++i) {
            ::sigaction(endings[i], nullptr, &endingsBefore[i]);
            if (endingsBefore[i].sa_handler != SIG_IGN) {
                ::sigaction(endings[i], &action, nullptr);
            }
        }
    }
    ~EndsWithUs()
    {
        for (std::size_t i = 0; i < endings.size(); ++i) {
            ::sigaction(endings[i], &endingsBefore[i], nullptr);
        }
    }
    EndsWithUs& operator=(EndsWithUs&&) = delete;
};

// What the command said last, for a message.
std::string lastWords(const fs::path& log)
{
    const std::string last = lastLine(log);
    return last.empty() ? "" : fmt::format(" ({} ends with: {})", log.filename().string(), last);
}

void runCommand(const Rival& rival, const fs::path& folder, double maxSeconds)
{
    const fs::path log = folder / "log.txt";
    const File none("/dev/null", O_RDONLY), said(log, O_WRONLY | O_CREAT | O_TRUNC);
    base::failIf(said.number() < 0, "{}: cannot be written", log.native());
    const std::string line = rival.command + " \"$1\"";
    base::ChildProcess child(base::Program{{"/bin/sh", "-c", line, "sh", fs::absolute(folder).string()},
                                           {none.number(), said.number(), said.number()},
                                           true},
                             "a rival's command is a line for /bin/sh");
    const EndsWithUs guard(child.pid());
    const int status = child.wait(maxSeconds);
    constexpr int signalled = 128;  // more is the shell's way to say that a signal has ended the command
    if (child.killed() || status > signalled) {
        const std::string which = child.killed() ? "a signal" : fmt::format("signal {}", status - signalled);
        throw base::error("was ended by {}{}", which, lastWords(log));
    }
    if (child.pid() > 0) {
        throw base::error("has not ended in {:g} s (--rival-limit){}", maxSeconds, lastWords(log));
    }
    if (status != 0) {
        throw base::error("exit status {}{}", status, lastWords(log));
    }
}

TrialResult compared(const RivalAnswer& answer, const TetBody& mesh, const AccuracySubject& subject,
                     const Reference& reference)
{
    const PositionCells cells = positionCells(reference.position);
    const auto places = base::mapped<TetPlace>(reference.position, [&](const Vec3f& p) { return placeOf(mesh, Vec3(p)); });
    TrialResult result;
    std::size_t look = 0;
    for (const TrialTick& t : schedule(subject.path, subject.speed)) {
        if (!t.look) {
            continue;
        }
        const auto u = base::mapped<Vec3>(places, [&](const TetPlace& place) {
            return valueAt(place, [&](std::uint32_t p) { return answer.u[look][p]; });
        });
        result.looks.push_back(errorsOf(u, answer.force[look], reference, cells, stateAt(reference, t.pose)));
        result.looks.back().phase = t.phase;
        ++look;
    }
    const TickTimes times = tickTimes(answer.seconds);
    result.p50 = times.p50;
    result.p99 = times.p99;
    result.mean =
        std::accumulate(answer.seconds.begin(), answer.seconds.end(), 0.0) / static_cast<double>(answer.seconds.size());
    result.cpu = result.mean;
    result.ticks = answer.seconds.size();
    return result;
}

void answerPush(const Rival& rival, const TetBody& mesh, const AccuracySubject& subject,
                std::span<const Reference* const> references, const fs::path& folder, double maxSeconds, AccuracyRun& run)
{
    using Clock = std::chrono::steady_clock;
    const auto start = Clock::now();
    runCommand(rival, folder, maxSeconds);
    const double took = std::chrono::duration<double>(Clock::now() - start).count();
    const auto ticks = schedule(subject.path, subject.speed);
    const auto looks = static_cast<std::size_t>(std::ranges::count_if(ticks, &TrialTick::look));
    const RivalAnswer answer = readRivalAnswer(folder, looks, mesh.points.size());
    run.hasForce = true;
    run.buildSeconds = std::max(0.0, took - std::accumulate(answer.seconds.begin(), answer.seconds.end(), 0.0));
    const auto compare = [&](const Reference* reference) { return compared(answer, mesh, subject, *reference); };
    std::ranges::transform(references, std::back_inserter(run.results), compare);
}

}  // namespace

Rival rivalOf(const std::string& text, const std::vector<double>& spacings)
{
    const std::size_t at = text.find('=');
    const bool named = at != std::string::npos && isName(text.substr(0, at));
    Rival rival{"", std::string(base::trimmed(named ? std::string_view(text).substr(at + 1) : text)), "", spacings};
    base::failIf(rival.command.empty(), "--rival {}: there is no command in it: COMMAND or NAME=COMMAND", text);
    rival.name = named ? text.substr(0, at) : nameFor(rival.command);
    base::failIf(!isName(rival.name),
                 "--rival {}: '{}' cannot be its name: write NAME=COMMAND, a name of letters, "
                 "digits, '_', '-' and '.'",
                 text, rival.name);
    return rival;
}

std::string fingerprint(const Rival& rival)
{
    std::string out = rival.command;
    for (const fs::path& file : filesIn(rival.command)) {
        std::error_code none;
        out += fmt::format("|{}:{}", fs::last_write_time(file, none).time_since_epoch().count(), fs::file_size(file, none));
    }
    return out;
}

std::string settingOf(const Rival& rival, double spacing)
{
    return fmt::format("{:g} mm{}{}", 1e3 * spacing, rival.setting.empty() ? "" : ", ", rival.setting);
}

AccuracyRun runRival(const Rival& rival, double spacing, const std::string& scene, const AccuracySubject& subject,
                     std::span<const Reference* const> references, const fs::path& folder, double maxSeconds)
{
    AccuracyRun run;
    try {
        fs::create_directories(folder);
        for (const char* old : {"displacements.csv", "forces.csv", "times.csv"}) {
            fs::remove(folder / old);
        }
        const BaselineScene body = subject.scene();
        const TetBody mesh = latticeTets(body.tissue, body.surface, spacing, body.poissonCap, maxPoints);
        writeRivalPush(folder, scene, subject, mesh);
        answerPush(rival, mesh, subject, references, folder, maxSeconds, run);
    } catch (const std::runtime_error& e) {
        run.results.clear();
        run.failure = e.what();
    }
    return run;
}

}  // namespace palpate::studies
