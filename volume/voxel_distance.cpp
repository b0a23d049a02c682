#include <volume/voxel_distance.h>

#include <volume/label_image.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::volume {

namespace {

// Values along one axis, and how to work on a line of them.
struct LinePass {
    std::vector<float> square;  // of 0, 1, 2 .. steps [m^2]
    std::size_t stride = 1;
    int count = 0;

    // Lowers each value to the least of those within the window plus the square of the way to them.
    void run(float* first, std::vector<float>& line) const
    {
        line.resize(static_cast<std::size_t>(count));
        for (std::size_t k = 0; k < line.size(); ++k) {
            line[k] = first[k * stride];
        }
        if (std::all_of(line.begin(), line.end(), [&](float v) { return v == line[0]; })) {
            return;
        }
        const int window = static_cast<int>(square.size()) - 1;
        for (int k = 0; k < count; ++k) {
            float least = std::numeric_limits<float>::infinity();
            for (int j = std::max(0, k - window); j <= std::min(count - 1, k + window); ++j) {
                least =
                    std::min(least, line[static_cast<std::size_t>(j)] + square[static_cast<std::size_t>(std::abs(j - k))]);
            }
            first[static_cast<std::size_t>(k) * stride] = least;
        }
    }
};

}  // namespace

std::vector<float> squaredDistance(const VoxelGrid& grid, const std::vector<std::uint8_t>& marked, double reach)
{
    constexpr float far = std::numeric_limits<float>::infinity();
    std::vector<float> d(marked.size());
    std::transform(marked.begin(), marked.end(), d.begin(), [](std::uint8_t m) { return m != 0 ? 0.0F : far; });
    const LabelImage places{grid.size, grid.affine, {}};
    const Vec3 spacing = grid.affine.spacing();
    for (int axis = 0; axis < 3; ++axis) {
        Index3 step(0);
        step[axis] = 1;
        LinePass pass{{}, places.offset(step), grid.size[axis]};
        for (int k = 0; k * spacing[axis] <= reach * (1 + 1e-6); ++k) {
            pass.square.push_back(static_cast<float>(k * k * spacing[axis] * spacing[axis]));
        }
        const int outer = axis == 2 ? 1 : 2, inner = axis == 0 ? 1 : 0;
        tbb::parallel_for(0, grid.size[outer], [&](int o) {
            std::vector<float> line;
            for (int i = 0; i < grid.size[inner]; ++i) {
                Index3 start(0);
                start[outer] = o;
                start[inner] = i;
                pass.run(d.data() + places.offset(start), line);
            }
        });
    }
    return d;
}

}  // namespace palpate::volume
