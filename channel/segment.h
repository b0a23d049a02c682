#pragma once

#include <base/descriptor.h>
#include <base/process.h>
#include <base/sequence_lock.h>
#include <channel/layout.h>

#include <sys/stat.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// The bytes of the segment, for its ends, publisher.cpp, subscriber.cpp and hand.cpp, and for their tests. Not part of the
/// interface.
namespace palpate::channel {

/// Shared words are atomics so that a torn copy is a value to be thrown away and never a data race.
using Word = std::atomic<std::uint64_t>;
static_assert(Word::is_always_lock_free && sizeof(Word) == sizeof(std::uint64_t));

inline constexpr std::size_t stateWords = sizeof(State) / sizeof(std::uint64_t);
inline constexpr std::size_t inputWords = sizeof(Input) / sizeof(std::uint64_t);
inline constexpr std::size_t displacementWords = sizeof(Displacement) / sizeof(std::uint64_t);
inline constexpr std::size_t displacedSlots = 4;
static_assert(sizeof(State) % sizeof(std::uint64_t) == 0 && sizeof(Input) % sizeof(std::uint64_t) == 0 &&
              sizeof(Displacement) % sizeof(std::uint64_t) == 0);

/// `magic` is written last: who reads it (acquire) sees all that is written once.
struct Header {
    Word magic;
    std::uint64_t version = 0;
    std::uint64_t layoutHash = 0;
    std::uint64_t bytes = 0;  // of the segment
    std::uint64_t ownerPid = 0;
    std::uint64_t ownerStart = 0;  // start time of the owner [clock ticks since boot]: a recycled pid has another
    std::uint64_t sceneryOffset = 0, labelsOffset = 0, labelsBytes = 0, imageOffset = 0, imageBytes = 0, fineOffset = 0,
                  fineBytes = 0, stateOffset = 0, inputOffset = 0, displacedOffset = 0;
    Word closed;  // 1: the owner has ended the session itself
};

/// Under a sequence lock, see base/sequence_lock.h.
struct StateBlock {
    alignas(64) Word sequence;
    alignas(64) std::array<Word, stateWords> words;
};

/// The only part that a viewer writes: whoever holds it maps this page for writing, and the rest for reading only.
struct InputBlock {
    alignas(64) Word holder;    // handOf() the viewer; 0: nobody
    alignas(64) Word sequence;  // as StateBlock's
    alignas(64) std::array<Word, inputWords> words;
};

struct DisplacedSlot {
    alignas(64) Word sequence;  // as StateBlock's
    Word tick, publication, count;
    std::array<Word, maxDisplaced * displacementWords> words;
};

/// Publication n (from 1) lies in slot n % displacedSlots. The writer fills the slot after the latest one and so never
/// waits; a reader that is lapped notices by the slot's sequence and starts again at the latest.
struct DisplacedBlock {
    alignas(64) Word latest;
    std::array<DisplacedSlot, displacedSlots> slot;
};

/// What a reader compiled elsewhere must agree on: the source of this layout (CMakeLists.txt) and its sizes.
std::uint64_t layoutHash() noexcept;

/// "/palpate-SESSION". Throws std::runtime_error for a name that is not made of letters, digits, '-' and '_'.
std::string segmentName(const std::string& session);

/// Opens the segment `name` where it is a regular file of this user's own, and never waits: others may put a pipe, or a
/// file that they hold locked, under any name. Nothing is open otherwise, with errno (EPERM: it is not ours).
/// `access` is O_RDONLY or O_RDWR.
base::Descriptor openSegment(const std::string& name, int access) noexcept;

/// What the system says of an open file; all zero where it says nothing.
struct stat statusOf(const base::Descriptor& file) noexcept;

/// How the segments of all sessions begin in that folder.
inline constexpr std::string_view segmentPrefix = "palpate-";
/// The files there that begin so.
std::vector<std::string> segmentFiles();

/// Where the system keeps the segments (Linux).
inline constexpr const char* segmentFolder = "/dev/shm";

using base::processStart;
using base::readLocked;
using base::writeLocked;

/// Process `pid` as one word that no other process has, dead or alive (pids have 22 bits at most).
inline std::uint64_t handOf(std::uint64_t pid) noexcept
{
    return pid << 42U | (processStart(pid) & ((1ULL << 42U) - 1));
}

inline bool holderLives(std::uint64_t hand) noexcept
{
    return hand != 0 && handOf(hand >> 42U) == hand;
}

/// Of a header, or of what was read of it.
bool ownerLives(const auto& header) noexcept
{
    return header.ownerStart != 0 && processStart(header.ownerPid) == header.ownerStart;
}

}  // namespace palpate::channel
