#include <volume/geometry.h>

#include <base/error.h>

#include <glm/matrix.hpp>

#include <cmath>

namespace palpate::volume {

Vec3 Affine::toIndex(Vec3 patient) const noexcept
{
    return glm::inverse(linear) * (patient - origin);
}

Vec3 Affine::spacing() const noexcept
{
    return {glm::length(linear[0]), glm::length(linear[1]), glm::length(linear[2])};
}

double Affine::voxelVolume() const noexcept
{
    return std::abs(glm::determinant(linear));
}

NodeGrid coveringGrid(const Box& box, double spacing, double margin)
{
    const Vec3 low = glm::floor((box.low - margin) / spacing - 0.5) + 0.5;
    const Vec3 high = glm::ceil((box.high + margin) / spacing - 0.5) + 0.5;
    return {Index3(high - low + 0.5) + 1, spacing * low, spacing};
}

double affordableSpacing(const Box& box, double wanted, double margin, std::size_t maxNodes)
{
    constexpr std::size_t fewest = 8;  // two along each axis, however far apart
    base::failIf(!(wanted > 0.0) || !std::isfinite(wanted), "a spacing of {} m: must be a positive number", wanted);
    base::failIf(maxNodes < fewest, "a grid of at most {} nodes: it has at least {}", maxNodes, fewest);
    double spacing = wanted;
    while (coveringGrid(box, spacing, margin).count() > maxNodes) {
        spacing *= 1.02;
    }
    return spacing;
}

NodeGrid affordableGrid(const Box& box, double wanted, std::size_t maxNodes)
{
    constexpr std::size_t fewest = 216;  // six along each axis, with two spacings on both sides
    base::failIf(maxNodes < fewest, "a grid of at most {} nodes: it has at least {}", maxNodes, fewest);
    double spacing = affordableSpacing(box, wanted, 2.0 * wanted, maxNodes);
    NodeGrid grid = coveringGrid(box, spacing, 2.0 * spacing);
    while (grid.count() > maxNodes) {
        spacing *= 1.02;
        grid = coveringGrid(box, spacing, 2.0 * spacing);
    }
    return grid;
}

}  // namespace palpate::volume
