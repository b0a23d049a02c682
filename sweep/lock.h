#pragma once

#include <chrono>
#include <filesystem>
#include <string>

namespace palpate::sweep {

/// One run at a time on a folder: a file in it that says who. A process that has died is recognised on the same machine by
/// its number and start, from another machine (a shared folder) by a beat that has stopped for a minute, told by the
/// folder's own clock.
class FolderLock {
public:
    /// Throws std::runtime_error that names who holds the folder.
    explicit FolderLock(std::filesystem::path folder);
    ~FolderLock();
    FolderLock(const FolderLock&) = delete;
    FolderLock& operator=(const FolderLock&) = delete;

    /// Now and then while it is held. Throws std::runtime_error when another run has taken the folder over, as after a
    /// machine slept.
    void beat();
    const std::string& id() const noexcept { return id_; }

    /// The id of who holds the folder; empty: nobody.
    static std::string holder(const std::filesystem::path& folder);

private:
    std::filesystem::path folder_, file_;
    std::string id_;
    std::chrono::steady_clock::time_point beaten_;
};

/// Name of this machine.
std::string machineName();

}  // namespace palpate::sweep
