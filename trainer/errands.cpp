#include <trainer/errands.h>

#include <base/process.h>
#include <base/temporary_folder.h>
#include <base/words.h>

#include <nlohmann/json.hpp>

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fstream>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace palpate::trainer {

namespace fs = std::filesystem;
using base::tr;

namespace {

// A command that runs; what it prints is kept in a file.
class Running {
public:
    Running(const fs::path& program, const std::vector<std::string>& arguments, fs::path log) : log_(std::move(log))
    {
        const int out = ::open(log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
        base::Program started{{program.string()}, {-1, out, out}, true};
        started.words.insert(started.words.end(), arguments.begin(), arguments.end());
        const auto [pid, error] = base::start(started);
        if (out >= 0) {
            ::close(out);
        }
        if (error != 0) {
            throw std::runtime_error(program.string() + ": cannot be started (" + std::strerror(error) + ")");
        }
        pid_ = pid;
    }
    ~Running()
    {
        end();
        if (!finish()) {
            ::kill(pid_, SIGKILL);
            ::waitpid(pid_, nullptr, 0);
        }
    }
    Running(const Running&) = delete;
    Running& operator=(const Running&) = delete;

    // Waits five seconds at most for its end.
    bool finish() noexcept
    {
        for (int i = 0; i < 200 && !ended(); ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(25));
        }
        return ended();
    }
    void end() const noexcept
    {
        if (pid_ > 0) {
            ::kill(pid_, SIGTERM);
        }
    }
    bool ended() noexcept
    {
        if (pid_ > 0 && ::waitpid(pid_, &status_, WNOHANG) == pid_) {
            pid_ = -1;
        }
        return pid_ < 0;
    }
    bool failed() const noexcept { return !(WIFEXITED(status_) && WEXITSTATUS(status_) == 0); }
    // The last line that the command printed as its own message.
    std::string message() const
    {
        std::ifstream in(log_);
        std::string last;
        for (std::string line; std::getline(in, line);) {
            if (line.starts_with("palpate")) {
                last = line;
            }
        }
        return last;
    }

private:
    fs::path log_;
    pid_t pid_ = -1;
    int status_ = 0;
};

}  // namespace

struct Errands::Impl {
    Impl(fs::path where, ResultSink& to) : programs(std::move(where)), sink(to) {}

    void startSession(State& state)
    {
        const SessionFiles files = sink.filesFor(chosenCase(state));
        const auto arguments = trainArguments(state, files);
        session.emplace(programs / "palpate", arguments, scratch / "session.log");
        sessionStarted(state, files, asTyped("palpate", arguments));
    }
    void startDebrief(State& state)
    {
        const auto arguments = debriefArguments(state);
        replay.emplace(programs / "palpate-view", arguments, scratch / "replay.log");
        state.command = asTyped("palpate-view", arguments);
        state.replaying = true;
    }
    // What a short command writes as JSON; null where it fails, and the state says why.
    nlohmann::json answerOf(State& state, std::vector<std::string> arguments)
    {
        const fs::path file = scratch / "answer.json";
        fs::remove(file);
        arguments.insert(arguments.end(), {"--json", file.string()});
        Running command(programs / "palpate", arguments, scratch / "answer.log");
        command.finish();
        std::ifstream in(file);
        auto answer = nlohmann::json::parse(in, nullptr, false);
        if (answer.is_discarded()) {
            const std::string said = command.message();
            state.notice = said.empty() ? asTyped("palpate", arguments) + tr(": no answer") : said;
        }
        return answer;
    }
    void listPeople(State& state)
    {
        state.people = peopleOf(answerOf(state, {"profile", "list"}));
        if (std::ranges::find(state.people, state.person) == state.people.end()) {
            state.person.clear();
        }
    }
    void addPerson(State& state)
    {
        const std::string name = state.newPerson;
        Running command(programs / "palpate", {"profile", "new", name}, scratch / "person.log");
        command.finish();
        state.notice = command.message();
        listPeople(state);
        if (std::ranges::find(state.people, name) != state.people.end()) {
            state.person = name;
            state.newPerson.clear();
        }
    }
    void checkDevices()
    {
        fs::remove(scratch / "devices.json");
        devices.emplace(programs / "palpate", std::vector<std::string>{"devices", "--json", scratch / "devices.json"},
                        scratch / "devices.log");
    }

    void testForce(State& state)
    {
        fs::remove(scratch / "force.json");
        std::vector<std::string> words{"devices", "--force-test", "--json", scratch / "force.json"};
        if (!state.firmware.empty()) {
            words.insert(words.end(), {"--falcon-firmware", state.firmware});
        }
        push.emplace(programs / "palpate", words, scratch / "force.log");
        state.pushing = true;
    }
    void tryHand(State& state)
    {
        tryout.emplace(programs / "palpate", tryoutArguments(state), scratch / "tryout.log");
        state.trying = true;
    }
    // An expert's session in the anatomy of the case is made once, and kept beside the others.
    void seeExpert(State& state)
    {
        const fs::path record = state.files.record.parent_path() / ("expert-" + chosenCase(state).id + ".db");
        if (fs::exists(record)) {
            state.ghost = record;
            return startDebrief(state);
        }
        const fs::path part = record.string() + ".part";
        fs::remove(part);
        expert.emplace(programs / "palpate", expertArguments(state, part), scratch / "expert.log");
        state.ghost = record;
        state.ghosting = true;
    }
    // With ffmpeg a film, without it pictures.
    void makeFilm(State& state)
    {
        const bool can = ::access("/usr/bin/ffmpeg", X_OK) == 0;
        made = fs::path(state.files.record).replace_extension(can ? ".mp4" : ".pictures");
        film.emplace(programs / "palpate-view",
                     std::vector<std::string>{"--replay", state.files.record, can ? "--movie" : "--offscreen", made},
                     scratch / "film.log");
        state.filming = true;
    }
    void keepSettings(State& state)
    {
        base::useLanguage(state.settings.language);
        state.notice = writeSettings(settingsFile(), state.settings);
    }

    // What has ended of all that is beside a session.
    bool lookAtHelpers(State& state)
    {
        bool changed = false;
        const auto over = [&changed](std::optional<Running>& one) {
            const bool ended = one && one->ended();
            changed = changed || ended;
            return ended;
        };
        if (over(push)) {
            push.reset();
            state.pushing = false;
            readForceTest(scratch / "force.json", state.devices);
        }
        if (over(tryout)) {
            state.notice = tryout->failed() ? tryout->message() : "";
            tryout.reset();
            state.trying = false;
        }
        if (over(expert)) {
            state.notice = expert->failed() ? expert->message() : "";
            state.ghosting = false;
            if (!expert->failed()) {
                fs::rename(state.ghost.string() + ".part", state.ghost);
                startDebrief(state);
            }
            expert.reset();
        }
        if (over(film)) {
            state.notice = film->failed() ? film->message() : made.string();
            state.filming = false;
            film.reset();
        }
        return changed;
    }

    fs::path made;  // film or pictures
    fs::path programs;
    const base::TemporaryFolder scratch{tr("what the commands print")};  // goes after those that run
    ResultSink& sink;
    std::optional<Running> session, devices, replay, push, tryout, expert, film;
};

Errands::Errands(fs::path programs, ResultSink& sink) : impl_(std::make_unique<Impl>(std::move(programs), sink)) {}

Errands::~Errands() = default;

void Errands::list(State& state)
{
    try {
        state.cases = casesOf(impl_->answerOf(state, {"case", "list"}));
        for (CaseEntry& c : state.cases) {
            c.best = impl_->sink.best(c);
        }
        impl_->listPeople(state);
    } catch (const std::exception& e) {
        state.notice = e.what();
    }
}

void Errands::run(Errand errand, State& state)
{
    try {
        switch (errand) {
            case Errand::addPerson:
                return impl_->addPerson(state);
            case Errand::checkDevices:
                state.devices = {};
                return impl_->checkDevices();
            case Errand::startSession:
                return impl_->startSession(state);
            case Errand::endSession:
                if (impl_->session) {
                    impl_->session->end();
                }
                return;
            case Errand::testForce:
                return impl_->testForce(state);
            case Errand::tryHand:
                return impl_->tryHand(state);
            case Errand::seeExpert:
                return impl_->seeExpert(state);
            case Errand::makeFilm:
                return impl_->makeFilm(state);
            case Errand::keepSettings:
                impl_->keepSettings(state);
                return list(state);
            case Errand::startDebrief:
                state.ghost.clear();
                return impl_->startDebrief(state);
            case Errand::none:
            case Errand::quit:
                return;
        }
    } catch (const std::exception& e) {
        state.notice = e.what();
    }
}

bool Errands::look(State& state)
{
    bool changed = false;
    if (impl_->devices && impl_->devices->ended()) {
        impl_->devices.reset();
        state.devices = readDevices(impl_->scratch / "devices.json");
        state.useFalcon = state.useFalcon && state.devices.falconReady;
        changed = true;
    }
    if (impl_->session && impl_->session->ended()) {
        Result result = readResult(state.files.figures);
        if (!result.problem.empty()) {
            const std::string said = impl_->session->message();
            result.problem = said.empty() ? result.problem : said;
        } else {
            impl_->sink.keep(chosenCase(state), state.files, result);
        }
        impl_->session.reset();
        sessionEnded(state, std::move(result));
        changed = true;
    }
    changed = impl_->lookAtHelpers(state) || changed;
    if (impl_->replay && impl_->replay->ended()) {
        impl_->replay.reset();
        state.replaying = false;
        changed = true;
    }
    return changed;
}

}  // namespace palpate::trainer
