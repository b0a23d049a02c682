#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate::chainmail {

/// Marks of the cells in a box of 8 x 8 x 8, a bit for each.
class CellBits {
public:
    void set(Index3 at) noexcept { planes_[static_cast<std::size_t>(at.z)] |= bit(at); }
    bool has(Index3 at) const noexcept { return (planes_[static_cast<std::size_t>(at.z)] & bit(at)) != 0; }

    /// Marks what shares a corner with a marked cell, of the cells that `in` marks.
    /// @returns  whether there was any
    bool growIn(const CellBits& in) noexcept
    {
        constexpr std::uint64_t lowest = 0x0101010101010101;  // along x
        std::array<std::uint64_t, 10> wide{};                 // with the planes beside the box
        for (std::size_t z = 0; z < planes_.size(); ++z) {
            const std::uint64_t p = planes_[z], row = p | (p << 1 & ~lowest) | (p >> 1 & ~(lowest << 7));
            wide[z + 1] = row | row << 8 | row >> 8;
        }
        bool any = false;
        for (std::size_t z = 0; z < planes_.size(); ++z) {
            const std::uint64_t grown = planes_[z] | ((wide[z] | wide[z + 1] | wide[z + 2]) & in.planes_[z]);
            any = any || grown != planes_[z];
            planes_[z] = grown;
        }
        return any;
    }

private:
    static std::uint64_t bit(Index3 at) noexcept { return std::uint64_t{1} << (at.x + 8 * at.y); }

    std::array<std::uint64_t, 8> planes_{};  // by z
};

}  // namespace palpate::chainmail
