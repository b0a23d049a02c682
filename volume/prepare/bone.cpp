#include <volume/prepare/bone.h>

#include <volume/label_image.h>

#include <tbb/parallel_for.h>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace palpate::prepare {

namespace {

using volume::LabelImage;
using volume::VoxelGrid;

// CT numbers [HU]; where they come from is in docs/researcher.md, "A body around the organs".
constexpr float fineThreshold = 150, coarseThreshold = 125;  // for voxels of fineVoxel, of coarseVoxel [m]
constexpr double fineVoxel = 1e-3, coarseVoxel = 3e-3;
constexpr float surelyBone = 200;  // a piece without it is an organ with contrast medium, or noise
constexpr float marrowLike = 80;   // what is darker speaks no more against bone: marrow may be fat

constexpr double rayReach = 40e-3;             // half the width of a pelvis' bones and more
constexpr std::uint8_t minAsked = 17;          // rays: those of a voxel in the grid's last layer, half of a bone behind it
constexpr float enclosedFrom = 0.85F;          // fraction of rays; a spinal canal and a disc have less
constexpr float perShare = 0.05F, perHu = 30;  // a share and HU that count alike
constexpr float perNeighbour = 0.4F;
constexpr int sweeps = 3;

// What a ray meets first, as its distance [m]: positive for the mask, negative for the grid's border.
class RaySweep {
public:
    RaySweep(const VoxelGrid& grid, const Mask& mask, Index3 step)
        : size_(grid.size),
          places_{grid.size, grid.affine, {}},
          mask_(mask),
          step_(step),
          length_(static_cast<float>(glm::length(grid.affine.spacing() * Vec3(step))))
    {
    }

    /// Visits every voxel with what its ray meets, in parallel; voxels of one row come from one thread.
    template <typename Visit>
    void run(const Visit& visit) const
    {
        const auto plane = static_cast<std::size_t>(size_.x) * static_cast<std::size_t>(size_.y);
        if (step_.z == 0) {
            tbb::parallel_for(0, size_.z, [&](int z) {
                std::vector<float> now(plane);
                for (int y = 0; y < size_.y; ++y) {
                    row(step_.y > 0 ? size_.y - 1 - y : y, z, now, now, visit);
                }
            });
            return;
        }
        std::vector<float> before(plane), now(plane);
        for (int k = 0; k < size_.z; ++k) {
            const int z = step_.z > 0 ? size_.z - 1 - k : k;
            tbb::parallel_for(0, size_.y, [&](int y) { row(y, z, before, now, visit); });
            before.swap(now);
        }
    }

private:
    template <typename Visit>
    void row(int y, int z, const std::vector<float>& before, std::vector<float>& now, const Visit& visit) const
    {
        const auto in = [&](int yy, int x) {
            return static_cast<std::size_t>(yy) * static_cast<std::size_t>(size_.x) + static_cast<std::size_t>(x);
        };
        for (int k = 0; k < size_.x; ++k) {
            const int x = step_.x > 0 ? size_.x - 1 - k : k;
            const Index3 next = Index3(x, y, z) + step_;
            float met = -length_;
            if (glm::all(glm::greaterThanEqual(next, Index3(0))) && glm::all(glm::lessThan(next, size_))) {
                const float further = before[in(next.y, next.x)];
                met = mask_[places_.offset(next)] != 0 ? length_ : further + std::copysign(length_, further);
            }
            now[in(y, x)] = met;
            visit(places_.offset({x, y, z}), met);
        }
    }

