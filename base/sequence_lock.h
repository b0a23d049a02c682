#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>

/// A sequence lock over `block.sequence` and `block.words`, both of lock-free atomics: the sequence is odd while the writer
/// is inside. One writer, any number of readers, in one process or several; neither waits for the other.
namespace palpate::base {

/// A write, and the writer's half of a sequence lock without fences (H.-J. Boehm, "Can seqlocks get along with programming
/// language memory models?", MSPC 2012): a reader that sees a word of this write (acquire) also sees the odd sequence
/// before it, and throws its copy away. Goes on after a writer that died inside.
template <class Block, std::size_t count>
void writeLocked(Block& block, const std::array<std::uint64_t, count>& words) noexcept
{
    const auto inside = block.sequence.load(std::memory_order_relaxed) | 1U;
    block.sequence.store(inside, std::memory_order_relaxed);
    for (std::size_t i = 0; i < count; ++i) {
        block.words[i].store(words[i], std::memory_order_release);
    }
    block.sequence.store(inside + 1, std::memory_order_release);
}

/// The reader's half: the words come before the second look at the sequence because their loads are acquires. Nothing when
/// there has been no write, or none of `tries` copies was whole.
template <std::size_t count, class Block>
std::optional<std::array<std::uint64_t, count>> readLocked(const Block& block, int tries) noexcept
{
    std::array<std::uint64_t, count> words{};
    for (int attempt = 0; attempt < tries; ++attempt) {
        const auto before = block.sequence.load(std::memory_order_acquire);
        if (before == 0) {
            return std::nullopt;
        }
        if (before % 2 != 0) {
            continue;
        }
        for (std::size_t i = 0; i < count; ++i) {
            words[i] = block.words[i].load(std::memory_order_acquire);
        }
        if (block.sequence.load(std::memory_order_relaxed) == before) {
            return words;
        }
    }
    return std::nullopt;
}

}  // namespace palpate::base
