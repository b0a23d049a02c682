#pragma once

#include <base/descriptor.h>

#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>

namespace palpate::base {

/// A file that one process at a time holds, by the system's own locks (fcntl, F_OFD_SETLK): the lock of a process that has
/// died, however, is gone, and on NFS the server keeps it for all machines. The file is there while it is held, and after a
/// crash.
class FileLock {
public:
    /// Makes the file where there is none. Nothing: another process holds it.
    /// Throws std::runtime_error when the file cannot be made or the file system has no locks.
    static std::optional<FileLock> of(const std::filesystem::path& file);

    FileLock(FileLock&& other) noexcept = default;
    FileLock& operator=(FileLock&&) = delete;
    /// Removes the file and lets go.
    ~FileLock();

    /// What others read in the file, in place of what was in it. Throws std::runtime_error.
    void write(std::string_view text) const;
    /// In a child after fork(), which has the lock too: leaves it to the parent, so that it ends with the parent.
    void leave() noexcept { descriptor_ = Descriptor(); }

private:
    FileLock(std::filesystem::path file, Descriptor descriptor) : file_(std::move(file)), descriptor_(std::move(descriptor))
    {
    }

    std::filesystem::path file_;
    Descriptor descriptor_;  // none: let go
};

}  // namespace palpate::base
