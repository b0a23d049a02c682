#include <volume/distance.h>

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <limits>
#include <utility>

namespace palpate::volume {

namespace {

// Places of the points one behind the other, by their index: half the memory of points with normals. Index -1 is none, at a
// distance beyond all others.
class Places {
public:
    explicit Places(std::span<const SurfacePoint> points) : places_(points.size() + 1, Vec3f(none))
    {
        std::transform(points.begin(), points.end(), places_.begin() + 1, [](const SurfacePoint& p) { return p.at; });
    }

    float squaredDistance(Vec3f from, std::int32_t point) const
    {
        const Vec3f away = from - places_[static_cast<std::size_t>(point + 1)];
        return glm::dot(away, away);
    }

private:
    static constexpr float none = 1e18F;  // its square is still a number

    std::vector<Vec3f> places_;
};

// One sweep through the slices, upwards or downwards. Every node takes over its neighbour's point when that is nearer than
// its own; in each slice once along +y and once along -y, and in each row once along +x and once along -x.
class Sweep {
public:
    Sweep(Index3 size, const Places& places, std::vector<std::int32_t>& nearest)
        : size_(size),
          places_(places),
          nearest_(nearest),
          distance_(nearest.size(), places.squaredDistance(Vec3f(0.0F), -1))
    {
    }

    void run(bool upwards)
    {
        const NodeGrid grid{size_, Vec3(0.0), 1.0};
        int first = size_.z;  // slice with a point: those before it have none to give
        for (std::size_t i = 0; i < nearest_.size(); ++i) {
            if (nearest_[i] >= 0) {
                const Index3 n = grid.node(i);
                distance_[i] = places_.squaredDistance(Vec3f(n), nearest_[i]);
                first = std::min(first, upwards ? n.z : size_.z - 1 - n.z);
            }
        }
        const std::ptrdiff_t slice = static_cast<std::ptrdiff_t>(size_.x) * size_.y;
        for (int k = first; k < size_.z; ++k) {
            const int z = upwards ? k : size_.z - 1 - k;
            for (int y = 0; k > first && y < size_.y; ++y) {
                takeRow(y, z, upwards ? -slice : slice);
            }
            for (int y = 0; y < size_.y; ++y) {
                if (y > 0) {
                    takeRow(y, z, -size_.x);
                }
                sweepRow(y, z, {0, size_.x - 1});
            }
            for (int y = size_.y - 2; y >= 0; --y) {
                sweepRow(y, z, takeRow(y, z, size_.x));  // nothing changes where a row is as its sweep left it
            }
        }
    }

private:
    bool take(Index3 n, std::ptrdiff_t own, std::ptrdiff_t from)
    {
        const std::int32_t point = nearest_[static_cast<std::size_t>(own + from)];
        std::int32_t& mine = nearest_[static_cast<std::size_t>(own)];
        if (point == mine || point < 0) {
            return false;
        }
        const float d = places_.squaredDistance(Vec3f(n), point);
        float& least = distance_[static_cast<std::size_t>(own)];
        if (d >= least) {
            return false;
        }
        least = d;
        mine = point;
        return true;
    }
    std::ptrdiff_t row(int y, int z) const
    {
        return static_cast<std::ptrdiff_t>(size_.x) * (y + static_cast<std::ptrdiff_t>(size_.y) * z);
    }
    // The first and last node that took a point; of none, the last is before the first. Without a branch, as in Join.
    std::pair<int, int> takeRow(int y, int z, std::ptrdiff_t from)
    {
        std::int32_t* mine = nearest_.data() + row(y, z);
        const std::int32_t* theirs = mine + from;
        float* least = distance_.data() + row(y, z);
        Vec3f at(0, y, z);
        int first = size_.x;
        int last = -1;
        for (int x = 0; x < size_.x; ++x, ++at.x) {
            const std::int32_t point = theirs[x];
            const float d = places_.squaredDistance(at, point);
            const bool isNearer = d < least[x];
            least[x] = isNearer ? d : least[x];
            mine[x] = isNearer ? point : mine[x];
            first = std::min(first, isNearer ? x : size_.x);
            last = isNearer ? x : last;
        }
        return {first, last};
    }
    // Of a row in which nodes of `changed` alone have something to give: each pass ends behind the last node that took a
    // point.
    void sweepRow(int y, int z, std::pair<int, int> changed)
    {
        auto [first, last] = changed;
        for (int x = first + 1; x < size_.x && x <= last + 1; ++x) {
            last = take({x, y, z}, row(y, z) + x, -1) ? std::max(last, x) : last;
        }
        for (int x = last - 1; x >= 0 && x >= first - 1; --x) {
            first = take({x, y, z}, row(y, z) + x, 1) ? std::min(first, x) : first;
        }
    }

