#pragma once

#include <chainmail/lattice.h>

#include <cstdint>
#include <vector>

namespace palpate::chainmail {

/// A link that is too long, too short or sheared too far, and the end that pulls at the other.
struct Pull {
    Node from = 0;
    int side = 0;  // of the node that is pulled, seen from `from`
};

/// Pulls in the order of largest violation, ties first in, first out. Violations are sorted into levels of 1/256 of a
/// spacing, which makes every operation O(1); within a level they count as ties.
///
///     level -> first .. last, a list through the slots;  a bit per level that is not empty, a bit per 64 such bits
///
/// Fixed capacity: nothing is allocated after construction.
class ViolationQueue {
public:
    /// @param spacing   of the lattice [m]    @param capacity  pulls that may wait at a time
    ViolationQueue(double spacing, std::size_t capacity);

    bool empty() const noexcept { return summary_ == 0; }
    /// Puts in a pull of a link that is `violation` [m] out of its limits.
    void push(Pull pull, float violation) noexcept;
    /// Takes out the pull with the largest violation. Not when empty.
    Pull pop() noexcept;
    /// True when a pull of a larger violation waits.
    bool holdsLarger(float violation) const noexcept { return !empty() && top() > level(violation); }
    void clear() noexcept;

private:
    static constexpr std::uint32_t none = 0xFFFFFFFF;
    static constexpr std::uint32_t levels = 4096;  // up to 16 spacings; larger violations share the last
    static constexpr float levelsPerSpacing = 256.0F;

    struct Slot {
        Pull pull;
        std::uint32_t next = none;
    };

    std::uint32_t level(float violation) const noexcept;
    std::uint32_t top() const noexcept;

    float levelsPerMetre_;
    std::vector<Slot> slots_;
    std::uint32_t free_ = 0;             // head of the list of free slots
    std::vector<std::uint32_t> first_;   // slot at the head of each level
    std::vector<std::uint32_t> last_;    // and at its end
    std::vector<std::uint64_t> filled_;  // bit per level
    std::uint64_t summary_ = 0;          // bit per word of filled_
};

}  // namespace palpate::chainmail
