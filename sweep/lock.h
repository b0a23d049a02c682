#pragma once

#include <base/file_lock.h>

#include <filesystem>
#include <string>

namespace palpate::sweep {

/// One run at a time on a folder: a locked file in it that says who.
class FolderLock {
public:
    /// Throws std::runtime_error that names who holds the folder.
    explicit FolderLock(std::filesystem::path folder);

    /// Now and then while it is held. Throws std::runtime_error when another run has taken the folder over: a file server
    /// gives the lock away when it has not heard from this machine for long.
    void check() const;
    /// In a process of the run: the lock is the run's alone, and ends with it.
    void leave() noexcept { lock_.leave(); }
    const std::string& id() const noexcept { return id_; }

    /// The id of who holds the folder or did so when it died; empty: nobody.
    static std::string holder(const std::filesystem::path& folder);

private:
    std::filesystem::path folder_;
    std::string id_;
    base::FileLock lock_;
};

}  // namespace palpate::sweep