    Index3 size_;
    LabelImage places_;
    const Mask& mask_;
    Index3 step_;
    float length_;
};

// The pieces of the voxels from `threshold` on that have one that is surely bone.
Mask brightPieces(const VoxelGrid& grid, const std::vector<float>& hu, const Mask& may, float threshold)
{
    Mask bright(hu.size());
    for (std::size_t i = 0; i < bright.size(); ++i) {
        bright[i] = may[i] != 0 && hu[i] >= threshold ? 1 : 0;
    }
    const MaskPieces pieces = piecesOf(grid, bright, {});
    std::vector<std::uint8_t> sure(pieces.pieces.size() + 1, 0);
    for (std::size_t i = 0; i < bright.size(); ++i) {
        sure[pieces.of[i]] = sure[pieces.of[i]] != 0 || hu[i] >= surelyBone ? 1 : 0;
    }
    sure[0] = 0;
    for (std::size_t i = 0; i < bright.size(); ++i) {
        bright[i] = sure[pieces.of[i]];
    }
    return bright;
}

// How many of a voxel's six neighbours are in the mask; beyond the grid there is more of the same.
int neighboursIn(const LabelImage& places, const Mask& mask, Index3 n)
{
    int count = 0;
    for (int side = 0; side < 6; ++side) {
        Index3 next = n;
        next[side / 2] = std::clamp(next[side / 2] + (side % 2 == 0 ? 1 : -1), 0, places.size[side / 2] - 1);
        count += mask[places.offset(next)] != 0 ? 1 : 0;
    }
    return count;
}

// Iterated conditional modes of a Markov random field: J. Besag, "On the Statistical Analysis of Dirty Pictures", Journal
// of the Royal Statistical Society B 48(3), 1986. `evidence` is over 0 for what looks like bone, -infinity for what cannot
// be.
Mask withNeighbours(const VoxelGrid& grid, const std::vector<float>& evidence, const Mask& known)
{
    const LabelImage places{grid.size, grid.affine, {}};
    Mask bone(evidence.size());
    for (std::size_t i = 0; i < bone.size(); ++i) {
        bone[i] = evidence[i] > 0 || known[i] != 0 ? 1 : 0;
    }
    for (int sweep = 0; sweep < sweeps; ++sweep) {
        Mask next = bone;
        tbb::parallel_for(0, grid.size.z, [&](int z) {
            volume::forEachIndex(Index3(0, 0, z), Index3(grid.size.x - 1, grid.size.y - 1, z), [&](Index3 n) {
                const std::size_t i = places.offset(n);
                if (known[i] == 0 && std::isfinite(evidence[i])) {
                    const auto more = static_cast<float>(neighboursIn(places, bone, n) - 3);
                    next[i] = evidence[i] + perNeighbour * more > 0 ? 1 : 0;
                }
            });
        });
        bone.swap(next);
    }
    return bone;
}

}  // namespace

float boneThreshold(const VoxelGrid& grid)
{
    const double edge = std::cbrt(grid.affine.voxelVolume());
    const double coarse = std::clamp((edge - fineVoxel) / (coarseVoxel - fineVoxel), 0.0, 1.0);
    return fineThreshold + (coarseThreshold - fineThreshold) * static_cast<float>(coarse);
}

std::vector<float> enclosure(const VoxelGrid& grid, const Mask& mask, double reach)
{
    std::vector<std::uint8_t> met(mask.size(), 0), asked(mask.size(), 0);
    const auto most = static_cast<float>(reach * (1 + 1e-5));
    volume::forEachIndex(Index3(-1), Index3(1), [&](Index3 step) {
        if (step != Index3(0)) {
            RaySweep(grid, mask, step).run([&](std::size_t at, float distance) {
                met[at] = static_cast<std::uint8_t>(met[at] + (distance > 0 && distance <= most ? 1 : 0));
                asked[at] = static_cast<std::uint8_t>(asked[at] + (distance > 0 || -distance > most ? 1 : 0));
            });
        }
    });
    std::vector<float> fraction(mask.size());
    for (std::size_t i = 0; i < fraction.size(); ++i) {
        fraction[i] = static_cast<float>(met[i]) / static_cast<float>(std::max(asked[i], minAsked));
    }
    return fraction;
}

Mask findBone(const VoxelGrid& grid, const std::vector<float>& hu, const Mask& may, const Mask& known)
{
    const float threshold = boneThreshold(grid);
    Mask walls = brightPieces(grid, hu, may, threshold);
    const Mask near = touching(grid, walls);
    for (std::size_t i = 0; i < walls.size(); ++i) {
        walls[i] = walls[i] != 0 || known[i] != 0 ? 1 : 0;
    }
    std::vector<float> evidence = enclosure(grid, walls, rayReach);
    for (std::size_t i = 0; i < evidence.size(); ++i) {
        const float beyond = std::max(0.0F, evidence[i] - enclosedFrom);
        const bool can = may[i] != 0 && (near[i] != 0 || beyond > 0);
        evidence[i] = can ? (std::max(hu[i], marrowLike) - threshold) / perHu + beyond / perShare : -HUGE_VALF;
    }
    Mask bone = withNeighbours(grid, evidence, known);
    for (std::size_t i = 0; i < bone.size(); ++i) {
        bone[i] = bone[i] != 0 && may[i] != 0 ? 1 : 0;
    }
    return bone;
}

}  // namespace palpate::prepare
