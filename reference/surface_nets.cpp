#include <reference/surface_nets.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <set>

namespace palpate::reference {

namespace {

constexpr int rounds = 8;          // of smoothing
constexpr double netReach = 0.45;  // of a point from its corner, along each axis [cells]
constexpr int netHalvings = 10;    // to a border
constexpr int pullRounds = 30;     // of points half way back
constexpr double atCorner = 1e-3;  // nearer than this is there [cells]
constexpr std::uint32_t noNode = ~0U;

// Cells over the samples, which end where these end.
class Cells {
public:
    Cells(const SmoothLabels& labels, double size) : labels_(labels)
    {
        const Vec3 spacing = labels.affine.spacing();
        for (int a = 0; a < 3; ++a) {
            count_[a] = std::max(1, static_cast<int>(std::lround(spacing[a] * labels.size[a] / size)));
        }
        region_.assign(base::countOf(count_), -1);
        volume::forEachIndex(Index3(0), count_ - 1,
                             [&](Index3 n) { region_[at(n)] = regionAt(labels_, place(Vec3(n) + 0.5)); });
    }

    Index3 count() const noexcept { return count_; }
    bool has(Index3 n) const noexcept { return base::holds(count_, n); }
    // -1 outside
    int region(Index3 n) const noexcept { return has(n) ? region_[at(n)] : -1; }
    std::uint8_t row(Index3 n) const noexcept
    {
        const int r = region(n);
        return r < 0 ? Surfaces::outside : labels_.rows[static_cast<std::size_t>(r)];
    }
    // From cells, whose corners are whole numbers, to metres.
    Vec3 place(Vec3 q) const noexcept
    {
        return labels_.affine.toPatient(Vec3(labels_.low) - 0.5 + q * Vec3(labels_.size) / Vec3(count_));
    }
    std::size_t at(Index3 n) const noexcept { return base::offsetOf(count_, n); }
    bool onFlatSide(int axis, int corner) const noexcept
    {
        return (corner == 0 && labels_.flat[static_cast<std::size_t>(2 * axis)]) ||
               (corner == count_[axis] && labels_.flat[static_cast<std::size_t>(2 * axis + 1)]);
    }

private:
    const SmoothLabels& labels_;
    Index3 count_{0};
    std::vector<int> region_;
};

// The point that a cell's corner has become.
struct NetPoint {
    Index3 corner{0};
    Vec3 at{0.0};                           // [cells]
    std::vector<std::uint32_t> neighbours;  // along edges of faces
    std::set<int> regions;                  // around it
};

class Net {
public:
    Net(const SmoothLabels& labels, const Cells& cells) : labels_(labels), cells_(cells)
    {
        number_.assign(base::countOf(cells.count() + 1), noNode);
        for (int axis = 0; axis < 3; ++axis) {
            Index3 first(0);
            first[axis] = -1;
            volume::forEachIndex(first, cells.count() - 1, [&](Index3 n) {
                Index3 next = n;
                ++next[axis];
                if (cells.region(n) != cells.region(next)) {
                    addFace(n, next, axis);
                }
            });
        }
        for (NetPoint& p : points_) {
            std::ranges::sort(p.neighbours);
            p.neighbours.erase(std::ranges::unique(p.neighbours).begin(), p.neighbours.end());
            volume::forEachIndex(p.corner - 1, p.corner, [&](Index3 n) { p.regions.insert(cells.region(n)); });
        }
    }

    void smooth()
    {
        for (int round = 0; round < rounds; ++round) {
            std::vector<Vec3> to;
            for (const NetPoint& p : points_) {
                Vec3 mean(0.0);
                std::size_t count = 0;
                for (const std::uint32_t q : p.neighbours) {
                    // A line where three meet is smoothed along itself.
                    const bool takes = points_[q].regions.size() >= p.regions.size() || p.regions.size() == 2;
                    mean += takes ? points_[q].at : Vec3(0.0);
                    count += takes ? 1U : 0U;
                }
                to.push_back(count > 1 ? kept(p, mean / static_cast<double>(count)) : p.at);
            }
            for (std::size_t p = 0; p < points_.size(); ++p) {
                points_[p].at = to[p];
            }
        }
        const std::vector<Vec3> normals = pointNormals();
        for (std::size_t p = 0; p < points_.size(); ++p) {
            toBorder(points_[p], normals[p]);
        }
    }

    // Half way back to their corners; false when they all are there.
    bool pullBack(const std::vector<std::array<std::uint32_t, 3>>& facets)
    {
        std::set<std::uint32_t> offenders;
        for (const auto& f : facets) {
            offenders.insert(f.begin(), f.end());
        }
        bool moved = false;
        for (const std::uint32_t p : offenders) {
            NetPoint& point = points_[p];
            const Vec3 corner(point.corner);
            moved = moved || point.at != corner;
            point.at = glm::distance(point.at, corner) < atCorner ? corner : 0.5 * (point.at + corner);
        }
        return moved;
    }

    Surfaces surfaces() const
    {
        Surfaces out;
        out.facets = facets_;
        for (const NetPoint& p : points_) {
            out.points.push_back(cells_.place(p.at));
        }
        return out;
    }

private:
    std::uint32_t numberOf(Index3 corner)
    {
        const std::size_t at = base::offsetOf(cells_.count() + 1, corner);
        if (number_[at] == noNode) {
            number_[at] = static_cast<std::uint32_t>(points_.size());
            points_.push_back({corner, Vec3(corner), {}, {}});
        }
        return number_[at];
    }

