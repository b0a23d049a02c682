#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

namespace palpate::channel {

/// Bytes of a file in memory, shared with who else has it mapped, until they are let go.
///
/// Keeps the process alive when another one makes the file shorter: reading or writing beyond a file's end is a SIGBUS. The
/// bytes of the mapping then become memory of the process's own, all zero, and the program goes on and is told.
///
/// Installs a handler for SIGBUS with the first one; what is not about a mapping goes to whoever handled it before.
class Mapping {
public:
    Mapping() = default;
    /// `protection` and `flags` as mmap() has them. Is empty, with errno, when the file cannot be mapped. Throws
    /// std::runtime_error when there are 64 mappings already.
    Mapping(int file, std::size_t bytes, int protection, std::uint64_t offset = 0, int flags = 0);
    Mapping(Mapping&& other) noexcept : slot_(std::exchange(other.slot_, -1)) {}
    Mapping& operator=(Mapping other) noexcept
    {
        std::swap(slot_, other.slot_);
        return *this;
    }
    ~Mapping();

    explicit operator bool() const noexcept { return slot_ >= 0; }
    /// Where it begins.
    std::byte* base() const noexcept;
    /// Whether the mapping's file has lost bytes that were needed. Wait-free.
    bool torn() const noexcept;

private:
    int slot_ = -1;
};

}  // namespace palpate::channel
