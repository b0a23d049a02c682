#include <chainmail/cut_cells.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::chainmail {

void CutSum::add(double share, Vec3 middle, Vec3 second) noexcept
{
    share_ += share;
    first_ += share * middle;
    second_ += share * (second + middle * middle);
}

void CutSum::add(const Cut& cell, Index3 child) noexcept
{
    add(0.125 * static_cast<double>(cell.share), 0.5 * (2.0 * Vec3(child) - 1.0 + Vec3(cell.middle)),
        Vec3(cell.spread) / 12.0);
}

Cut CutSum::cut() const noexcept
{
    constexpr double thinnest = 0.02;  // spread: a plate of a seventh of the cell
    const auto share = static_cast<float>(share_);
    if (!(share > 0.0F && share < wholeCell)) {
        return {};
    }
    const Vec3 middle = first_ / share_;
    const Vec3 spread = 3.0 * (second_ / share_ - middle * middle);
    return {Vec3f(middle), Vec3f(glm::clamp(spread, Vec3(thinnest), Vec3(1.0))), share};
}

// Of a sample that the surface cuts, what is filled lies on its inner side, and is as thin as it is full.
Cut cutBy(const volume::DistanceField& surface, Vec3 middle, double edge, const volume::CellMaterial& material)
{
    constexpr int side = 4;
    constexpr double least = 0.02;  // share that the surface must know of
    constexpr double second = 1.0 / (3.0 * side * side);
    const double part = edge / side;
    CutSum samples, eighths;
    double known = 0.0;
    volume::forEachIndex(Index3(0), Index3(side - 1), [&](Index3 n) {
        const Vec3 at = (Vec3(n) + 0.5) / static_cast<double>(side) - 0.5;
        const Vec3 place = middle + edge * at;
        const double full = std::clamp(0.5 - surface.at(place) / part, 0.0, 1.0);
        const Vec3 out = full > 0.0 && full < 1.0 ? surface.normal(place) : Vec3(0.0);
        const Vec3 inside = 2.0 * at - (1.0 - full) / side * out;
        samples.add(full / (side * side * side), inside, second * (1.0 - (1.0 - full * full) * out * out));
        known += full / (side * side * side);
    });
    for (int i = 0; i < 8; ++i) {
        if ((material.octants >> i & 1) != 0) {
            eighths.add(Cut{}, octant(i));
        }
    }
    Cut cut = known >= least || material.octants == 0 ? samples.cut() : eighths.cut();
    cut.share = material.fraction;
    return cut;
}

Cut withoutSliver(const Cut& cut) noexcept
{
    constexpr float least = 0.55F;
    return {glm::clamp(cut.middle, Vec3f(least - 1.0F), Vec3f(1.0F - least)), glm::max(cut.spread, Vec3f(least * least)),
            cut.share};
}

}  // namespace palpate::chainmail
