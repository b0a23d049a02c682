#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::apps {

/// palpate-view running as a process of its own. Nothing that happens to it reaches the simulation.
class ViewerProcess {
public:
    /// Starts the palpate-view that lies beside this program with these arguments; its messages go to standard error.
    /// Throws std::runtime_error when it is not there.
    explicit ViewerProcess(const std::vector<std::string>& arguments);
    ViewerProcess(const ViewerProcess&) = delete;
    ViewerProcess& operator=(const ViewerProcess&) = delete;
    /// Asks it to end (SIGTERM) if it still runs.
    ~ViewerProcess();

    /// Waits up to `seconds` for it to end by itself. Returns its exit status; -1 when it was killed or still runs.
    int wait(double seconds);

private:
    pid_t pid_ = -1;
    int status_ = -1;
};

/// Folder of the running program.
std::filesystem::path programFolder();

}  // namespace palpate::apps
