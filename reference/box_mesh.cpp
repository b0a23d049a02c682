#include <reference/box_mesh.h>

#include <base/error.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <ranges>

namespace palpate::reference {

namespace {

using Corners = std::array<std::uint32_t, 8>;

// Six tetrahedra about the diagonal from corner 0 to corner 7 of a brick, its corners x fastest.
void addBrick(const Corners& corner, std::uint8_t tissue, TetMesh& mesh)
{
    constexpr std::array<std::array<std::size_t, 4>, 6> tets{
        {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
    for (const auto& t : tets) {
        mesh.tets.push_back({corner[t[0]], corner[t[1]], corner[t[2]], corner[t[3]]});
        mesh.tissue.push_back(tissue);
    }
}

// Faces of one tetrahedron only.
void findFaces(const std::function<bool(Vec3)>& held, TetMesh& mesh)
{
    // Opposite to each point, counterclockwise seen from outside.
    constexpr std::array<std::array<std::size_t, 3>, 4> sides{{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};
    std::map<std::array<std::uint32_t, 3>, TetMesh::Face> once;
    for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
        for (const auto& side : sides) {
            const auto& tet = mesh.tets[t];
            const std::array<std::uint32_t, 3> points{tet[side[0]], tet[side[1]], tet[side[2]]};
            std::array<std::uint32_t, 3> key = points;
            std::sort(key.begin(), key.end());
            if (!once.emplace(key, TetMesh::Face{points, t, false}).second) {
                once.erase(key);
            }
        }
    }
    for (auto& [key, face] : once) {
        const Vec3 sum = mesh.points[key[0]] + mesh.points[key[1]] + mesh.points[key[2]];
        face.held = held && held(sum / 3.0);
        mesh.faces.push_back(face);
    }
}

// A block of bricks between `size` + 1 points along each axis; `point` gives the number of a corner.
template <typename Point, typename Tissue>
void addBlock(Index3 size, Point&& point, Tissue&& tissue, TetMesh& mesh)
{
    volume::forEachIndex(Index3(0), size - 1, [&](Index3 at) {
        Corners corner{};
        for (int c = 0; c < 8; ++c) {
            corner[static_cast<std::size_t>(c)] = point(at + Index3(c & 1, (c >> 1) & 1, c >> 2));
        }
        addBrick(corner, tissue(corner), mesh);
    });
}

// Points of several blocks, the same where they are nearer than a millionth of `side`.
class SharedPoints {
public:
    SharedPoints(double side, TetMesh& mesh) : step_(1e-6 * side), mesh_(mesh) {}

    std::uint32_t add(Vec3 p)
    {
        const std::array<long, 3> key{std::lround(p.x / step_), std::lround(p.y / step_), std::lround(p.z / step_)};
        const auto [found, isNew] = known_.emplace(key, static_cast<std::uint32_t>(mesh_.points.size()));
        if (isNew) {
            mesh_.points.push_back(p);
        }
        return found->second;
    }

private:
    double step_;
    TetMesh& mesh_;
    std::map<std::array<long, 3>, std::uint32_t> known_;
};

void turnPositive(TetMesh& mesh)
{
    for (auto& t : mesh.tets) {
        const Vec3 a = mesh.points[t[0]];
        if (glm::dot(glm::cross(mesh.points[t[1]] - a, mesh.points[t[2]] - a), mesh.points[t[3]] - a) < 0.0) {
            std::swap(t[2], t[3]);
        }
    }
}

}  // namespace

std::vector<double> gradedCells(double low, double fineTo, double high, double fine, double growth)
{
    base::failIf(!(low <= fineTo && fineTo <= high && low < high && fine > 0.0 && growth >= 1.0),
                 "cells of {:g} mm from {:g} to {:g} mm, fine up to {:g} mm, growing {:g} times: not a way to divide it",
                 1e3 * fine, 1e3 * low, 1e3 * high, 1e3 * fineTo, growth);
    std::vector<double> ends{low};
    const int even = static_cast<int>(std::ceil((fineTo - low) / fine - 1e-9));
    std::ranges::transform(std::views::iota(1, even + 1), std::back_inserter(ends),
                           [&](int i) { return low + (fineTo - low) * i / even; });
    if (high - fineTo < 1e-9 * (high - low)) {
        return ends;
    }
    std::vector<double> grown{0.0};
    for (double length = fine * growth; grown.back() < high - fineTo; length *= growth) {
        grown.push_back(grown.back() + length);
    }
    for (std::size_t i = 1; i < grown.size(); ++i) {
        ends.push_back(fineTo + (high - fineTo) * grown[i] / grown.back());
    }
    return ends;
}

std::vector<double> gradedDown(double low, double fineFrom, double high, double fine, double growth)
{
    std::vector<double> ends = gradedCells(-high, -fineFrom, -low, fine, growth);
    std::reverse(ends.begin(), ends.end());
    for (double& e : ends) {
        e = -e;
    }
    return ends;
}

TetMesh boxMesh(const std::vector<double>& x, const std::vector<double>& y, const std::vector<double>& z,
                const BoxMeshOptions& options)
{
    TetMesh mesh;
    const Index3 points(static_cast<int>(x.size()), static_cast<int>(y.size()), static_cast<int>(z.size()));
    volume::forEachIndex(Index3(0), points - 1, [&](Index3 at) {
        mesh.points.emplace_back(x[static_cast<std::size_t>(at.x)], y[static_cast<std::size_t>(at.y)],
                                 z[static_cast<std::size_t>(at.z)]);
    });
    const auto number = [&](Index3 at) { return static_cast<std::uint32_t>(at.x + points.x * (at.y + points.y * at.z)); };
    const auto tissue = [&](const Corners& corner) {
        return options.tissue ? options.tissue(0.5 * (mesh.points[corner[0]] + mesh.points[corner[7]])) : std::uint8_t{0};
    };
    addBlock(points - 1, number, tissue, mesh);
    findFaces(options.held, mesh);
    return mesh;
}

TetMesh ballInBox(double radius, double side, int cells)
{
    TetMesh mesh;
    SharedPoints shared(side, mesh);
    const double inner = 0.45 * radius;
    addBlock(
        Index3(cells), [&](Index3 at) { return shared.add(inner / cells * Vec3(at)); },
        [](const Corners&) { return std::uint8_t{1}; }, mesh);
    // Shells over the three far faces of the cube: `at.z` goes outwards, to the sphere and on to the box.
    const int toSphere = cells;
    const int toBox = std::max(2, static_cast<int>(std::ceil(1.5 * cells * std::log(side / radius) / std::log(2.0))));
    for (int axis = 0; axis < 3; ++axis) {
        const auto point = [&](Index3 at) {
            Vec3 cube(1.0);
            cube[(axis + 1) % 3] = static_cast<double>(at.x) / cells;
            cube[(axis + 2) % 3] = static_cast<double>(at.y) / cells;
            // Even angles, so that no brick is much larger than another.
            const Vec3 even(std::tan(0.25 * M_PI * cube.x), std::tan(0.25 * M_PI * cube.y), std::tan(0.25 * M_PI * cube.z));
            const Vec3 onSphere = radius * glm::normalize(even);
            if (at.z <= toSphere) {
                const double t = static_cast<double>(at.z) / toSphere;
                return shared.add((1.0 - t) * inner * cube + t * onSphere);
            }
            const double t =
                (std::pow(side / radius, static_cast<double>(at.z - toSphere) / toBox) - 1.0) / (side / radius - 1.0);
            return shared.add((1.0 - t) * onSphere + t * side * even);
        };
        const auto tissue = [&](const Corners& corner) {
            Vec3 middle(0.0);
            for (const std::uint32_t c : corner) {
                middle += mesh.points[c] / 8.0;
            }
            return static_cast<std::uint8_t>(glm::length(middle) < 0.98 * radius ? 1 : 0);
        };
        addBlock(Index3(cells, cells, toSphere + toBox), point, tissue, mesh);
    }
    turnPositive(mesh);
    findFaces({}, mesh);
    return mesh;
}

TetMesh discInSlab(const DiscInSlab& shape)
{
    TetMesh mesh;
    SharedPoints shared(shape.fine, mesh);
    const double inner = 0.5 * shape.radius;
    // Corners on the edge a little outside, so that the polygon has the disc's area.
    const double angle = 0.25 * M_PI / shape.around;
    const double edge = shape.radius * std::sqrt(angle / std::sin(angle));
    const std::vector<double> z = gradedDown(-shape.thickness, -shape.fineTo, 0.0, shape.fine, shape.growth);
    std::vector<double> out = gradedDown(inner, shape.radius, shape.radius, shape.fine, shape.growth);
    const auto toEdge = static_cast<int>(out.size()) - 1;
    const std::vector<double> beyond = gradedCells(shape.radius, shape.radius, shape.side, shape.fine, shape.growth);
    out.insert(out.end(), beyond.begin() + 1, beyond.end());
    const auto deep = static_cast<int>(z.size()) - 1;
    const auto none = [](const Corners&) { return std::uint8_t{0}; };
    const auto height = [&](int k) { return z[static_cast<std::size_t>(k)]; };
    const auto square = [&](int i) { return inner * i / shape.around; };
    addBlock(
        Index3(shape.around, shape.around, deep),
        [&](Index3 at) {
            return shared.add({square(at.x), square(at.y), height(at.z)});
        },
        none, mesh);
    for (int axis = 0; axis < 2; ++axis) {
        const auto point = [&](Index3 at) {
            const double t = static_cast<double>(at.x) / shape.around;
            const double turn = 0.25 * M_PI * t;
            Vec3 onSquare(1.0, t, 0.0);
            Vec3 onCircle(std::cos(turn), std::sin(turn), 0.0);
            Vec3 onSide(1.0, std::tan(turn), 0.0);
            const double r = out[static_cast<std::size_t>(at.y)];
            const double in = (r - inner) / (shape.radius - inner);
            const double beyondEdge = (r - shape.radius) / (shape.side - shape.radius);
            Vec3 p = at.y <= toEdge ? (1.0 - in) * inner * onSquare + in * edge * onCircle
                                    : (1.0 - beyondEdge) * edge * onCircle + beyondEdge * shape.side * onSide;
            if (axis == 1) {
                std::swap(p.x, p.y);
            }
            return shared.add({p.x, p.y, height(at.z)});
        };
        addBlock(Index3(shape.around, static_cast<int>(out.size()) - 1, deep), point, none, mesh);
    }
    turnPositive(mesh);
    findFaces([&](Vec3 p) { return p.z < -shape.thickness + 1e-3 * shape.fine; }, mesh);
    return mesh;
}

}  // namespace palpate::reference
