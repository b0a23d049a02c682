#include <volume/distance.h>

#include <tbb/parallel_for.h>
#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace palpate::volume {

namespace {

constexpr std::size_t bins = 256;
constexpr std::size_t maxSide = 8;  // samples of a cell in each direction
constexpr float lowestIso = 0.05F;
constexpr float highestIso = 0.6F;

// Number of cells by the value in them, for values between `low` and `high`; what lies beyond is in the first and last bin.
struct Histogram {
    float low = 0;
    float high = 1;
    std::array<double, bins> cells{};

    void add(float value, double fraction)
    {
        const float bin = (value - low) / (high - low) * static_cast<float>(bins);
        cells[static_cast<std::size_t>(std::clamp(bin, 0.0F, static_cast<float>(bins - 1)))] += fraction;
    }
    double above(float level) const
    {
        const float bin = std::ceil((level - low) / (high - low) * static_cast<float>(bins));
        return std::accumulate(cells.begin() + static_cast<std::ptrdiff_t>(bin), cells.end(), 0.0);
    }
    // The level that `wanted` cells lie above.
    float levelOf(double wanted) const
    {
        double sum = 0;
        std::size_t bin = bins;
        while (bin > 0 && sum + cells[bin - 1] < wanted) {
            sum += cells[--bin];
        }
        const double rest = bin > 0 ? (wanted - sum) / cells[bin - 1] : 0.0;
        return low + (high - low) * (static_cast<float>(bin) - static_cast<float>(rest)) / static_cast<float>(bins);
    }
};

// Values at the corners of a cell, x fastest.
using Corners = std::array<float, 8>;

// Adds side^3 samples of a cell, in each direction at the middles of `side` equal parts.
void addSamples(const Corners& corners, int side, Histogram& histogram)
{
    const double each = 1.0 / (side * side * side);
    const auto parts = static_cast<std::size_t>(side);
    std::array<float, maxSide> places;                // of the middles, 0 to 1
    std::array<std::array<float, 4>, maxSide> edges;  // values there on the four edges along x
    for (std::size_t x = 0; x < parts; ++x) {
        places[x] = (static_cast<float>(x) + 0.5F) / static_cast<float>(side);
        for (std::size_t e = 0; e < 4; ++e) {
            edges[x][e] = corners[2 * e] + places[x] * (corners[2 * e + 1] - corners[2 * e]);
        }
    }
    for (std::size_t z = 0; z < parts; ++z) {
        for (std::size_t y = 0; y < parts; ++y) {
            for (std::size_t x = 0; x < parts; ++x) {
                const std::array<float, 4>& edge = edges[x];
                const float near = edge[0] + places[y] * (edge[1] - edge[0]);
                const float far = edge[2] + places[y] * (edge[3] - edge[2]);
                histogram.add(near + places[z] * (far - near), each);
            }
        }
    }
}

// Adds the cells between four rows of `count` nodes: samples of those with values between the limits, others whole.
void addCells(const std::array<const float*, 4>& rows, int count, float sign, int side, Histogram& histogram)
{
    const auto column = [&](int x) {
        return std::array<float, 4>{sign * rows[0][x], sign * rows[1][x], sign * rows[2][x], sign * rows[3][x]};
    };
    const auto lowest = [](const auto& v) { return std::min(std::min(v[0], v[1]), std::min(v[2], v[3])); };
    const auto highest = [](const auto& v) { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); };
    std::array<float, 4> near = column(0);
    for (int x = 1; x < count; ++x) {
        const std::array<float, 4> far = column(x);
        if (std::max(highest(near), highest(far)) <= histogram.low) {
            histogram.cells[0] += 1.0;
        } else if (std::min(lowest(near), lowest(far)) >= histogram.high) {
            histogram.cells[bins - 1] += 1.0;
        } else {
            addSamples({near[0], far[0], near[1], far[1], near[2], far[2], near[3], far[3]}, side, histogram);
        }
        near = far;
    }
}

// Of `sign`, 1 or -1, times the values.
Histogram histogramOf(const NodeGrid& grid, std::span<const float> values, float sign, float low, float high, int side)
{
    std::vector<Histogram> slices(static_cast<std::size_t>(std::max(0, grid.size.z - 1)), Histogram{low, high, {}});
    tbb::parallel_for(std::size_t{0}, slices.size(), [&](std::size_t slice) {
        const int z = static_cast<int>(slice);
        const auto row = [&](int y, int up) { return values.data() + grid.offset({0, y, z + up}); };
        for (int y = 0; y + 1 < grid.size.y; ++y) {
            addCells({row(y, 0), row(y + 1, 0), row(y, 1), row(y + 1, 1)}, grid.size.x, sign, side, slices[slice]);
        }
    });
    Histogram all{low, high, {}};
    for (const Histogram& slice : slices) {
        std::transform(all.cells.begin(), all.cells.end(), slice.cells.begin(), all.cells.begin(), std::plus<>());
    }
    return all;
}

// A box of nodes of a grid.
struct Part {
    Index3 low{0};  // its first node
    NodeGrid grid;
};

