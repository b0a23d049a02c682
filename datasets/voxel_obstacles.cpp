#include <datasets/voxel_obstacles.h>

#include <volume/label_image.h>

#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>

namespace palpate::datasets {

namespace {

constexpr int side = 8;              // of a block [voxels]
constexpr double nearEnough = 1e-6;  // to which a distance is known [m]

double toSegment(Vec3 p, Vec3 from, Vec3 way) noexcept
{
    const double square = glm::dot(way, way);
    const double t = square > 0.0 ? glm::clamp(glm::dot(p - from, way) / square, 0.0, 1.0) : 0.0;
    return glm::distance(p, from + t * way);
}

double toBox(Vec3 p, Vec3 half) noexcept
{
    return glm::length(glm::max(glm::abs(p) - half, Vec3(0.0)));
}

// From a segment to the box around the origin: along the segment the distance is convex.
double toBox(Vec3 from, Vec3 way, Vec3 half) noexcept
{
    double low = 0.0, high = 1.0;
    const double length = glm::length(way);
    while ((high - low) * length > nearEnough) {
        const double a = low + (high - low) / 3.0, b = high - (high - low) / 3.0;
        if (toBox(from + a * way, half) <= toBox(from + b * way, half)) {
            high = b;
        } else {
            low = a;
        }
    }
    return toBox(from + 0.5 * (low + high) * way, half);
}

bool atSurface(const volume::LabelImage& labels, const std::vector<char>& obstacle, Index3 n)
{
    for (int k = 0; k < 6; ++k) {
        Index3 beside = n;
        beside[k / 2] += k % 2 == 0 ? 1 : -1;
        if (beside[k / 2] < 0 || beside[k / 2] >= labels.size[k / 2] ||
            obstacle[labels.values[labels.offset(beside)]] == 0) {
            return true;
        }
    }
    return false;
}

}  // namespace

VoxelObstacles::VoxelObstacles(const volume::Tissue& tissue, const std::vector<char>& obstacle) : affine_(tissue.affine())
{
    frame_[0] = glm::normalize(affine_.linear[0]);
    frame_[1] = glm::normalize(affine_.linear[1] - glm::dot(affine_.linear[1], frame_[0]) * frame_[0]);
    frame_[2] = glm::cross(frame_[0], frame_[1]);
    for (int k = 0; k < 3; ++k) {
        half_ += 0.5 * glm::abs(own(affine_.linear[k]));
    }
    const volume::LabelImage labels = tissue.labels();
    const auto layers = static_cast<std::size_t>((labels.size.z + side - 1) / side);
    std::vector<std::vector<Block>> blocks(layers);
    std::vector<std::vector<Vec3>> voxels(layers);
    tbb::parallel_for(std::size_t{0}, layers, [&](std::size_t layer) {
        addLayer(labels, obstacle, side * static_cast<int>(layer), blocks[layer], voxels[layer]);
    });
    for (std::size_t layer = 0; layer < layers; ++layer) {
        for (Block block : blocks[layer]) {
            block.first += voxels_.size();
            blocks_.push_back(block);
        }
        voxels_.insert(voxels_.end(), voxels[layer].begin(), voxels[layer].end());
    }
}

void VoxelObstacles::addLayer(const volume::LabelImage& labels, const std::vector<char>& obstacle, int z,
                              std::vector<Block>& blocks, std::vector<Vec3>& voxels) const
{
    const Index3 count = (labels.size + side - 1) / side;
    volume::forEachIndex(Index3(0), Index3(count.x - 1, count.y - 1, 0), [&](Index3 b) {
        const Index3 low = side * b + Index3(0, 0, z);
        Block block;
        block.first = voxels.size();
        Vec3 least(0.0), most(0.0);
        volume::forEachIndex(low, glm::min(low + side, labels.size) - 1, [&](Index3 n) {
            if (obstacle[labels.values[labels.offset(n)]] == 0 || !atSurface(labels, obstacle, n)) {
                return;
            }
            const Vec3 p = own(affine_.toPatient(Vec3(n)));
            least = voxels.size() == block.first ? p : glm::min(least, p);
            most = voxels.size() == block.first ? p : glm::max(most, p);
            voxels.push_back(p);
        });
        block.count = voxels.size() - block.first;
        if (block.count > 0) {
            block.centre = 0.5 * (least + most);
            block.radius = glm::length(0.5 * (most - least) + half_);
            blocks.push_back(block);
        }
    });
}

double VoxelObstacles::distance(Vec3 from, Vec3 to, double most) const noexcept
{
    const Vec3 start = own(from), way = own(to) - start;
    const double corner = glm::length(half_);
    double least = most;
    for (const Block& block : blocks_) {
        if (toSegment(block.centre, start, way) - block.radius >= least) {
            continue;
        }
        for (std::size_t i = block.first; i < block.first + block.count; ++i) {
            if (toSegment(voxels_[i], start, way) - corner < least) {
                least = std::min(least, toBox(start - voxels_[i], way, half_));
            }
        }
    }
    return least;
}

}  // namespace palpate::datasets
