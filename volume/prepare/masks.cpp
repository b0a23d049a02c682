#include <volume/prepare/masks.h>

#include <volume/label_image.h>
#include <volume/pieces.h>
#include <volume/voxel_distance.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace palpate::prepare {

namespace {

using volume::VoxelGrid;

// An axial slice of the grid as a picture of `width` x `height` pixels.
struct Slice {
    std::size_t first = 0, right = 0, down = 0;  // offset of pixel (0, 0), and steps along its axes
    int width = 0, height = 0;

    std::size_t voxel(std::size_t at) const noexcept
    {
        const auto w = static_cast<std::size_t>(width);
        return first + at % w * right + at / w * down;
    }
    std::size_t count() const noexcept { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
};

Slice sliceOf(const VoxelGrid& grid, int axis, int number)
{
    const volume::LabelImage places{grid.size, grid.affine, {}};
    const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    Index3 along(0), right(0), down(0);
    along[axis] = number;
    right[u] = down[v] = 1;
    return {places.offset(along), places.offset(right), places.offset(down), grid.size[u], grid.size[v]};
}

// A region of pixels that hang together by edges.
struct Region {
    std::vector<std::size_t> pixels;
    bool border = false;  // it reaches the slice's border
};

// Visits the regions of the pixels for which wanted(voxel) holds.
template <typename Wanted, typename Visit>
void forEachRegion(const Slice& slice, const Wanted& wanted, const Visit& visit)
{
    std::vector<std::uint8_t> open(slice.count());
    for (std::size_t at = 0; at < open.size(); ++at) {
        open[at] = wanted(slice.voxel(at)) ? 1 : 0;
    }
    const auto w = static_cast<std::size_t>(slice.width);
    Region region;
    const auto take = [&](std::size_t at) {
        if (open[at] != 0) {
            open[at] = 0;
            region.pixels.push_back(at);
        }
    };
    for (std::size_t start = 0; start < open.size(); ++start) {
        region = {};
        take(start);
        for (std::size_t next = 0; next < region.pixels.size(); ++next) {
            const std::size_t at = region.pixels[next], x = at % w, y = at / w;
            const bool left = x > 0, right = x + 1 < w, up = y > 0, down = y + 1 < static_cast<std::size_t>(slice.height);
            region.border = region.border || !left || !right || !up || !down;
            for (const auto& [inside, to] :
                 {std::pair(left, at - 1), std::pair(right, at + 1), std::pair(up, at - w), std::pair(down, at + w)}) {
                if (inside) {
                    take(to);
                }
            }
        }
        if (!region.pixels.empty()) {
            visit(region);
        }
    }
}

template <typename Work>
void forEachSlice(const VoxelGrid& grid, const Work& work)
{
    const int axis = axialAxis(grid.affine);
    tbb::parallel_for(0, grid.size[axis], [&](int number) { work(sliceOf(grid, axis, number)); });
}

Mask complement(const Mask& mask)
{
    Mask out(mask.size());
    std::transform(mask.begin(), mask.end(), out.begin(), [](std::uint8_t m) { return m != 0 ? 0 : 1; });
    return out;
}

float reachSquared(double radius)
{
    return static_cast<float>(radius * radius * (1 + 1e-5));
}

}  // namespace

MaskPieces piecesOf(const VoxelGrid& grid, const Mask& mask, const std::vector<float>& image, float below)
{
    volume::LabelImage labels{grid.size, grid.affine, std::vector<std::uint16_t>(mask.begin(), mask.end())};
    std::vector<std::uint16_t> group(65536, 1);
    group[0] = 0;
    const volume::Pieces found(labels, group);
    MaskPieces out{std::vector<std::uint32_t>(mask.size(), 0), {}};
    std::vector<std::uint32_t> number(found.runs().size(), 0);
    const auto take = [&](std::uint32_t run, int y, int z) {
        std::uint32_t& n = number[found.root(run)];
        if (n == 0) {
            out.pieces.emplace_back();
            n = static_cast<std::uint32_t>(out.pieces.size());
        }
        MaskPiece& piece = out.pieces[n - 1];
        const volume::RowRun& row = found.runs()[run];
        const std::size_t from = labels.offset({row.first, y, z});
        const auto length = static_cast<std::size_t>(row.last - row.first + 1);
        std::fill_n(out.of.begin() + static_cast<std::ptrdiff_t>(from), length, n);
        piece.voxels += length;
        for (std::size_t i = from; i < from + length && !image.empty(); ++i) {
            piece.mean += static_cast<double>(image[i]);
            piece.low += image[i] < below ? 1 : 0;
        }
    };
    for (int z = 0; z < grid.size.z; ++z) {
        for (int y = 0; y < grid.size.y; ++y) {
            const auto [begin, end] = found.row(y, z);
            for (std::uint32_t run = begin; run != end; ++run) {
                take(run, y, z);
            }
        }
    }
    for (MaskPiece& piece : out.pieces) {
        piece.mean /= static_cast<double>(piece.voxels);
        piece.low /= static_cast<double>(piece.voxels);
    }
    return out;
}

Mask eroded(const VoxelGrid& grid, const Mask& mask, double radius)
{
    const std::vector<float> distance = volume::squaredDistance(grid, complement(mask), radius);
    Mask out(mask.size());
    std::transform(distance.begin(), distance.end(), out.begin(),
                   [most = reachSquared(radius)](float d) { return d > most ? 1 : 0; });
    return out;
}

Mask dilated(const VoxelGrid& grid, const Mask& mask, double radius)
{
    const std::vector<float> distance = volume::squaredDistance(grid, mask, radius);
    Mask out(mask.size());
    std::transform(distance.begin(), distance.end(), out.begin(),
                   [most = reachSquared(radius)](float d) { return d <= most ? 1 : 0; });
    return out;
}

Mask touching(const VoxelGrid& grid, const Mask& mask)
{
    const volume::LabelImage places{grid.size, grid.affine, {}};
    Mask out = mask;
    volume::forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        for (int axis = 0; axis < 3 && mask[places.offset(n)] != 0; ++axis) {
            Index3 step(0);
            step[axis] = 1;
            if (n[axis] > 0) {
                out[places.offset(n - step)] = 1;
            }
            if (n[axis] + 1 < grid.size[axis]) {
                out[places.offset(n + step)] = 1;
            }
        }
    });
    return out;
}

