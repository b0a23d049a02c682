#include <volume/blurred_surface.h>

#include <volume/paraboloid.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

namespace palpate::volume {

namespace {

// A density on the line, symmetrical about 0, by its values at even steps.
class Density {
public:
    // A box of one step.
    Density(double reach, double step) : step_(step), half_(static_cast<int>(std::ceil(reach / step)))
    {
        values_.assign(static_cast<std::size_t>(2 * half_ + 1), 0.0);
        values_[static_cast<std::size_t>(half_)] = 1.0 / step;
    }

    // Of the sum with a number that is even between -width / 2 and width / 2.
    void addBox(double width)
    {
        if (width >= step_) {
            const std::vector<double> sum = integrals();
            values_.assign(values_.size(), 0.0);
            addShifted(sum, 0.5 * width, 1.0 / width);
            addShifted(sum, -0.5 * width, -1.0 / width);
        }
    }

    // Of the sum with -way / 2 or way / 2, as likely.
    void addStep(double way)
    {
        const std::vector<double> before = std::exchange(values_, std::vector<double>(values_.size(), 0.0));
        addShifted(before, 0.5 * way, 0.5);
        addShifted(before, -0.5 * way, 0.5);
    }

    // Numbers under which `fraction` of all lie, for ascending fractions.
    template <typename Fractions, typename Take>
    void quantiles(const Fractions& fractions, const Take& take) const
    {
        const std::vector<double> sum = integrals();
        std::size_t i = 1;
        std::size_t k = 0;
        for (const double fraction : fractions) {
            const double wanted = fraction * sum.back();
            while (i + 1 < sum.size() && sum[i] < wanted) {
                ++i;
            }
            const double inside = sum[i] > sum[i - 1] ? (wanted - sum[i - 1]) / (sum[i] - sum[i - 1]) : 0.0;
            take(k++, (static_cast<double>(i - 1) + inside - half_) * step_);
        }
    }

private:
    // Up to each place, by the trapezoidal rule.
    std::vector<double> integrals() const
    {
        std::vector<double> sum(values_.size(), 0.0);
        for (std::size_t i = 1; i < sum.size(); ++i) {
            sum[i] = sum[i - 1] + 0.5 * step_ * (values_[i - 1] + values_[i]);
        }
        return sum;
    }
    // Adds to each place `factor` times the value `way` farther on: linear between the steps, and even beyond the ends.
    void addShifted(const std::vector<double>& values, double way, double factor)
    {
        const double steps = std::floor(way / step_);
        const double t = way / step_ - steps;
        const auto count = static_cast<std::ptrdiff_t>(values.size());
        const auto shift = std::clamp(static_cast<std::ptrdiff_t>(steps), -count, count);
        const auto add = [&](std::ptrdiff_t i, std::ptrdiff_t low, std::ptrdiff_t high) {
            values_[static_cast<std::size_t>(i)] +=
                factor * ((1.0 - t) * values[static_cast<std::size_t>(low)] + t * values[static_cast<std::size_t>(high)]);
        };
        const std::ptrdiff_t first = std::max<std::ptrdiff_t>(-shift, 0);
        const std::ptrdiff_t end = std::max(std::min(count - 1 - shift, count), first);
        for (std::ptrdiff_t i = 0; i < first; ++i) {
            add(i, 0, 0);
        }
        for (std::ptrdiff_t i = first; i < end; ++i) {
            add(i, i + shift, i + shift + 1);
        }
        for (std::ptrdiff_t i = end; i < count; ++i) {
            add(i, count - 1, count - 1);
        }
    }

    double step_;
    int half_;
    std::vector<double> values_;
};

Density projected(const Blur& blur, Vec3 normal)
{
    constexpr double finest = 0.01;
    constexpr double steps = 300;
    double reach = finest;
    for (int k = 0; k < 3; ++k) {
        reach += std::abs(normal[k]) * (0.5 * blur.box[k] + blur.passes[k]);
    }
    Density density(reach, std::max(finest, reach / steps));
    for (int k = 0; k < 3; ++k) {
        density.addBox(std::abs(normal[k]) * (normal[k] == 1.0 ? blur.face : blur.box)[k]);
        for (int pass = 0; pass < 2 * blur.passes[k]; ++pass) {
            density.addStep(std::abs(normal[k]));
        }
    }
    return density;
}

// Works on the nodes whose cells the blurred edge runs through.
class Band {
public:
    Band(const NodeGrid& grid, std::span<const float> fraction, const Blur& blur)
        : grid_(grid),
          fraction_(fraction),
          boxes_((grid.size + boxEdge - 1) / boxEdge),
          planes_(blur),
          toBack_(static_cast<float>(0.5 * blur.variance() + interpolated)),
          reach_(std::clamp(2.0F + 6.0F * static_cast<float>(blur.voxel), leastReach, farthestReach))
    {
        steps_ = {1, static_cast<std::ptrdiff_t>(grid.size.x), static_cast<std::ptrdiff_t>(grid.size.x) * grid.size.y};
        for (std::size_t i = 0; i < fraction.size(); ++i) {
            if (isIn(i)) {
                nodes_.push_back(static_cast<std::uint32_t>(i));
            }
        }
        normals_.resize(nodes_.size());
        depth_.resize(fraction.size());
    }