    // Between cell `n` and the next one along an axis. The diagonal alternates, as on a chess board.
    void addFace(Index3 n, Index3 next, int axis)
    {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        std::array<std::uint32_t, 4> q{};
        for (std::size_t c = 0; c < 4; ++c) {
            Index3 corner = next;
            corner[u] += c == 1 || c == 2 ? 1 : 0;
            corner[v] += c >= 2 ? 1 : 0;
            q[c] = numberOf(corner);
        }
        for (std::size_t c = 0; c < 4; ++c) {
            points_[q[c]].neighbours.push_back(q[(c + 1) % 4]);
            points_[q[c]].neighbours.push_back(q[(c + 3) % 4]);
        }
        const std::size_t turn = (next[u] + next[v]) % 2 == 0 ? 0 : 1;
        // Axes of a left hand turn the faces round.
        const bool left = glm::determinant(labels_.affine.linear) < 0.0;
        const std::uint8_t back = cells_.row(left ? next : n), front = cells_.row(left ? n : next);
        facets_.push_back({{q[turn], q[turn + 1], q[turn + 2]}, front, back});
        facets_.push_back({{q[turn], q[turn + 2], q[(turn + 3) % 4]}, front, back});
    }

    Vec3 kept(const NetPoint& p, Vec3 at) const
    {
        const Vec3 corner(p.corner);
        at = glm::clamp(at, corner - netReach, corner + netReach);
        for (int axis = 0; axis < 3; ++axis) {
            at[axis] = cells_.onFlatSide(axis, p.corner[axis]) ? corner[axis] : at[axis];
        }
        return at;
    }

    std::vector<Vec3> pointNormals() const
    {
        std::vector<Vec3> normals(points_.size(), Vec3(0.0));
        for (const auto& f : facets_) {
            const Vec3 a = points_[f.points[0]].at;
            const Vec3 n = glm::cross(points_[f.points[1]].at - a, points_[f.points[2]].at - a);
            for (const std::uint32_t p : f.points) {
                normals[p] += glm::dot(normals[p], n) < 0.0 ? -n : n;
            }
        }
        return normals;
    }

    int regionAtCells(Vec3 q) const { return regionAt(labels_, cells_.place(q)); }

    // Along the normal to where the tissue changes, where that is within reach.
    void toBorder(NetPoint& p, Vec3 normal) const
    {
        const double length = glm::length(normal);
        if (p.regions.size() != 2 || length == 0.0) {
            return;
        }
        Vec3 low = kept(p, p.at - netReach * normal / length), high = kept(p, p.at + netReach * normal / length);
        const int first = regionAtCells(low);
        if (first == regionAtCells(high)) {
            return;
        }
        for (int h = 0; h < netHalvings; ++h) {
            const Vec3 middle = 0.5 * (low + high);
            (regionAtCells(middle) == first ? low : high) = middle;
        }
        p.at = kept(p, 0.5 * (low + high));
    }

    const SmoothLabels& labels_;
    const Cells& cells_;
    std::vector<std::uint32_t> number_;  // of each corner's point
    std::vector<NetPoint> points_;
    std::vector<Surfaces::Facet> facets_;
};

// How many cells each cell is away from another region, by waves from the borders.
std::vector<int> depths(const Cells& cells)
{
    std::vector<int> depth(static_cast<std::size_t>(cells.at(cells.count() - 1)) + 1, -1);
    std::vector<Index3> wave;
    const auto eachNext = [](Index3 n, const auto& visit) {
        for (int side = 0; side < 6; ++side) {
            Index3 next = n;
            next[side / 2] += side % 2 == 0 ? -1 : 1;
            visit(next);
        }
    };
    volume::forEachIndex(Index3(0), cells.count() - 1, [&](Index3 n) {
        bool border = false;
        eachNext(n, [&](Index3 next) { border = border || cells.region(next) != cells.region(n); });
        if (border) {
            depth[cells.at(n)] = 0;
            wave.push_back(n);
        }
    });
    for (std::size_t i = 0; i < wave.size(); ++i) {
        const Index3 n = wave[i];
        eachNext(n, [&](Index3 next) {
            if (cells.has(next) && depth[cells.at(next)] < 0) {
                depth[cells.at(next)] = depth[cells.at(n)] + 1;
                wave.push_back(next);
            }
        });
    }
    return depth;
}

// The deepest cell of each piece.
void addSeeds(const Cells& cells, Surfaces& out)
{
    const std::vector<int> depth = depths(cells);
    std::vector<char> seen(depth.size(), 0);
    volume::forEachIndex(Index3(0), cells.count() - 1, [&](Index3 n) {
        if (cells.region(n) < 0 || seen[cells.at(n)] != 0) {
            return;
        }
        std::vector<Index3> piece{n};
        seen[cells.at(n)] = 1;
        Index3 deepest = n;
        for (std::size_t i = 0; i < piece.size(); ++i) {
            const Index3 cell = piece[i];
            deepest = depth[cells.at(cell)] > depth[cells.at(deepest)] ? cell : deepest;
            for (int side = 0; side < 6; ++side) {
                Index3 next = cell;
                next[side / 2] += side % 2 == 0 ? -1 : 1;
                if (cells.region(next) == cells.region(n) && seen[cells.at(next)] == 0) {
                    seen[cells.at(next)] = 1;
                    piece.push_back(next);
                }
            }
        }
        out.seeds.push_back({cells.place(Vec3(deepest) + 0.5), cells.row(n)});
    });
}

}  // namespace

Surfaces surfaceNets(const SmoothLabels& labels, double size, const CrossingFacets& crossing)
{
    const Cells cells(labels, size);
    Net net(labels, cells);
    net.smooth();
    Surfaces out = net.surfaces();
    for (int round = 0; round < pullRounds && net.pullBack(crossing(out)); ++round) {
        out = net.surfaces();
    }
    addSeeds(cells, out);
    return out;
}

}  // namespace palpate::reference
