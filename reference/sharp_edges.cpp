#include <reference/sharp_edges.h>

#include <base/mapped.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <map>
#include <optional>

namespace palpate::reference {

namespace {

constexpr double inset = 1e-3;        // how far inside the body the regions on a side are read [voxels]
constexpr double shortestLine = 0.1;  // shorter ones are left out,
constexpr double shortestRing = 4.0;  // and so are such rings [voxels]
constexpr double same = 0.01;         // nearer points are one: lines so near would be edges of slivers [voxels]
constexpr int halvings = 40;

// Points in samples, and which are joined.
class LineGraph {
public:
    void join(Vec3 a, Vec3 b)
    {
        const std::size_t i = add(a), j = add(b);
        if (i != j && std::ranges::find(neighbours_[i], j) == neighbours_[i].end()) {
            neighbours_[i].push_back(j);
            neighbours_[j].push_back(i);
        }
    }

    // Takes the graph apart into lines between points where not just two edges meet, and rings.
    std::vector<std::vector<Vec3>> lines()
    {
        std::vector<std::vector<Vec3>> out;
        for (const bool rings : {false, true}) {
            for (std::size_t i = 0; i < points_.size(); ++i) {
                while ((rings || isCorner(i)) && !neighbours_[i].empty()) {
                    out.push_back(walk(i));
                }
            }
        }
        return out;
    }

    // Fixes what is a corner, before lines() takes edges away.
    void markCorners()
    {
        degree_.clear();
        degree_ = base::mapped<std::size_t>(neighbours_, &std::vector<std::size_t>::size);
    }

private:
    bool isCorner(std::size_t i) const { return degree_[i] != 2; }

    // Two points that should be one may fall into neighbouring keys.
    std::size_t add(Vec3 p)
    {
        const Index3 key(glm::round(p / same));
        for (int c = 0; c < 27; ++c) {
            const Index3 near = key + Index3(c % 3, c / 3 % 3, c / 9) - 1;
            if (const auto found = index_.find({near.x, near.y, near.z}); found != index_.end()) {
                return found->second;
            }
        }
        index_[{key.x, key.y, key.z}] = points_.size();
        points_.push_back(p);
        neighbours_.emplace_back();
        return points_.size() - 1;
    }

    std::vector<Vec3> walk(std::size_t from)
    {
        std::vector<Vec3> line{points_[from]};
        std::size_t at = from;
        do {
            const std::size_t next = neighbours_[at].back();
            neighbours_[at].pop_back();
            std::erase(neighbours_[next], at);
            at = next;
            line.push_back(points_[at]);
        } while (!isCorner(at) && !neighbours_[at].empty());
        return line;
    }

    std::map<std::array<int, 3>, std::size_t> index_;
    std::vector<Vec3> points_;
    std::vector<std::vector<std::size_t>> neighbours_;
    std::vector<std::size_t> degree_;
};

// Follows the borders on one flat side through a grid of squares: marching squares with any number of regions.
class SideTracer {
public:
    SideTracer(const SmoothLabels& labels, int side, LineGraph& graph)
        : labels_(labels), graph_(graph), axis_(side / 2), u_((axis_ + 1) % 3), v_((axis_ + 2) % 3)
    {
        at_ = side % 2 == 0 ? -0.5 : labels.size[axis_] - 0.5;
        // Odd, so that no corner of a square lies on a face between voxels, where flat borders are.
        nu_ = 2 * labels.size[u_] + 1;
        nv_ = 2 * labels.size[v_] + 1;
        for (int j = 0; j <= nv_; ++j) {
            for (int i = 0; i <= nu_; ++i) {
                region_.push_back(regionOf(node(i, j)));
            }
        }
    }

    void trace()
    {
        // The rim first: what is near to a corner of the body becomes one with it, and not the corner with that.
        for (int i = 0; i < nu_; ++i) {
            rim(i, 0, i + 1, 0);
            rim(i, nv_, i + 1, nv_);
        }
        for (int j = 0; j < nv_; ++j) {
            rim(0, j, 0, j + 1);
            rim(nu_, j, nu_, j + 1);
        }
        for (int j = 0; j < nv_; ++j) {
            for (int i = 0; i < nu_; ++i) {
                square(i, j);
            }
        }
    }

private:
    Vec3 node(int i, int j) const
    {
        Vec3 q(0.0);
        q[axis_] = at_;
        q[u_] = -0.5 + static_cast<double>(labels_.size[u_]) * i / nu_;
        q[v_] = -0.5 + static_cast<double>(labels_.size[v_]) * j / nv_;
        return q;
    }