    BlurredSurface surface()
    {
        findPlanes();
        const BlurredSurface found = pointsInOwnCells();
        all_ = boxesOf(found.points);
        if (reach_ > widestOfAll) {
            sparse_ = boxesOf(fewer(found));
        }
        BlurredSurface fitted = found;
        forEach(found.nodes.size(), [&](std::size_t k) { fit(found, k, fitted); });
        // A layer of nodes within nearOwn on both sides of the surface has 2 nearOwn of them in a unit of area.
        fitted.shell = std::accumulate(fitted.back.begin(), fitted.back.end(), 0.0) / (2.0 * nearOwn);
        return fitted;
    }

private:
    static constexpr double interpolated = 1.0 / 12.0;  // of a field's bend: what linear interpolation adds, on average
    static constexpr float nearOwn = 0.7F;     // points lie in their cells, or a little beyond: none is lost on a face
    static constexpr float leastReach = 2.5F;  // of a paraboloid [spacings]
    static constexpr float farthestReach = 8.0F;
    static constexpr float widestOfAll = 5.0F;  // reach up to which a paraboloid takes every point
    static constexpr float leastCurvedReach = 2.0F;
    static constexpr float turn = 0.9F;           // reach over radius of curvature
    static constexpr float farthestShift = 0.5F;  // of a point by its paraboloid [spacings]

    bool isIn(std::size_t i) const { return fraction_[i] > PlaneDepth::lowest && fraction_[i] < 1.0F - PlaneDepth::lowest; }

    template <typename Visit>
    static void forEach(std::size_t count, const Visit& visit)
    {
        constexpr std::size_t grain = 512;
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
            for (std::size_t k = range.begin(); k != range.end(); ++k) {
                visit(k);
            }
        });
    }

    // The normal of a plane follows from depths, which are linear in space, and the depths from the normal. The fractions
    // give the first one: it leans too far from the nearest axis.
    void findPlanes()
    {
        forEach(nodes_.size(), [&](std::size_t k) { normals_[k] = normalFrom(fraction_, k); });
        for (int turns = 0; turns < 3; ++turns) {
            forEach(nodes_.size(),
                    [&](std::size_t k) { depth_[nodes_[k]] = planes_.at(fraction_[nodes_[k]], normals_[k]); });
            forEach(nodes_.size(), [&](std::size_t k) { normals_[k] = normalFrom(depth_, k); });
        }
    }

    // Against the gradient of values that grow inwards: from the neighbours in the band, on one side where the other is
    // beyond it.
    template <typename Values>
    Vec3f normalFrom(const Values& values, std::size_t k) const
    {
        const std::size_t i = nodes_[k];
        const Index3 n = grid_.node(i);
        Vec3f slope(0.0F);
        for (int axis = 0; axis < 3; ++axis) {
            const auto step = static_cast<std::size_t>(steps_[static_cast<std::size_t>(axis)]);
            const bool low = n[axis] > 0 && isIn(i - step);
            const bool high = n[axis] + 1 < grid_.size[axis] && isIn(i + step);
            slope[axis] = (values[high ? i + step : i] - values[low ? i - step : i]) / (low && high ? 2.0F : 1.0F);
        }
        const float length = glm::length(slope);
        return length > 1e-4F ? -slope / length : Vec3f(0.0F, 0.0F, 1.0F);
    }

    BlurredSurface pointsInOwnCells() const
    {
        BlurredSurface found;
        for (std::size_t k = 0; k < nodes_.size(); ++k) {
            const Vec3f way = depth_[nodes_[k]] * normals_[k];
            const Vec3f along = glm::abs(way);
            if (std::max({along.x, along.y, along.z}) <= nearOwn) {
                found.nodes.push_back(nodes_[k]);
                found.points.push_back({Vec3f(grid_.node(nodes_[k])) + way, normals_[k]});
            }
        }
        found.back.assign(found.nodes.size(), 0.0F);
        return found;
    }

