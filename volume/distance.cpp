#include <volume/distance.h>

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace palpate::volume {

namespace {

float squaredDistance(Index3 n, const SurfacePoint& point)
{
    const Vec3f away = Vec3f(n) - point.at;
    return glm::dot(away, away);
}

// One sweep through the slices, upwards or downwards. Every node takes over its neighbour's point when that is nearer than
// its own; in each slice once along +y and once along -y, and in each row once along +x and once along -x.
class Sweep {
public:
    Sweep(Index3 size, std::span<const SurfacePoint> points, std::vector<std::int32_t>& nearest)
        : size_(size), points_(points), nearest_(nearest), distance_(nearest.size(), std::numeric_limits<float>::max())
    {
    }

    void run(bool upwards)
    {
        const NodeGrid grid{size_, Vec3(0.0), 1.0};
        for (std::size_t i = 0; i < nearest_.size(); ++i) {
            if (nearest_[i] >= 0) {
                distance_[i] = squaredDistance(grid.node(i), points_[static_cast<std::size_t>(nearest_[i])]);
            }
        }
        const std::ptrdiff_t slice = static_cast<std::ptrdiff_t>(size_.x) * size_.y;
        for (int k = 0; k < size_.z; ++k) {
            const int z = upwards ? k : size_.z - 1 - k;
            for (int y = 0; k > 0 && y < size_.y; ++y) {
                takeRow(y, z, upwards ? -slice : slice);
            }
            for (int y = 0; y < size_.y; ++y) {
                sweepRow(y, z, y > 0 ? -size_.x : 0);
            }
            for (int y = size_.y - 2; y >= 0; --y) {
                sweepRow(y, z, size_.x);
            }
        }
    }

private:
    void take(Index3 n, std::ptrdiff_t own, std::ptrdiff_t from)
    {
        const std::int32_t point = nearest_[static_cast<std::size_t>(own + from)];
        std::int32_t& mine = nearest_[static_cast<std::size_t>(own)];
        if (point == mine || point < 0) {
            return;
        }
        const float d = squaredDistance(n, points_[static_cast<std::size_t>(point)]);
        float& least = distance_[static_cast<std::size_t>(own)];
        if (d < least) {
            least = d;
            mine = point;
        }
    }
    std::ptrdiff_t row(int y, int z) const
    {
        return static_cast<std::ptrdiff_t>(size_.x) * (y + static_cast<std::ptrdiff_t>(size_.y) * z);
    }
    void takeRow(int y, int z, std::ptrdiff_t from)
    {
        for (int x = 0; x < size_.x; ++x) {
            take({x, y, z}, row(y, z) + x, from);
        }
    }
    void sweepRow(int y, int z, std::ptrdiff_t from)
    {
        if (from != 0) {
            takeRow(y, z, from);
        }
        for (int x = 1; x < size_.x; ++x) {
            take({x, y, z}, row(y, z) + x, -1);
        }
        for (int x = size_.x - 2; x >= 0; --x) {
            take({x, y, z}, row(y, z) + x, 1);
        }
    }

    Index3 size_;
    std::span<const SurfacePoint> points_;
    std::vector<std::int32_t>& nearest_;
    std::vector<float> distance_;  // squared, node units
};

constexpr std::array<Index3, 6> faceNeighbours = {Index3(-1, 0, 0), Index3(1, 0, 0),  Index3(0, -1, 0),
                                                  Index3(0, 1, 0),  Index3(0, 0, -1), Index3(0, 0, 1)};

// Calls visit(node, its offset) for every node, on all cores.
template <typename Visit>
void forEachNode(const NodeGrid& grid, const Visit& visit)
{
    tbb::parallel_for(0, grid.size.z, [&](int z) {
        std::size_t i = grid.offset({0, 0, z});
        for (int y = 0; y < grid.size.y; ++y) {
            for (int x = 0; x < grid.size.x; ++x) {
                visit(Index3(x, y, z), i++);
            }
        }
    });
}

// The nearer of two answers at every node, then compared with the answers of the six neighbours.
std::vector<std::int32_t> join(const NodeGrid& grid, std::span<const SurfacePoint> points,
                               const std::vector<std::int32_t>& up, const std::vector<std::int32_t>& down)
{
    std::vector<std::int32_t> best(up.size(), -1);
    const std::ptrdiff_t row = grid.size.x;
    const std::ptrdiff_t slice = row * grid.size.y;
    forEachNode(grid, [&](Index3 n, std::size_t i) {
        float least = std::numeric_limits<float>::max();
        const auto consider = [&](std::int32_t point) {
            if (point < 0 || point == best[i]) {
                return;
            }
            const float d = squaredDistance(n, points[static_cast<std::size_t>(point)]);
            if (d < least) {
                least = d;
                best[i] = point;
            }
        };
        const auto considerBoth = [&](bool there, std::ptrdiff_t step) {
            if (there) {
                consider(up[i + static_cast<std::size_t>(step)]);
                consider(down[i + static_cast<std::size_t>(step)]);
            }
        };
        considerBoth(true, 0);
        considerBoth(n.x > 0, -1);
        considerBoth(n.x + 1 < grid.size.x, 1);
        considerBoth(n.y > 0, -row);
        considerBoth(n.y + 1 < grid.size.y, row);
        considerBoth(n.z > 0, -slice);
        considerBoth(n.z + 1 < grid.size.z, slice);
    });
    return best;
}

// Trilinear samples of the fraction in node units.
struct Samples {
    const NodeGrid& grid;
    std::span<const float> values;

    float node(Index3 n) const { return values[grid.offset(glm::clamp(n, Index3(0), grid.size - 1))]; }

    float at(Vec3f p) const
    {
        const Vec3f low = glm::floor(p);
        const Vec3f t = p - low;
        const Index3 n(low);
        float sum = 0;
        for (int corner = 0; corner < 8; ++corner) {
            const Index3 step(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
            const Vec3f w = glm::mix(1.0F - t, t, Vec3f(step));
            sum += w.x * w.y * w.z * node(n + step);
        }
        return sum;
    }

    Vec3f gradient(Vec3f p) const
    {
        const float h = 0.5F;
        return {at(p + Vec3f(h, 0, 0)) - at(p - Vec3f(h, 0, 0)), at(p + Vec3f(0, h, 0)) - at(p - Vec3f(0, h, 0)),
                at(p + Vec3f(0, 0, h)) - at(p - Vec3f(0, 0, h))};
    }
};

// The surface point nearest to node `n` inside its cell. False when the surface does not pass there.
bool surfaceNear(const Samples& f, float iso, Index3 n, SurfacePoint& found)
{
    const Vec3f x(n);
    const float own = f.node(n) - iso;
    float least = std::numeric_limits<float>::max();
    bool crosses = false;
    for (const Index3& step : faceNeighbours) {
        const float other = f.node(n + step) - iso;
        if ((own > 0) == (other > 0)) {
            continue;
        }
        crosses = true;
        const float t = own / (own - other);
        if (t <= 0.5F && t < least) {
            least = t;
            found.at = x + t * Vec3f(step);
        }
    }
    if (!crosses) {
        return false;
    }
    // Newton along the gradient lands nearer than the edges of the grid do.
    const Vec3f g = f.gradient(x);
    const float steepness = glm::dot(g, g);
    Vec3f p = x;
    for (int i = 0; i < 4 && steepness > 1e-6F; ++i) {
        p -= (f.at(p) - iso) / steepness * g;
        p = glm::clamp(p, x - 1.0F, x + 1.0F);
    }
    const Vec3f way = glm::abs(p - x);
    const bool landed = steepness > 1e-6F && std::abs(f.at(p) - iso) < 0.01F;
    if (landed && std::max({way.x, way.y, way.z}) <= 0.5F && glm::length(way) < least) {
        least = glm::length(way);
        found.at = p;
    }
    if (least > 1.0F) {
        return false;
    }
    const Vec3f slope = f.gradient(found.at);
    const float length = glm::length(slope);
    found.normal = length > 1e-3F ? -slope / length : Vec3f(0.0F);
    return true;
}

// All surface points, entered at their nodes.
std::vector<SurfacePoint> collectSurface(const Samples& f, float iso, std::vector<std::int32_t>& nearest)
{
    const NodeGrid& grid = f.grid;
    const auto slices = static_cast<std::size_t>(grid.size.z);
    std::vector<std::vector<std::pair<std::size_t, SurfacePoint>>> found(slices);
    tbb::parallel_for(std::size_t{0}, slices, [&](std::size_t z) {
        for (int y = 0; y < grid.size.y; ++y) {
            for (int x = 0; x < grid.size.x; ++x) {
                const Index3 n(x, y, static_cast<int>(z));
                SurfacePoint point;
                if (surfaceNear(f, iso, n, point)) {
                    found[z].emplace_back(grid.offset(n), point);
                }
            }
        }
    });
    std::vector<SurfacePoint> points;
    for (const auto& slice : found) {
        for (const auto& [offset, point] : slice) {
            nearest[offset] = static_cast<std::int32_t>(points.size());
            points.push_back(point);
        }
    }
    return points;
}

// Distance in node units from a node to the surface around its nearest surface point: to the tangent plane there as long as
// its foot is close to the point (points are one spacing apart), and to the point itself beyond. Far away the point alone
// is better: its normal still carries the steps of the voxels.
float distanceTo(Index3 n, const SurfacePoint& point)
{
    const Vec3f away = Vec3f(n) - point.at;
    const float squared = glm::dot(away, away);
    if (point.normal == Vec3f(0.0F)) {
        return std::sqrt(squared);
    }
    const float plane = glm::dot(away, point.normal);
    const float lateral = std::sqrt(std::max(0.0F, squared - plane * plane));
    const float slack = 0.6F * std::clamp(2.0F - 0.5F * std::sqrt(squared), 0.0F, 1.0F);
    const float beyond = std::max(0.0F, lateral - slack);
    return std::sqrt(plane * plane + beyond * beyond);
}

// Of each node to the surface around its nearest point [m], negative where isInside(node, offset, that point); without any
// point (null) the grid's diagonal.
template <typename IsInside>
std::vector<float> distances(const NodeGrid& grid, std::span<const SurfacePoint> points, std::vector<std::int32_t>& nearest,
                             const IsInside& isInside)
{
    spreadNearest(grid.size, points, nearest);
    const auto diagonal = static_cast<float>(glm::length(Vec3(grid.size)));
    const auto spacing = static_cast<float>(grid.spacing);
    std::vector<float> distance(grid.count());
    forEachNode(grid, [&](Index3 n, std::size_t i) {
        const SurfacePoint* point = nearest[i] >= 0 ? &points[static_cast<std::size_t>(nearest[i])] : nullptr;
        const float d = point != nullptr ? distanceTo(n, *point) : diagonal;
        distance[i] = (isInside(n, i, point) ? -d : d) * spacing;
    });
    return distance;
}

constexpr std::size_t bins = 256;
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

// Adds a cell: side^3 samples where its values lie between the limits, else all of it at once.
void addCell(const Corners& corners, int side, Histogram& histogram)
{
    const auto [low, high] =
        std::minmax({corners[0], corners[1], corners[2], corners[3], corners[4], corners[5], corners[6], corners[7]});
    if (low >= histogram.high || high <= histogram.low) {
        histogram.cells[high <= histogram.low ? 0 : bins - 1] += 1.0;
        return;
    }
    const int count = side * side * side;
    for (int s = 0; s < count; ++s) {
        const Vec3f t = (Vec3f(Index3(s % side, s / side % side, s / side / side)) + 0.5F) / static_cast<float>(side);
        const auto alongX = [&](std::size_t at) { return corners[at] + t.x * (corners[at + 1] - corners[at]); };
        const float near = alongX(0) + t.y * (alongX(2) - alongX(0));
        const float far = alongX(4) + t.y * (alongX(6) - alongX(4));
        histogram.add(near + t.z * (far - near), 1.0 / count);
    }
}

Histogram histogramOf(const NodeGrid& grid, std::span<const float> values, float low, float high, int side)
{
    std::vector<Histogram> slices(static_cast<std::size_t>(std::max(0, grid.size.z - 1)), Histogram{low, high, {}});
    const std::size_t y = grid.offset({0, 1, 0});
    const std::size_t z = grid.offset({0, 0, 1});
    tbb::parallel_for(std::size_t{0}, slices.size(), [&](std::size_t slice) {
        for (int row = 0; row + 1 < grid.size.y; ++row) {
            const float* at = values.data() + grid.offset({0, row, static_cast<int>(slice)});
            for (int x = 0; x + 1 < grid.size.x; ++x, ++at) {
                addCell({at[0], at[1], at[y], at[y + 1], at[z], at[z + 1], at[z + y], at[z + y + 1]}, side, slices[slice]);
            }
        }
    });
    Histogram all{low, high, {}};
    for (const Histogram& slice : slices) {
        std::transform(all.cells.begin(), all.cells.end(), slice.cells.begin(), all.cells.begin(), std::plus<>());
    }
    return all;
}

double cellsIn(const NodeGrid& grid, double volume)
{
    return volume / (grid.spacing * grid.spacing * grid.spacing);
}

}  // namespace

void spreadNearest(Index3 size, std::span<const SurfacePoint> points, std::vector<std::int32_t>& nearest)
{
    if (points.empty()) {
        return;
    }
    std::vector<std::int32_t> down = nearest;
    tbb::parallel_invoke([&] { Sweep(size, points, nearest).run(true); }, [&] { Sweep(size, points, down).run(false); });
    nearest = join({size, Vec3(0.0), 1.0}, points, nearest, down);
}

std::vector<float> signedDistance(const NodeGrid& grid, std::span<const float> fraction, float iso)
{
    const Samples samples{grid, fraction};
    std::vector<std::int32_t> nearest(grid.count(), -1);
    const std::vector<SurfacePoint> points = collectSurface(samples, iso, nearest);
    return distances(grid, points, nearest, [&](Index3, std::size_t i, const SurfacePoint*) { return fraction[i] > iso; });
}

std::vector<float> signedDistance(const NodeGrid& grid, std::span<const float> fraction, const BlurredSurface& surface,
                                  float weight)
{
    std::vector<std::int32_t> nearest(grid.count(), -1);
    std::vector<SurfacePoint> points = surface.points;
    for (std::size_t k = 0; k < points.size(); ++k) {
        points[k].at += weight * surface.back[k] * points[k].normal;
        nearest[surface.nodes[k]] = static_cast<std::int32_t>(k);
    }
    return distances(grid, points, nearest, [&](Index3 n, std::size_t i, const SurfacePoint* point) {
        const Vec3f away = point != nullptr ? Vec3f(n) - point->at : Vec3f(1.0F);
        return glm::dot(away, away) < 1.0F ? glm::dot(away, point->normal) < 0.0F : fraction[i] > 0.5F;
    });
}

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
    const Histogram histogram = histogramOf(grid, fraction, 0.0F, 1.0F, 3);
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
    std::vector<float> depth(distance.begin(), distance.end());
    std::transform(depth.begin(), depth.end(), depth.begin(), std::negate<>());
    return histogramOf(grid, depth, -h, h, 3).above(0.0F) * grid.spacing * grid.spacing * grid.spacing;
}

void keepVolume(const NodeGrid& grid, std::vector<float>& distance, double volume)
{
    const auto h = static_cast<float>(grid.spacing);
    std::transform(distance.begin(), distance.end(), distance.begin(), std::negate<>());
    const double wanted = cellsIn(grid, volume);
    const bool thin = std::abs(histogramOf(grid, distance, -h, h, 2).above(0.0F) - wanted) > 0.03 * wanted;
    // Finer samples: a thin structure along the grid crosses all of its cells alike, so that coarse ones would jump.
    const float level =
        thin ? std::clamp(histogramOf(grid, distance, -h, h, 8).levelOf(wanted), -0.5F * h, 0.5F * h) : 0.0F;
    std::transform(distance.begin(), distance.end(), distance.begin(), [level](float depth) { return level - depth; });
}

}  // namespace palpate::volume
