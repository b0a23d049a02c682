#include <apps/child_process.h>

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <thread>

extern char** environ;

namespace palpate::apps {

std::filesystem::path programFolder()
{
    return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

ChildProcess::ChildProcess(const std::string& program, const std::vector<std::string>& arguments, const std::string& remedy)
{
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const auto& a : arguments) {
        argv.push_back(const_cast<char*>(a.c_str()));
    }
    argv.push_back(nullptr);

    // A group of its own: Ctrl-C ends this program, and the other then ends with it.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    const int error = posix_spawnp(&pid_, program.c_str(), nullptr, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    if (error != 0) {
        pid_ = -1;
        throw std::runtime_error(program + ": cannot be started (" + std::strerror(error) + "); " + remedy);
    }
}

ChildProcess::~ChildProcess()
{
    if (pid_ > 0) {
        kill(pid_, SIGTERM);
        kill(pid_, SIGCONT);  // what is stopped takes no other signal
        wait(2.0);
    }
    if (pid_ > 0) {
        // It holds nothing that could be lost: what a viewer shows is the session's, and files get their name when they are
        // whole.
        kill(pid_, SIGKILL);
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

}  // namespace palpate::apps
