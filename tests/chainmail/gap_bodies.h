#pragma once

// Bodies with gaps that are narrower than the cells of the wider windows.
#include "elastic_bodies.h"

#include <chainmail/split_level.h>

#include <random>

namespace palpate::tests {

inline constexpr double cellSize = 2e-3, fatModulus = 5e3;

/// Two fingers, 16 x 16 mm and `length` cells long, side by side along x, `gap` cells between them, on a palm that is held;
/// or only the second of them on the same palm. Their free ends are at z = 0. Without a palm each ends in bone of its own.
inline chainmail::ElasticBody fingers(int gap, bool both, int length = 24, bool relaxes = false, int palm = 4)
{
    constexpr int width = 8;
    const Index3 cells(2 * width + gap, width, length + palm);
    const auto material = [=](Index3 c) {
        const bool isPalm = c.z >= length, isGap = c.x >= width && c.x < width + gap;
        const bool isAir =
            palm > 0 ? !isPalm && c.x < width + gap && (!both || c.x >= width) : isGap || (!both && c.x < width);
        auto of = isAir ? volume::CellMaterial{} : tissue(fatModulus, 0.45, c.z >= length + palm - 1);
        of.relaxing = {0.3F, 0.2F};
        return of;
    };
    return bodyOf({cells, cellSize, material, 4, Vec3(0.0)}, 0.4999, relaxes);
}

/// Foam of walls and holes of some cells, held at one end.
inline chainmail::ElasticBody foam(unsigned seed, double filled)
{
    constexpr Index3 cells(30, 26, 34), wide(3);
    const volume::NodeGrid noise{cells / wide + 2, Vec3(0.0), 1.0};
    std::minstd_rand random(seed);
    std::uniform_real_distribution<double> value(0.0, 1.0);
    std::vector<double> values(noise.count());
    for (double& one : values) {
        one = value(random);
    }
    const auto material = [=](Index3 c) {
        const auto share = chainmail::trilinear(Vec3(c % wide) / Vec3(wide));
        double sum = 0.0;
        for (int i = 0; i < 8; ++i) {
            const std::size_t at = noise.offset(c / wide + Index3(i & 1, i >> 1 & 1, i >> 2));
            sum += static_cast<double>(share[static_cast<std::size_t>(i)]) * values[at];
        }
        const bool isHeld = c.z == cells.z - 1;
        return isHeld || sum < filled ? tissue(fatModulus, 0.45, isHeld) : volume::CellMaterial{};
    };
    return bodyOf({cells, cellSize, material, 2, Vec3(0.0)});
}

/// Bristles of one cell on a plate.
inline chainmail::ElasticBody brush()
{
    const auto material = [](Index3 c) {
        const bool is = c.z >= 16 || (c.x % 2 == 0 && c.y % 2 == 0);
        return is ? tissue(fatModulus, 0.45, c.z == 19) : volume::CellMaterial{};
    };
    return bodyOf({{41, 41, 20}, cellSize, material, 2, Vec3(0.0)});
}

/// Random at every degree of freedom, virtual nodes included; copies and borders follow.
inline void randomiseAll(chainmail::WindowStack& stack, chainmail::Field field, std::minstd_rand& random)
{
    std::uniform_real_distribution<float> value(-1.0F, 1.0F);
    for (chainmail::Window& w : stack.windows()) {
        for (std::size_t i = 0; i < 3 * w.layout.count; ++i) {
            w.field(field)[i] = w.dof[i % w.layout.count] * value(random);
        }
        w.share(field);
    }
    stack.joinBorders(field);
}

}  // namespace palpate::tests