    // Points by boxes of nodes; boxes of a row along x are one behind the other.
    struct Boxes {
        PointColumns points;
        std::vector<std::uint32_t> first;  // of each box, and the end
    };

    static constexpr int boxEdge = 4;  // [nodes]

    std::size_t boxOf(Index3 box) const
    {
        return static_cast<std::size_t>(box.x) +
               static_cast<std::size_t>(boxes_.x) *
                   (static_cast<std::size_t>(box.y) + static_cast<std::size_t>(boxes_.y) * static_cast<std::size_t>(box.z));
    }
    // Of a place; of one outside of the grid the next box.
    Index3 boxAt(Vec3f at) const { return glm::clamp(Index3(glm::floor(at)), Index3(0), grid_.size - 1) / boxEdge; }

    Boxes boxesOf(const std::vector<SurfacePoint>& points) const
    {
        Boxes boxed{PointColumns(points.size()), {}};
        boxed.first.assign(boxOf(boxes_ - 1) + 2, 0);
        for (const SurfacePoint& point : points) {
            ++boxed.first[boxOf(boxAt(point.at)) + 1];
        }
        std::partial_sum(boxed.first.begin(), boxed.first.end(), boxed.first.begin());
        std::vector<std::uint32_t> next(boxed.first.begin(), boxed.first.end() - 1);
        for (const SurfacePoint& point : points) {
            boxed.points.set(next[boxOf(boxAt(point.at))]++, point);
        }
        return boxed;
    }

    // A wide paraboloid needs no more: of nodes that are one behind the other under the surface one point, in the middle
    // of theirs, as what their depths are off has opposite signs on its two sides. One column in two, scattered.
    std::vector<SurfacePoint> fewer(const BlurredSurface& found) const
    {
        constexpr std::uint32_t scatter = 2654435761U;  // D. E. Knuth's multiplicative hash
        constexpr std::uint32_t none = ~0U;
        std::vector<std::uint32_t> pointOf(fraction_.size(), none);
        for (std::size_t k = 0; k < found.nodes.size(); ++k) {
            pointOf[found.nodes[k]] = static_cast<std::uint32_t>(k);
        }
        // The next point in the column of point k, or none.
        const auto beside = [&](std::size_t k, int axis, int way) {
            const int there = grid_.node(found.nodes[k])[axis] + way;
            if (there < 0 || there >= grid_.size[axis]) {
                return none;
            }
            const auto step = way * steps_[static_cast<std::size_t>(axis)];
            const std::uint32_t other = pointOf[static_cast<std::size_t>(found.nodes[k] + step)];
            return other != none && columnAxis(found.points[other].normal) == axis &&
                           glm::dot(found.points[k].normal, found.points[other].normal) > 1.0F - Paraboloid::unlike
                       ? other
                       : none;
        };
        std::vector<SurfacePoint> out;
        for (std::size_t k = 0; k < found.nodes.size(); ++k) {
            const int axis = columnAxis(found.points[k].normal);
            const auto above = grid_.node(found.nodes[k])[axis] * steps_[static_cast<std::size_t>(axis)];
            if ((found.nodes[k] - static_cast<std::uint32_t>(above)) * scatter >> 31U != 0U ||
                beside(k, axis, -1) != none) {
                continue;
            }
            SurfacePoint sum = found.points[k];
            float count = 1.0F;
            for (std::uint32_t o = beside(k, axis, 1); o != none; o = beside(o, axis, 1)) {
                sum.at += found.points[o].at;
                sum.normal += found.points[o].normal;
                ++count;
            }
            out.push_back({sum.at / count, glm::normalize(sum.normal)});
        }
        return out;
    }

    static int columnAxis(Vec3f normal)
    {
        const Vec3f along = glm::abs(normal);
        return along.x >= along.y && along.x >= along.z ? 0 : along.y >= along.z ? 1 : 2;
    }

    std::optional<Paraboloid> through(const SurfacePoint& top, float reach) const
    {
        Paraboloid paraboloid(top, reach);
        const Boxes& boxed = reach > widestOfAll ? sparse_ : all_;
        const Index3 low = boxAt(top.at - reach);
        const Index3 high = boxAt(top.at + reach);
        for (int z = low.z; z <= high.z; ++z) {
            for (int y = low.y; y <= high.y; ++y) {
                paraboloid.add(boxed.points, boxed.first[boxOf({low.x, y, z})], boxed.first[boxOf({high.x, y, z}) + 1]);
            }
        }
        return paraboloid.solve() ? std::optional(paraboloid) : std::nullopt;
    }

