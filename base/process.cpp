#include <base/process.h>

#include <base/error.h>

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cassert>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

extern char** environ;

namespace palpate::base {

std::string hostName()
{
    std::array<char, 256> name{};
    return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

// Field 22 of /proc/PID/stat (proc(5)). The command's name is in brackets and may hold anything, so count from the last
// one.
std::uint64_t processStart(std::uint64_t pid) noexcept
{
    std::array<char, 64> path{};
    std::snprintf(path.data(), path.size(), "/proc/%llu/stat", static_cast<unsigned long long>(pid));
    const int file = ::open(path.data(), O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        return 0;
    }
    std::array<char, 1024> text{};
    const ssize_t length = ::read(file, text.data(), text.size() - 1);
    ::close(file);
    if (length <= 0) {
        return 0;
    }
    const char* at = std::strrchr(text.data(), ')');
    if (at == nullptr || at[1] != ' ' || at[2] == 'Z' || at[2] == 'X') {
        return 0;
    }
    constexpr int stateField = 3, startField = 22;
    at += 2;
    for (int field = stateField; field < startField; ++field) {
        at = std::strchr(at, ' ');
        if (at == nullptr) {
            return 0;
        }
        ++at;
    }
    return std::strtoull(at, nullptr, 10);
}

StartedProgram start(const Program& program)
{
    assert(!program.words.empty());
    std::vector<char*> argv;
    for (const std::string& word : program.words) {
        argv.push_back(const_cast<char*>(word.c_str()));
    }
    argv.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    for (int i = 0; i < 3; ++i) {
        if (const int stream = program.streams[static_cast<std::size_t>(i)]; stream >= 0) {
            posix_spawn_file_actions_adddup2(&files, stream, i);
        }
    }
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, static_cast<short>(program.ownGroup ? POSIX_SPAWN_SETPGROUP : 0));
    StartedProgram started;
    started.error = posix_spawnp(&started.pid, argv[0], &files, &attributes, argv.data(), environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (started.error != 0) {
        started.pid = -1;
    }
    return started;
}

int exitStatus(pid_t child) noexcept
{
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int run(const Program& program)
{
    const auto [pid, error] = start(program);
    base::failIf(error != 0, "{}: cannot be started ({})", program.words[0], std::strerror(error));
    return exitStatus(pid);
}

void becomeQuietChild() noexcept
{
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0) {
        ::dup2(nowhere, STDOUT_FILENO);
        ::dup2(nowhere, STDERR_FILENO);
    }
}

}  // namespace palpate::base