    Index3 size_;
    const Places& places_;
    std::vector<std::int32_t>& nearest_;
    std::vector<float> distance_;  // squared, node units
};

// The nearer of two answers at every node, then compared with the answers of the six neighbours: by rows and without a
// branch, as no processor foresees which is nearer.
class Join {
public:
    Join(Index3 size, const Places& places, const std::vector<std::int32_t>& up, const std::vector<std::int32_t>& down)
        : grid_{size, Vec3(0.0), 1.0}, places_(places), up_(up), down_(down), best_(up.size(), -1)
    {
    }

    std::vector<std::int32_t> run()
    {
        tbb::parallel_for(0, grid_.size.z, [&](int z) {
            std::vector<float> least(static_cast<std::size_t>(grid_.size.x));
            for (int y = 0; y < grid_.size.y; ++y) {
                std::fill(least.begin(), least.end(), std::numeric_limits<float>::max());
                joinRow({0, y, z}, least);
            }
        });
        return std::move(best_);
    }

private:
    void joinRow(Index3 first, std::vector<float>& least)
    {
        const Index3 last = grid_.size - 1;
        considerBoth(first, first, least);
        considerBoth(first + Index3(1, 0, 0), first, least);
        considerBoth(first, first + Index3(1, 0, 0), least);
        for (const Index3& step : {Index3(0, -1, 0), Index3(0, 1, 0), Index3(0, 0, -1), Index3(0, 0, 1)}) {
            const Index3 from = first + step;
            if (glm::all(glm::greaterThanEqual(from, Index3(0))) && glm::all(glm::lessThanEqual(from, last))) {
                considerBoth(first, from, least);
            }
        }
    }

    // The nodes of a row from `own` on consider the answers of nodes from `from` on.
    void considerBoth(Index3 own, Index3 from, std::vector<float>& least)
    {
        consider(up_, own, from, least);
        consider(down_, own, from, least);
    }
    void consider(const std::vector<std::int32_t>& answers, Index3 own, Index3 from, std::vector<float>& least)
    {
        const auto count = static_cast<std::size_t>(grid_.size.x - std::max(own.x, from.x));
        const std::int32_t* answer = answers.data() + grid_.offset(from);
        if (std::all_of(answer, answer + count, [](std::int32_t point) { return point < 0; })) {
            return;
        }
        std::int32_t* best = best_.data() + grid_.offset(own);
        float* distance = least.data() + own.x;
        Vec3f at(own);
        for (std::size_t k = 0; k < count; ++k, ++at.x) {
            const float d = places_.squaredDistance(at, answer[k]);
            const bool isNearer = d < distance[k];
            distance[k] = isNearer ? d : distance[k];
            best[k] = isNearer ? answer[k] : best[k];
        }
    }

    NodeGrid grid_;
    const Places& places_;
    const std::vector<std::int32_t>& up_;
    const std::vector<std::int32_t>& down_;
    std::vector<std::int32_t> best_;
};

}  // namespace

void spreadNearest(Index3 size, std::span<const SurfacePoint> points, std::vector<std::int32_t>& nearest)
{
    if (points.empty()) {
        return;
    }
    const Places places(points);
    std::vector<std::int32_t> down = nearest;
    tbb::parallel_invoke([&] { Sweep(size, places, nearest).run(true); }, [&] { Sweep(size, places, down).run(false); });
    nearest = Join(size, places, nearest, down).run();
}

}  // namespace palpate::volume
