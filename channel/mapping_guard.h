#pragma once

#include <cstddef>

namespace palpate::channel {

/// Keeps a process alive whose mapped file is made shorter by another one: reading or writing beyond a file's end is a
/// SIGBUS. The bytes of the mapping then become memory of the process's own, all zero, and the program goes on and is told.
///
/// Installs a handler for SIGBUS with the first one; what is not about a guarded mapping goes to whoever handled it before.
class MappingGuard {
public:
    MappingGuard() = default;
    /// Throws std::runtime_error when 64 mappings are guarded already.
    MappingGuard(void* base, std::size_t bytes);
    MappingGuard(MappingGuard&& other) noexcept;
    MappingGuard& operator=(MappingGuard&& other) noexcept;
    /// Before the mapping goes.
    ~MappingGuard();

    /// Whether the mapping's file has lost bytes that were needed. Wait-free.
    bool torn() const noexcept;

private:
    void release() noexcept;
    int slot_ = -1;
};

}  // namespace palpate::channel
