#include <trainer/running.h>

#include <base/descriptor.h>
#include <base/error.h>
#include <base/process.h>

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>

#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>
#include <utility>

namespace palpate::trainer {

Running::Running(const std::filesystem::path& program, const std::vector<std::string>& arguments, std::filesystem::path log)
    : log_(std::move(log))
{
    const base::Descriptor out(::open(log_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
    base::Program started{{program.string()}, {-1, *out, *out}, true};
    started.words.insert(started.words.end(), arguments.begin(), arguments.end());
    const auto [pid, error] = base::start(started);
    base::failIf(error != 0, "{}: cannot be started ({})", program.native(), std::strerror(error));
    pid_ = pid;
}

Running::~Running()
{
    end();
    constexpr double patience = 5;  // [s]
    if (!finish(patience)) {
        ::kill(pid_, SIGKILL);
        ::waitpid(pid_, nullptr, 0);
    }
}

bool Running::finish(double seconds) noexcept
{
    constexpr double look = 0.02;  // [s]
    for (double waited = 0; waited < seconds && !ended(); waited += look) {
        std::this_thread::sleep_for(std::chrono::duration<double>(look));
    }
    return ended();
}

void Running::end() const noexcept
{
    if (pid_ > 0) {
        ::kill(pid_, SIGTERM);
    }
}

void Running::conclude() const noexcept
{
    if (pid_ > 0) {
        ::kill(pid_, SIGUSR1);
    }
}

bool Running::ended() noexcept
{
    if (pid_ > 0 && ::waitpid(pid_, &status_, WNOHANG) == pid_) {
        pid_ = -1;
    }
    return pid_ < 0;
}

bool Running::failed() const noexcept
{
    return !(WIFEXITED(status_) && WEXITSTATUS(status_) == 0);
}

std::string Running::message() const
{
    if (pid_ < 0 && WIFSIGNALED(status_)) {
        return "";
    }
    std::ifstream in(log_);
    std::string last;
    for (std::string line; std::getline(in, line);) {
        if (line.starts_with("palpate")) {
            last = line;
        }
    }
    return last;
}

}  // namespace palpate::trainer
