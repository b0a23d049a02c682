#include <render/leap_grid.h>

#include <base/cells.h>
#include <channel/deformation.h>

#include <glm/common.hpp>

#include <algorithm>

namespace palpate::render {
namespace {

// Whether the block's voxels and those around it all have the label of its first one.
bool uniform(glm::ivec3 voxels, std::span<const std::uint8_t> labels, glm::ivec3 first) noexcept
{
    constexpr std::uint8_t compared = channel::rowBits | channel::shellBit;
    const glm::ivec3 low = glm::max(first - 1, glm::ivec3(0)), high = glm::min(first + LeapGrid::side, voxels - 1);
    const std::uint8_t label = labels[base::offsetOf(voxels, first)];
    for (int z = low.z; z <= high.z; ++z)
        for (int y = low.y; y <= high.y; ++y)
            for (int x = low.x; x <= high.x; ++x)
                if (((labels[base::offsetOf(voxels, {x, y, z})] ^ label) & compared) != 0)
                    return false;
    return true;
}

// Lowers block `n` to one more than each of its 13 neighbours before it (`way` -1) or behind it (1).
void relax(LeapGrid& grid, glm::ivec3 n, int way) noexcept
{
    std::uint8_t& block = grid.blocks[base::offsetOf(grid.size, n)];
    for (int k = 0; k < 13 && block > 0; ++k) {
        const glm::ivec3 at = n + way * (glm::ivec3(k % 3, k / 3 % 3, k / 9) - 1);
        if (!base::holds(grid.size, at))
            continue;
        block = std::min(block, static_cast<std::uint8_t>(grid.blocks[base::offsetOf(grid.size, at)] + 1));
    }
}

}  // namespace

LeapGrid leapGrid(const channel::Grid& grid, std::span<const std::uint8_t> labels)
{
    const glm::ivec3 voxels = channel::sizeOf(grid);
    LeapGrid leaps{(voxels + LeapGrid::side - 1) / LeapGrid::side, {}};
    const auto each = [&](auto&& visit) {
        for (int z = 0; z < leaps.size.z; ++z)
            for (int y = 0; y < leaps.size.y; ++y)
                for (int x = 0; x < leaps.size.x; ++x)
                    visit(glm::ivec3(x, y, z));
    };
    leaps.blocks.resize(base::countOf(leaps.size));
    each([&](glm::ivec3 n) {
        leaps.blocks[base::offsetOf(leaps.size, n)] = uniform(voxels, labels, LeapGrid::side * n) ? LeapGrid::most : 0;
    });
    each([&](glm::ivec3 n) { relax(leaps, n, 1); });
    each([&](glm::ivec3 n) { relax(leaps, leaps.size - 1 - n, -1); });
    each([&](glm::ivec3 n) {
        std::uint8_t& block = leaps.blocks[base::offsetOf(leaps.size, n)];
        const bool air = (labels[base::offsetOf(voxels, LeapGrid::side * n)] & channel::rowBits) == 0;
        if (air && block > 0)
            block |= LeapGrid::airBit;
    });
    return leaps;
}

}  // namespace palpate::render
