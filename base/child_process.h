#pragma once

#include <base/process.h>

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::base {

/// Another program running as a process of its own. Nothing that happens to it reaches the simulation.
class ChildProcess {
public:
    /// Starts `program`, a path or a name to be looked for in PATH; its messages go to standard error. Throws
    /// std::runtime_error, which ends in `remedy`, when it cannot be started.
    ChildProcess(const std::string& program, const std::vector<std::string>& arguments, const std::string& remedy);
    /// The same with streams of its own; the program always gets a group of its own.
    /// @pre  at least one word
    ChildProcess(Program program, const std::string& remedy);
    ChildProcess& operator=(ChildProcess&&) = delete;
    /// Asks it and what it has started to end (SIGTERM) if it still runs, and after two seconds no longer asks (SIGKILL).
    ~ChildProcess();

    /// Waits up to `seconds` for it to end by itself. Returns its exit status; -1 when it was killed or still runs.
    int wait(double seconds);
    /// Its number, which is its group's too; -1 once it has ended.
    pid_t pid() const noexcept { return pid_; }
    /// Whether a signal has killed it.
    bool killed();
    /// Stops it (SIGSTOP), or lets it go on (SIGCONT), if it still runs.
    void stall(bool stopped) noexcept;

private:
    bool look();

    pid_t pid_ = -1;
    int status_ = -1;
    bool killed_ = false;
};

/// Folder of the running program.
std::filesystem::path programFolder();

}  // namespace palpate::base
