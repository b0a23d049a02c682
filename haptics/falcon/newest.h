#pragma once

#include <base/sequence_lock.h>

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace palpate::falcon {

/// The newest value that one thread has told another: a sequence lock. Neither waits for the other: the writer never, and a
/// reader that meets a writer at work a few times over keeps what it had.
template <typename T>
class Newest {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(std::uint64_t) == 0);
    static constexpr std::size_t wordCount = sizeof(T) / sizeof(std::uint64_t);
    using Words = std::array<std::uint64_t, wordCount>;

public:
    Newest() { write(T{}); }

    void write(const T& value) noexcept { base::writeLocked(block_, std::bit_cast<Words>(value)); }

    /// Puts the newest into `value`; leaves it where that cannot be had at once.
    void read(T& value) const noexcept
    {
        constexpr int tries = 8;
        if (const auto words = base::readLocked<wordCount>(block_, tries)) {
            value = std::bit_cast<T>(*words);
        }
    }

private:
    struct {
        std::atomic<std::uint64_t> sequence{0};
        std::array<std::atomic<std::uint64_t>, wordCount> words{};
    } block_;
};

}  // namespace palpate::falcon