std::vector<float> boxMeans(const VoxelGrid& grid, const std::vector<float>& image, double reach)
{
    const volume::LabelImage places{grid.size, grid.affine, {}};
    const Vec3 spacing = grid.affine.spacing();
    std::vector<float> out = image;
    for (int axis = 0; axis < 3; ++axis) {
        const int window = static_cast<int>(std::floor(reach / spacing[axis] + 1e-6)), count = grid.size[axis];
        const int outer = axis == 2 ? 1 : 2, inner = axis == 0 ? 1 : 0;
        Index3 step(0);
        step[axis] = 1;
        const std::size_t stride = places.offset(step);
        tbb::parallel_for(0, window > 0 ? grid.size[outer] : 0, [&](int o) {
            std::vector<double> sums(static_cast<std::size_t>(count) + 1, 0.0);
            for (int i = 0; i < grid.size[inner]; ++i) {
                Index3 start(0);
                start[outer] = o;
                start[inner] = i;
                float* const first = out.data() + places.offset(start);
                for (std::size_t k = 0; k + 1 < sums.size(); ++k) {
                    sums[k + 1] = sums[k] + static_cast<double>(first[k * stride]);
                }
                for (int k = 0; k < count; ++k) {
                    const int low = std::max(0, k - window), high = std::min(count, k + window + 1);
                    first[static_cast<std::size_t>(k) * stride] = static_cast<float>(
                        (sums[static_cast<std::size_t>(high)] - sums[static_cast<std::size_t>(low)]) / (high - low));
                }
            }
        });
    }
    return out;
}

Mask closed(const VoxelGrid& grid, const Mask& mask, double radius)
{
    return eroded(grid, dilated(grid, mask, radius), radius);
}

int axialAxis(const volume::Affine& affine) noexcept
{
    const Vec3 spacing = affine.spacing();
    int best = 2;
    double most = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double along = std::abs(affine.linear[axis].z) / spacing[axis];
        if (along > most) {
            most = along;
            best = axis;
        }
    }
    return best;
}

Mask outsideBySlices(const VoxelGrid& grid, const Mask& mask, const std::vector<float>& image, float below)
{
    Mask out(mask.size(), 0);
    forEachSlice(grid, [&](const Slice& slice) {
        forEachRegion(
            slice, [&](std::size_t voxel) { return mask[voxel] == 0; },
            [&](const Region& region) {
                const auto low = std::count_if(region.pixels.begin(), region.pixels.end(),
                                               [&](std::size_t at) { return image[slice.voxel(at)] < below; });
                if (!region.border || 2 * static_cast<std::size_t>(low) < region.pixels.size()) {
                    return;
                }
                for (const std::size_t at : region.pixels) {
                    out[slice.voxel(at)] = 1;
                }
            });
    });
    return out;
}

void fillHolesBySlices(const VoxelGrid& grid, Mask& mask)
{
    forEachSlice(grid, [&](const Slice& slice) {
        forEachRegion(
            slice, [&](std::size_t voxel) { return mask[voxel] == 0; },
            [&](const Region& region) {
                if (region.border) {
                    return;
                }
                for (const std::size_t at : region.pixels) {
                    mask[slice.voxel(at)] = 1;
                }
            });
    });
}

}  // namespace palpate::prepare