    // A point takes the paraboloid through the points around it, a narrower one where the surface is curved.
    void fit(const BlurredSurface& found, std::size_t k, BlurredSurface& fitted) const
    {
        std::optional<Paraboloid> paraboloid = through(found.points[k], reach_);
        const float narrow =
            paraboloid ? std::max(leastCurvedReach, 2.0F * turn / std::abs(paraboloid->bend())) : leastCurvedReach;
        if (narrow < 0.8F * reach_) {
            paraboloid = through(found.points[k], narrow);
        }
        if (paraboloid && std::abs(paraboloid->height()) < farthestShift) {
            fitted.points[k].at += paraboloid->height() * found.points[k].normal;
            fitted.points[k].normal = paraboloid->normal();
            fitted.back[k] = -toBack_ * std::clamp(paraboloid->bend(), -1.0F, 1.0F);
        }
    }

    const NodeGrid& grid_;
    std::span<const float> fraction_;
    Index3 boxes_;  // along each axis
    PlaneDepth planes_;
    float toBack_;  // in a bend of the surface
    float reach_;
    std::array<std::ptrdiff_t, 3> steps_{};
    std::vector<std::uint32_t> nodes_;
    std::vector<Vec3f> normals_;  // of nodes_
    std::vector<float> depth_;    // of all nodes
    Boxes all_, sparse_;
};

}  // namespace

double Blur::variance() const noexcept
{
    const Vec3 all = box * box / 12.0 + 0.5 * Vec3(passes);
    return (all.x + all.y + all.z) / 3.0;
}

PlaneDepth::PlaneDepth(const Blur& blur)
{
    std::array<double, bins + 1> fractions;
    for (std::size_t i = 0; i < fractions.size(); ++i) {
        fractions[i] = 0.5 + (0.5 - static_cast<double>(lowest)) * static_cast<double>(i) / bins;
    }
    for (int i = 0; i <= directions; ++i) {
        for (int j = 0; j <= directions - i; ++j) {
            const Vec3 squares(Vec3(i, j, directions - i - j) / static_cast<double>(directions));
            Curve curve;
            projected(blur, glm::sqrt(squares)).quantiles(fractions, [&](std::size_t k, double at) {
                curve[k] = static_cast<float>(at);
            });
            curves_.push_back(curve);
        }
    }
}

const PlaneDepth::Curve& PlaneDepth::curve(int i, int j) const noexcept
{
    return curves_[static_cast<std::size_t>(i * (directions + 1) - i * (i - 1) / 2 + j)];
}

float PlaneDepth::at(float fraction, Vec3f normal) const noexcept
{
    const float inside = std::min(std::max(fraction, 1.0F - fraction), 1.0F - lowest);
    const float bin = (inside - 0.5F) / (0.5F - lowest) * static_cast<float>(bins);
    const int low = std::min(static_cast<int>(bin), bins - 1);
    const float t = bin - static_cast<float>(low);
    const auto read = [&](int i, int j) {
        const Curve& c = curve(i, j);
        const auto k = static_cast<std::size_t>(low);
        return c[k] + t * (c[k + 1] - c[k]);
    };
    const float x = std::min(normal.x * normal.x, 1.0F) * static_cast<float>(directions);
    const float y =
        std::clamp(normal.y * normal.y * static_cast<float>(directions), 0.0F, static_cast<float>(directions) - x);
    int i = std::min(static_cast<int>(x), directions - 1);
    int j = std::min(static_cast<int>(y), directions - 1 - i);
    const float u = x - static_cast<float>(i);
    const float v = y - static_cast<float>(j);
    float depth = 0.0F;
    if (u + v <= 1.0F || i + j + 2 > directions) {
        depth = (1.0F - u - v) * read(i, j) + u * read(i + 1, j) + v * read(i, j + 1);
    } else {
        depth = (u + v - 1.0F) * read(i + 1, j + 1) + (1.0F - v) * read(i + 1, j) + (1.0F - u) * read(i, j + 1);
    }
    return fraction >= 0.5F ? depth : -depth;
}

BlurredSurface blurredSurface(const NodeGrid& grid, std::span<const float> fraction, const Blur& blur)
{
    return Band(grid, fraction, blur).surface();
}

}  // namespace palpate::volume