    int regionAtNode(int i, int j) const { return region_[static_cast<std::size_t>(j * (nu_ + 1) + i)]; }

    int regionOf(Vec3 q) const
    {
        for (int a = 0; a < 3; ++a) {
            q[a] = std::clamp(q[a], -0.5 + inset, labels_.size[a] - 0.5 - inset);
        }
        return regionAt(labels_, labels_.affine.toPatient(Vec3(labels_.low) + q));
    }

    // Where the region changes between two nodes.
    std::optional<Vec3> crossing(int i, int j, int k, int l) const
    {
        const int first = regionAtNode(i, j);
        if (first == regionAtNode(k, l)) {
            return std::nullopt;
        }
        Vec3 a = node(i, j), b = node(k, l);
        for (int h = 0; h < halvings; ++h) {
            const Vec3 middle = 0.5 * (a + b);
            (regionOf(middle) == first ? a : b) = middle;
        }
        return 0.5 * (a + b);
    }

    void square(int i, int j)
    {
        std::vector<Vec3> found;
        const std::array<std::optional<Vec3>, 4> sides{crossing(i, j, i + 1, j), crossing(i, j, i, j + 1),
                                                       crossing(i + 1, j, i + 1, j + 1), crossing(i, j + 1, i + 1, j + 1)};
        Vec3 middle(0.0);
        for (const auto& p : sides) {
            if (p) {
                found.push_back(*p);
                middle += *p;
            }
        }
        if (found.size() == 2) {
            graph_.join(found[0], found[1]);
            return;
        }
        for (const Vec3 p : found) {
            graph_.join(p, middle / static_cast<double>(found.size()));
        }
    }

    // The side's own edge, as far as there is tissue along it.
    void rim(int i, int j, int k, int l)
    {
        const Vec3 change = crossing(i, j, k, l).value_or(node(k, l));
        if (regionAtNode(i, j) >= 0) {
            graph_.join(node(i, j), change);
        }
        if (regionAtNode(k, l) >= 0) {
            graph_.join(change, node(k, l));
        }
    }

    const SmoothLabels& labels_;
    LineGraph& graph_;
    int axis_, u_, v_;
    double at_ = 0;
    int nu_ = 0, nv_ = 0;      // squares along both directions of the side
    std::vector<int> region_;  // at the squares' corners, u fastest
};

double lengthOf(const std::vector<Vec3>& line)
{
    double length = 0.0;
    for (std::size_t i = 1; i < line.size(); ++i) {
        length += glm::distance(line[i - 1], line[i]);
    }
    return length;
}

// Makes one of the ends of lines that are shorter than this [samples], and takes them away.
void contractShort(std::vector<std::vector<Vec3>>& lines, double shortest)
{
    const auto isShort = [&](const std::vector<Vec3>& line) {
        return line.front() != line.back() && lengthOf(line) < shortest;
    };
    for (auto found = std::ranges::find_if(lines, isShort); found != lines.end();
         found = std::ranges::find_if(lines, isShort)) {
        const Vec3 from = found->back(), to = found->front();
        lines.erase(found);
        for (auto& line : lines) {
            line.front() = line.front() == from ? to : line.front();
            line.back() = line.back() == from ? to : line.back();
        }
    }
}

}  // namespace

std::vector<std::vector<Vec3>> sharpEdges(const SmoothLabels& labels, double shortest)
{
    LineGraph graph;
    for (int side = 0; side < 6; ++side) {
        if (labels.flat[static_cast<std::size_t>(side)]) {
            SideTracer(labels, side, graph).trace();
        }
    }
    graph.markCorners();
    auto lines = graph.lines();
    contractShort(lines, shortest);
    std::erase_if(lines, [](const std::vector<Vec3>& line) {
        return lengthOf(line) < (line.front() == line.back() ? shortestRing : shortestLine);
    });
    for (auto& line : lines) {
        for (Vec3& p : line) {
            p = labels.affine.toPatient(Vec3(labels.low) + p);
        }
    }
    return lines;
}

}  // namespace palpate::reference
