#pragma once

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
    using Words = std::array<std::uint64_t, sizeof(T) / sizeof(std::uint64_t)>;

public:
    Newest() { write(T{}); }

    void write(const T& value) noexcept
    {
        const auto words = std::bit_cast<Words>(value);
        const std::uint32_t n = sequence_.load(std::memory_order_relaxed);
        sequence_.store(n + 1, std::memory_order_relaxed);
        std::atomic_thread_fence(std::memory_order_release);
        for (std::size_t i = 0; i < words.size(); ++i) {
            words_[i].store(words[i], std::memory_order_relaxed);
        }
        sequence_.store(n + 2, std::memory_order_release);
    }

    /// Puts the newest into `value`; leaves it where that cannot be had at once.
    void read(T& value) const noexcept
    {
        for (int attempt = 0; attempt < 8; ++attempt) {
            const std::uint32_t before = sequence_.load(std::memory_order_acquire);
            Words words{};
            for (std::size_t i = 0; i < words.size(); ++i) {
                words[i] = words_[i].load(std::memory_order_relaxed);
            }
            std::atomic_thread_fence(std::memory_order_acquire);
            if (before % 2 == 0 && sequence_.load(std::memory_order_relaxed) == before) {
                value = std::bit_cast<T>(words);
                return;
            }
        }
    }

private:
    std::atomic<std::uint32_t> sequence_{0};
    std::array<std::atomic<std::uint64_t>, sizeof(T) / sizeof(std::uint64_t)> words_{};
};

}  // namespace palpate::falcon
