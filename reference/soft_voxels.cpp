#include <reference/soft_voxels.h>

#include <base/error.h>

#include <glm/common.hpp>
#include <glm/gtc/matrix_access.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace palpate::reference {

namespace {

constexpr double sheer = 0.8;       // a side is flat when its last layer has this fraction of the layer two before
constexpr double onItsBack = 0.05;  // fraction of the depth that is held when nothing else is: Tissue::support()

// The voxels that the body's box touches.
std::pair<Index3, Index3> voxelRange(const volume::Tissue& tissue)
{
    const auto box = tissue.box();
    Vec3 low(1e30), high(-1e30);
    for (int c = 0; c < 8; ++c) {
        const Vec3 corner((c & 1) != 0 ? box.high.x : box.low.x, (c & 2) != 0 ? box.high.y : box.low.y,
                          (c & 4) != 0 ? box.high.z : box.low.z);
        const Vec3 index = tissue.affine().toIndex(corner);
        low = glm::min(low, index);
        high = glm::max(high, index);
    }
    return {glm::clamp(Index3(glm::floor(low)), Index3(0), tissue.size() - 1),
            glm::clamp(Index3(glm::ceil(high)), Index3(0), tissue.size() - 1)};
}

// The part of `all` between two of its voxels.
SoftVoxels cropped(const SoftVoxels& all, Index3 first, Index3 last)
{
    SoftVoxels part;
    part.held = all.held;
    part.low = all.low + first;
    part.size = last - first + 1;
    part.row.reserve(part.offset({0, 0, part.size.z}));
    volume::forEachIndex(first, last, [&](Index3 n) { part.row.push_back(all.row[all.offset(n)]); });
    return part;
}

std::size_t softInLayer(const SoftVoxels& voxels, int axis, int layer)
{
    Index3 first(0), last = voxels.size - 1;
    first[axis] = last[axis] = layer;
    std::size_t count = 0;
    volume::forEachIndex(first, last, [&](Index3 n) { count += voxels.row[voxels.offset(n)] != 0 ? 1U : 0U; });
    return count;
}

}  // namespace

bool isHeld(const volume::TissueRow& row) noexcept
{
    return row.fixed || row.role == volume::Role::bone;
}

SoftVoxels readVoxels(const volume::Tissue& tissue, Keep keep)
{
    const auto [first, last] = voxelRange(tissue);
    SoftVoxels all;
    all.low = first;
    all.size = last - first + 1;
    all.row.assign(all.offset({0, 0, all.size.z}), 0);
    const auto& rows = tissue.table().rows;
    const volume::Tissue::Reader reader(tissue);
    Index3 low = all.size, high(-1);
    volume::forEachIndex(Index3(0), all.size - 1, [&](Index3 n) {
        const std::uint8_t row = reader.tissue(tissue.affine().toPatient(Vec3(n + all.low)));
        if (keep == Keep::soft && isHeld(rows[row])) {
            all.held = true;
        } else if (rows[row].role != volume::Role::air) {
            all.row[all.offset(n)] = row;
            low = glm::min(low, n);
            high = glm::max(high, n);
        }
    });
    if (glm::any(glm::greaterThan(low, high))) {
        throw std::runtime_error(keep == Keep::all
                                     ? "volume: there is no tissue in it to mesh: all of it is air"
                                     : "volume: there is no soft tissue in it to mesh: all of it is air, bone or fixed");
    }
    return cropped(all, low, high);
}

int layOnItsBack(const volume::Affine& affine, SoftVoxels& voxels)
{
    const int axis = volume::longestAxis(glm::row(affine.linear, 1));
    base::failIf(
        voxels.size[axis] < 2,
        "volume: it is one voxel thick from front to back and nothing holds it: its rear layer, which would be held, "
        "is all there is; mark a tissue as fixed, or use smaller voxels");
    const bool backIsHigh = affine.linear[axis].y > 0.0;
    const int layers = std::max(1, static_cast<int>(std::lround(onItsBack * voxels.size[axis])));
    Index3 first(0), last = voxels.size - 1;
    (backIsHigh ? last : first)[axis] += backIsHigh ? -layers : layers;
    voxels = cropped(voxels, first, last);
    return 2 * axis + (backIsHigh ? 1 : 0);
}

std::array<bool, 6> flatSides(const SoftVoxels& voxels)
{
    std::array<bool, 6> flat{};
    for (int side = 0; side < 6; ++side) {
        const int axis = side / 2, end = voxels.size[axis] - 1;
        const int layer = side % 2 == 0 ? 0 : end;
        const int inner = side % 2 == 0 ? std::min(2, end) : std::max(end - 2, 0);
        flat[static_cast<std::size_t>(side)] = static_cast<double>(softInLayer(voxels, axis, layer)) >=
                                               sheer * static_cast<double>(softInLayer(voxels, axis, inner));
    }
    return flat;
}

}  // namespace palpate::reference
