#include <haptics/biopsy.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

struct Frame {
    Vec3 right, up;
};

Frame frameAcross(Vec3 axis) noexcept
{
    const Vec3 other = std::abs(axis.x) < 0.7 ? Vec3(1, 0, 0) : Vec3(0, 1, 0);
    const Vec3 right = glm::normalize(glm::cross(axis, other));
    return {right, glm::cross(axis, right)};
}

}  // namespace

CoreSample takeCore(const SessionModel& model, const volume::Tissue::Reader& reader, const occupancy::Body& body, Vec3 tip,
                    Vec3 axis) noexcept
{
    const auto& tool = model.scene.tool;
    const auto& target = model.structures[0].labels;
    CoreSample core;
    core.notchEnd = tip + tool.throwLength * axis;
    core.notchStart = core.notchEnd - tool.notchLength * axis;
    const auto [right, up] = frameAcross(axis);
    const auto inTarget = [&](Vec3 rest) {
        return std::find(target.begin(), target.end(), reader.label(rest)) != target.end();
    };

    constexpr int points = coreSlices * coreRings * coreSectors;
    int filled = 0;
    int hits = 0;
    int slicesInTarget = 0;
    for (int i = 0; i < coreSlices; ++i) {
        const Vec3 middle = core.notchStart + (i + 0.5) / coreSlices * tool.notchLength * axis;
        // The displacement varies over the lattice's spacing, far more slowly than over the notch's width.
        const Vec3 rest = occupancy::restPoint(body, middle);
        slicesInTarget += inTarget(rest) ? 1 : 0;
        for (int n = 0; n < coreRings * coreSectors; ++n) {
            const int r = n / coreSectors;
            const double radius = tool.notchRadius * std::sqrt((r + 0.5) / coreRings);  // rings of equal area
            const double turn = 2.0 * std::numbers::pi * (n % coreSectors + 0.5 * (r % 2)) / coreSectors;
            const Vec3 p = rest + radius * (std::cos(turn) * right + std::sin(turn) * up);
            const auto row = reader.tissue(p);
            if (row != 0) {
                ++filled;
                core.fraction[row] += 1.0;
                hits += inTarget(p) ? 1 : 0;
            }
        }
    }
    for (double& f : core.fraction) {
        f /= std::max(filled, 1);
    }
    const double notch = std::numbers::pi * tool.notchRadius * tool.notchRadius * tool.notchLength;
    core.volume = notch * filled / points;
    core.targetFraction = static_cast<double>(hits) / std::max(filled, 1);
    core.targetLength = tool.notchLength * slicesInTarget / coreSlices;
    return core;
}

}  // namespace palpate::haptics
