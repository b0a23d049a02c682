#include <volume/scalar_field.h>

#include <volume/label_image.h>
#include <volume/voxel_distance.h>

#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::volume {

double ScalarField::at(Vec3 p) const noexcept
{
    const Vec3 last(grid.size - Index3(1));
    const Vec3 g = glm::clamp((p - grid.origin) / grid.spacing, Vec3(0.0), last);
    const Index3 n = glm::min(Index3(g), glm::max(grid.size - Index3(2), Index3(0)));
    const Vec3 t = g - Vec3(n);
    const Index3 step = glm::min(Index3(1), grid.size - Index3(1));

    const std::size_t base = grid.offset(n);
    const auto dx = static_cast<std::size_t>(step.x);
    const auto dy = static_cast<std::size_t>(step.y * grid.size.x);
    const auto dz =
        static_cast<std::size_t>(step.z) * static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y);
    const float* v = values.data() + base;
    const auto alongX = [&](std::size_t o) {
        return static_cast<double>(v[o]) * (1.0 - t.x) + static_cast<double>(v[o + dx]) * t.x;
    };
    const double low = alongX(0) * (1.0 - t.y) + alongX(dy) * t.y;
    const double high = alongX(dz) * (1.0 - t.y) + alongX(dz + dy) * t.y;
    return low * (1.0 - t.z) + high * t.z;
}

Vec3 ScalarField::gradient(Vec3 p) const noexcept
{
    const double h = 0.5 * grid.spacing;
    return Vec3(at(p + Vec3(h, 0, 0)) - at(p - Vec3(h, 0, 0)), at(p + Vec3(0, h, 0)) - at(p - Vec3(0, h, 0)),
                at(p + Vec3(0, 0, h)) - at(p - Vec3(0, 0, h))) /
           grid.spacing;
}

// gradient() has no values on the outer side of the border.
Vec3 DistanceField::slopeAt(Vec3 p) const noexcept
{
    const double h = 0.5 * grid.spacing;
    const Box box = grid.box();
    return gradient(glm::clamp(p, box.low + h, box.high - h));
}

// The point of the structure that is nearest to the border's point `c` lies at c - d n. The next `c` is where the way to it
// enters the grid. Where the structure itself reaches the border, that is as near as is known.
Vec3 DistanceField::fromNearest(Vec3 p, Vec3 c) const noexcept
{
    constexpr int rounds = 3;
    const Box box = grid.box();
    Vec3 way(std::numeric_limits<double>::max());
    for (int i = 0; i < rounds; ++i) {
        const Vec3 slope = slopeAt(c);
        const double steepness = glm::length(slope);
        // The grid holds the nearest point, so that the slope leads outwards; one that does not is not the structure's.
        const Vec3 n = steepness > 1e-9 && glm::dot(slope, p - c) > 0.0 ? slope / steepness : glm::normalize(p - c);
        const Vec3 found = p - c + std::max(at(c), 0.0) * n;
        way = glm::length(found) < glm::length(way) ? found : way;
        const Vec3 outside = p - glm::clamp(p, box.low, box.high);
        double entry = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
            entry = std::max(entry, outside[axis] != 0.0 ? outside[axis] / way[axis] : 0.0);
        }
        c = glm::clamp(p - std::min(entry, 1.0) * way, box.low, box.high);
    }
    return way;
}

double DistanceField::distance(Vec3 p) const noexcept
{
    const Box box = grid.box();
    const Vec3 inside = glm::clamp(p, box.low, box.high);
    return inside == p ? at(p) : std::min(at(inside), 0.0) + glm::length(fromNearest(p, inside));
}

double DistanceField::besideGrid(Vec3 p) const noexcept
{
    const Box box = grid.box();
    return glm::distance(p, glm::clamp(p, box.low, box.high));
}

Vec3 DistanceField::normal(Vec3 p) const noexcept
{
    const Box box = grid.box();
    const Vec3 inside = glm::clamp(p, box.low, box.high);
    const Vec3 g = inside == p ? slopeAt(p) : fromNearest(p, inside);
    const double length = glm::length(g);
    return length > 1e-9 ? g / length : Vec3(0, 0, 1);
}

