#include <volume/distance.h>

#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace palpate::volume {

namespace {

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

    // Whether node n and its six neighbours, which it has, are on one side of the value.
    bool isOneSided(Index3 n, float iso) const
    {
        const float* own = values.data() + grid.offset(n);
        const std::ptrdiff_t row = grid.size.x;
        const std::ptrdiff_t slice = row * grid.size.y;
        const bool isAbove = *own > iso;
        return (own[-1] > iso) == isAbove && (own[1] > iso) == isAbove && (own[-row] > iso) == isAbove &&
               (own[row] > iso) == isAbove && (own[-slice] > iso) == isAbove && (own[slice] > iso) == isAbove;
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

bool isInner(const NodeGrid& grid, Index3 n)
{
    return grid.contains(n - 1) && grid.contains(n + 1);
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
                if (isInner(grid, n) && f.isOneSided(n, iso)) {
                    continue;
                }
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
inline float distanceTo(Index3 n, const SurfacePoint& point)
{
    const Vec3f away = Vec3f(n) - point.at;
    const float squared = glm::dot(away, away);
    if (point.normal == Vec3f(0.0F)) {
        return std::sqrt(squared);
    }
    const float plane = glm::dot(away, point.normal);
    const float lateral = std::sqrt(std::max(0.0F, squared - plane * plane));
    const float slack = squared < 16.0F ? 0.6F * std::min(2.0F - 0.5F * std::sqrt(squared), 1.0F) : 0.0F;
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

}  // namespace

std::vector<float> signedDistance(const NodeGrid& grid, std::span<const float> fraction, float iso,
                                  std::span<const std::uint8_t> marked)
{
    const auto counts = [&](std::size_t i) { return marked.empty() || marked[i] != 0; };
    std::vector<std::int32_t> nearest(grid.count(), -1);
    const std::vector<SurfacePoint> points = collectSurface({grid, fraction}, iso, nearest);
    for (std::size_t i = 0; i < nearest.size(); ++i) {
        nearest[i] = counts(i) ? nearest[i] : -1;
    }
    return distances(grid, points, nearest,
                     [&](Index3, std::size_t i, const SurfacePoint*) { return counts(i) && fraction[i] > iso; });
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

}  // namespace palpate::volume
