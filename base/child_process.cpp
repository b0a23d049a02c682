#include <base/child_process.h>

#include <signal.h>
#include <sys/wait.h>

#include <chrono>
#include <cstring>
#include <stdexcept>
#include <thread>

namespace palpate::base {

std::filesystem::path programFolder()
{
    return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

namespace {

Program programOf(const std::string& name, const std::vector<std::string>& arguments)
{
    Program program{{name}, {-1, -1, -1}, true};
    program.words.insert(program.words.end(), arguments.begin(), arguments.end());
    return program;
}

}  // namespace

ChildProcess::ChildProcess(const std::string& program, const std::vector<std::string>& arguments, const std::string& remedy)
    : ChildProcess(programOf(program, arguments), remedy)
{
}

ChildProcess::ChildProcess(Program program, const std::string& remedy)
{
    // A group of its own: Ctrl-C ends this program, and the other then ends with it.
    program.ownGroup = true;
    const auto [pid, error] = start(program);
    if (error != 0) {
        throw std::runtime_error(program.words[0] + ": cannot be started (" + std::strerror(error) + "); " + remedy);
    }
    pid_ = pid;
}

ChildProcess::~ChildProcess()
{
    const pid_t group = pid_;
    if (pid_ > 0) {
        kill(-group, SIGTERM);
        kill(-group, SIGCONT);  // what is stopped takes no other signal
        wait(2.0);
    }
    if (group > 0) {
        // It holds nothing that could be lost: what a viewer shows is the session's, and files get their name when they are
        // whole. Nor does what it has started, and may have left behind.
        kill(-group, SIGKILL);
        wait(2.0);
    }
}

void ChildProcess::stall(bool stopped) noexcept
{
    if (pid_ > 0) {
        kill(pid_, stopped ? SIGSTOP : SIGCONT);
    }
}

// Whether it has just been found to have ended.
bool ChildProcess::look()
{
    int status = 0;
    if (pid_ <= 0 || waitpid(pid_, &status, WNOHANG) != pid_) {
        return false;
    }
    status_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    killed_ = WIFSIGNALED(status);
    pid_ = -1;
    return true;
}

bool ChildProcess::killed()
{
    look();
    return killed_;
}

int ChildProcess::wait(double seconds)
{
    using Clock = std::chrono::steady_clock;
    const auto end = Clock::now() + std::chrono::duration<double>(seconds);
    while (pid_ > 0 && !look()) {
        if (Clock::now() > end) {
            return -1;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return status_;
}

}  // namespace palpate::base
