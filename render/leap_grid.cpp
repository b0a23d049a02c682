#include <render/leap_grid.h>

#include <glm/common.hpp>

#include <algorithm>
#include <cstddef>

namespace palpate::render {
namespace {

std::size_t offset(glm::ivec3 size, glm::ivec3 n) noexcept
{
    return (static_cast<std::size_t>(n.z) * static_cast<std::size_t>(size.y) + static_cast<std::size_t>(n.y)) *
               static_cast<std::size_t>(size.x) +
           static_cast<std::size_t>(n.x);
}

// Whether the block's voxels and those around it all have the label of its first one.
bool uniform(glm::ivec3 voxels, std::span<const std::uint8_t> labels, glm::ivec3 first) noexcept
{
    constexpr std::uint8_t compared = channel::rowBits | channel::shellBit;
    const glm::ivec3 low = glm::max(first - 1, glm::ivec3(0)), high = glm::min(first + LeapGrid::side, voxels - 1);
    const std::uint8_t label = labels[offset(voxels, first)];
    for (int z = low.z; z <= high.z; ++z)
        for (int y = low.y; y <= high.y; ++y)
            for (int x = low.x; x <= high.x; ++x)
                if (((labels[offset(voxels, {x, y, z})] ^ label) & compared) != 0)
                    return false;
    return true;
}

// Lowers block `n` to one more than each of its 13 neighbours before it (`way` -1) or behind it (1).
void relax(LeapGrid& grid, glm::ivec3 n, int way) noexcept
{
    std::uint8_t& block = grid.blocks[offset(grid.size, n)];
    for (int k = 0; k < 13 && block > 0; ++k) {
        const glm::ivec3 at = n + way * (glm::ivec3(k % 3, k / 3 % 3, k / 9) - 1);
        if (at.x < 0 || at.y < 0 || at.z < 0 || at.x >= grid.size.x || at.y >= grid.size.y || at.z >= grid.size.z)
            continue;
        block = std::min(block, static_cast<std::uint8_t>(grid.blocks[offset(grid.size, at)] + 1));
    }
}

}  // namespace

LeapGrid leapGrid(const channel::Grid& grid, std::span<const std::uint8_t> labels)
{
    const glm::ivec3 voxels(grid.size[0], grid.size[1], grid.size[2]);
    LeapGrid leaps{(voxels + LeapGrid::side - 1) / LeapGrid::side, {}};
    const auto each = [&](auto&& visit) {
        for (int z = 0; z < leaps.size.z; ++z)
            for (int y = 0; y < leaps.size.y; ++y)
                for (int x = 0; x < leaps.size.x; ++x)
                    visit(glm::ivec3(x, y, z));
    };
    leaps.blocks.resize(offset(leaps.size, {0, 0, leaps.size.z}));
    each([&](glm::ivec3 n) {
        leaps.blocks[offset(leaps.size, n)] = uniform(voxels, labels, LeapGrid::side * n) ? LeapGrid::most : 0;
    });
    each([&](glm::ivec3 n) { relax(leaps, n, 1); });
    each([&](glm::ivec3 n) { relax(leaps, leaps.size - 1 - n, -1); });
    each([&](glm::ivec3 n) {
        std::uint8_t& block = leaps.blocks[offset(leaps.size, n)];
        const bool air = (labels[offset(voxels, LeapGrid::side * n)] & channel::rowBits) == 0;
        if (air && block > 0)
            block |= LeapGrid::airBit;
    });
    return leaps;
}

}  // namespace palpate::render