// The nodes around a surface, which has one or more, that say what volume it encloses.
Part partAround(const NodeGrid& grid, const BlurredSurface& surface)
{
    constexpr int margin = 8;  // beyond it no point spreads that is the nearest of a node next to the surface
    Index3 low = grid.size;
    Index3 high(-1);
    for (const std::uint32_t node : surface.nodes) {
        low = glm::min(low, grid.node(node));
        high = glm::max(high, grid.node(node));
    }
    low = glm::max(low - margin, Index3(0));
    high = glm::min(high + margin, grid.size - 1);
    return {low, {high - low + 1, grid.position(low), grid.spacing}};
}

std::vector<float> copied(const NodeGrid& grid, std::span<const float> values, const Part& part)
{
    std::vector<float> copy;
    copy.reserve(part.grid.count());
    for (int z = 0; z < part.grid.size.z; ++z) {
        for (int y = 0; y < part.grid.size.y; ++y) {
            const auto row = values.begin() + static_cast<std::ptrdiff_t>(grid.offset(part.low + Index3(0, y, z)));
            copy.insert(copy.end(), row, row + part.grid.size.x);
        }
    }
    return copy;
}

// The surface on its way back, as nodes of the part see it. The differences of places stay the same to the bit: subtracting
// the first node rounds nothing.
BlurredSurface movedBack(const NodeGrid& grid, BlurredSurface surface, const Part& part)
{
    for (std::size_t k = 0; k < surface.nodes.size(); ++k) {
        surface.nodes[k] = static_cast<std::uint32_t>(part.grid.offset(grid.node(surface.nodes[k]) - part.low));
        surface.points[k].at += surface.back[k] * surface.points[k].normal;
        surface.points[k].at -= Vec3f(part.low);
        surface.back[k] = 0.0F;
    }
    return surface;
}

double cellsIn(const NodeGrid& grid, double volume)
{
    return volume / (grid.spacing * grid.spacing * grid.spacing);
}

}  // namespace

double integral(const NodeGrid& grid, std::span<const float> fraction)
{
    double sum = 0;
    for (int z = 0; z < grid.size.z; ++z) {
        for (int y = 0; y < grid.size.y; ++y) {
            const float* row = fraction.data() + grid.offset({0, y, z});
            double line = std::accumulate(row, row + grid.size.x, 0.0);
            line -= 0.5 * static_cast<double>(row[0] + row[grid.size.x - 1]);
            const double wy = y == 0 || y == grid.size.y - 1 ? 0.5 : 1.0;
            const double wz = z == 0 || z == grid.size.z - 1 ? 0.5 : 1.0;
            sum += line * wy * wz;
        }
    }
    return sum * grid.spacing * grid.spacing * grid.spacing;
}

float isoForVolume(const NodeGrid& grid, std::span<const float> fraction, double volume)
{
    const Histogram histogram = histogramOf(grid, fraction, 1.0F, 0.0F, 1.0F, 3);
    const double wanted = cellsIn(grid, volume);
    float iso = 0.5F;
    if (std::abs(histogram.above(iso) - wanted) > 0.005 * wanted) {
        iso = std::clamp(histogram.levelOf(wanted), lowestIso, highestIso);
    }
    return std::min(iso, 0.9F * *std::max_element(fraction.begin(), fraction.end()));
}

double enclosedVolume(const NodeGrid& grid, std::span<const float> distance)
{
    const auto h = static_cast<float>(grid.spacing);
    return histogramOf(grid, distance, -1.0F, -h, h, 3).above(0.0F) * grid.spacing * grid.spacing * grid.spacing;
}

Enclosed enclosedBy(const NodeGrid& grid, std::span<const float> fraction, const BlurredSurface& surface)
{
    const Part part = surface.nodes.empty() ? Part{Index3(0), grid} : partAround(grid, surface);
    if (2 * part.grid.count() < grid.count()) {
        const std::vector<float> fractions = copied(grid, fraction, part);
        const auto isInside = [](float f) { return f > 0.5F; };
        if (std::ranges::count_if(fraction, isInside) == std::ranges::count_if(fractions, isInside)) {
            const auto distance = signedDistance(part.grid, fractions, movedBack(grid, surface, part), 1.0F);
            return {enclosedVolume(part.grid, distance), {}};
        }
    }
    std::vector<float> distance = signedDistance(grid, fraction, surface, 1.0F);
    const double volume = enclosedVolume(grid, distance);
    return {volume, std::move(distance)};
}

void keepVolume(const NodeGrid& grid, std::vector<float>& distance, double volume)
{
    const auto h = static_cast<float>(grid.spacing);
    const double wanted = cellsIn(grid, volume);
    const bool thin = std::abs(histogramOf(grid, distance, -1.0F, -h, h, 2).above(0.0F) - wanted) > 0.03 * wanted;
    // Finer samples: a thin structure along the grid crosses all of its cells alike, so that coarse ones would jump.
    const float level =
        thin ? std::clamp(histogramOf(grid, distance, -1.0F, -h, h, 8).levelOf(wanted), -0.5F * h, 0.5F * h) : 0.0F;
    std::transform(distance.begin(), distance.end(), distance.begin(), [level](float d) { return level + d; });
}

}  // namespace palpate::volume