namespace {

// The parabolas of the lower envelope on a line, by place along it.
struct Envelope {
    std::vector<int> vertex;    // where it is lowest [steps]
    std::vector<double> start;  // from where on it is the lowest of all [steps]

    // Adds that with its vertex at `k`, which is behind all others; `height` by vertex, in squares of steps.
    template <typename Height>
    void add(int k, const Height& height)
    {
        double from = std::numeric_limits<double>::lowest();
        while (!vertex.empty()) {
            const double p = vertex.back(), q = k;
            from = (height(k) + q * q - height(vertex.back()) - p * p) / (2.0 * (q - p));
            if (from > start.back()) {
                break;
            }
            vertex.pop_back();
            start.pop_back();
            from = std::numeric_limits<double>::lowest();
        }
        vertex.push_back(k);
        start.push_back(from);
    }
};

// Values along one axis, and how to work on a line of them.
struct LinePass {
    std::vector<float> square;  // of 0, 1, 2 .. steps [m^2]
    double step = 0;            // [m]
    std::size_t stride = 1;
    int count = 0;

    // What a line needs.
    struct Scratch {
        std::vector<float> line;
        Envelope envelope;
    };

    // Lowers each value to the least of those within the window plus the square of the way to them. Beyond the window it
    // may stay as it was.
    void run(float* first, Scratch& scratch) const
    {
        std::vector<float>& line = scratch.line;
        line.resize(static_cast<std::size_t>(count));
        for (std::size_t k = 0; k < line.size(); ++k) {
            line[k] = first[k * stride];
        }
        if (std::all_of(line.begin(), line.end(), [&](float v) { return v == line[0]; })) {
            return;
        }
        constexpr int largestTried = 8;
        const int window = static_cast<int>(square.size()) - 1;
        window <= largestTried ? tryAll(first, line, window) : follow(first, line, scratch.envelope, window);
    }

private:
    void tryAll(float* first, const std::vector<float>& line, int window) const
    {
        for (int k = 0; k < count; ++k) {
            float least = std::numeric_limits<float>::infinity();
            for (int j = std::max(0, k - window); j <= std::min(count - 1, k + window); ++j) {
                least =
                    std::min(least, line[static_cast<std::size_t>(j)] + square[static_cast<std::size_t>(std::abs(j - k))]);
            }
            first[static_cast<std::size_t>(k) * stride] = least;
        }
    }

    void follow(float* first, const std::vector<float>& line, Envelope& envelope, int window) const
    {
        envelope.vertex.clear();
        envelope.start.clear();
        const auto height = [&](int k) { return static_cast<double>(line[static_cast<std::size_t>(k)]) / (step * step); };
        for (int k = 0; k < count; ++k) {
            if (std::isfinite(line[static_cast<std::size_t>(k)])) {
                envelope.add(k, height);
            }
        }
        std::size_t at = 0;
        for (int k = 0; k < count; ++k) {
            while (at + 1 < envelope.vertex.size() && envelope.start[at + 1] <= k) {
                ++at;
            }
            const int vertex = envelope.vertex[at], away = std::abs(vertex - k);
            first[static_cast<std::size_t>(k) * stride] =
                away <= window ? line[static_cast<std::size_t>(vertex)] + square[static_cast<std::size_t>(away)]
                               : std::numeric_limits<float>::infinity();
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
        LinePass pass{{}, spacing[axis], places.offset(step), grid.size[axis]};
        for (int k = 0; k < grid.size[axis] && k * spacing[axis] <= reach * (1 + 1e-6); ++k) {
            pass.square.push_back(static_cast<float>(k * k * spacing[axis] * spacing[axis]));
        }
        const int outer = axis == 2 ? 1 : 2, inner = axis == 0 ? 1 : 0;
        tbb::parallel_for(0, grid.size[outer], [&](int o) {
            LinePass::Scratch scratch;
            for (int i = 0; i < grid.size[inner]; ++i) {
                Index3 start(0);
                start[outer] = o;
                start[inner] = i;
                pass.run(d.data() + places.offset(start), scratch);
            }
        });
    }
    return d;
}

}  // namespace palpate::volume
