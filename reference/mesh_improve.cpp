#include <reference/mesh_improve.h>

#include <reference/mesh_quality.h>
#include <reference/mesh_swap.h>
#include <reference/surfaces.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace palpate::reference {

namespace {

constexpr int improvingRounds = 4;  // of swaps and moves,
constexpr int passes = 6;           // and of moves in each
constexpr double firstStep = 0.25;  // of the mean edge at a point,
constexpr double lastStep = 0.01;   // and where the search ends
constexpr double smooth = 0.9;      // cosine between a facet's normal and the mean, from which on a surface is smooth
constexpr double gain = 1e-3;       // least that a move has to bring [degrees]
constexpr int mostSteps = 1000;     // of one point at a time

// 6 along the axes, 8 along the diagonals.
std::vector<Vec3> directions()
{
    std::vector<Vec3> out;
    for (int i = 0; i < 27; ++i) {
        const Vec3 d(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
        const double square = glm::dot(d, d);
        if (square == 1.0 || square == 3.0) {
            out.push_back(glm::normalize(d));
        }
    }
    return out;
}

class Improver {
public:
    Improver(TetMesh& mesh, Moving moving) : mesh_(mesh), star_(mesh.points.size()), normal_(mesh.points.size(), Vec3(0.0))
    {
        fixed_.assign(mesh.points.size(), 0);
        for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
            for (const std::uint32_t p : mesh.tets[t]) {
                star_[p].push_back(t);
            }
        }
        readSurfaces(moving);
    }

    // Worst angle of a tetrahedron, from 0 or 180 degrees; negative where it is flipped.
    double worst(std::uint32_t tet) const { return worstDihedral(mesh_, mesh_.tets[tet]); }

    // Whether it is elsewhere now.
    bool move(std::uint32_t p)
    {
        if (fixed_[p] != 0) {
            return false;
        }
        const Vec3 before = mesh_.points[p];
        static const std::vector<Vec3> to = directions();
        double best = worstAround(p);
        const double edge = meanEdge(p);
        double step = firstStep;
        for (int i = 0; i < mostSteps && step > lastStep; ++i) {
            const Vec3 from = mesh_.points[p];
            Vec3 found = from;
            for (const Vec3 d : to) {
                const Vec3 along = onSurface(p, d);
                mesh_.points[p] = from + step * edge * along;
                const double now = worstAround(p, best + gain);
                if (now > best + gain) {
                    best = now;
                    found = mesh_.points[p];
                }
            }
            mesh_.points[p] = found;
            step *= found == from ? 0.5 : 1.0;
        }
        return mesh_.points[p] != before;
    }

private:
    // A point is free on a surface whose facets there all look nearly the same way, but for front and back. A facet without
    // area looks nowhere: its points stay.
    void readSurfaces(Moving moving)
    {
        const Surfaces surfaces = surfacesOf(mesh_, AllPoints::yes);
        const auto normalOf = [&](const Surfaces::Facet& f) {
            const Vec3 a = mesh_.points[f.points[0]];
            const Vec3 n = glm::cross(mesh_.points[f.points[1]] - a, mesh_.points[f.points[2]] - a);
            const double length = glm::length(n);
            return length > 0.0 ? n / length : Vec3(0.0);
        };
        for (const auto& f : surfaces.facets) {
            const Vec3 n = normalOf(f);
            for (const std::uint32_t p : f.points) {
                normal_[p] += glm::dot(normal_[p], n) < 0.0 ? -n : n;
            }
        }
        for (const auto& f : surfaces.facets) {
            const Vec3 n = normalOf(f);
            for (const std::uint32_t p : f.points) {
                const double length = glm::length(normal_[p]);
                const bool flat = length > 0.0 && std::abs(glm::dot(normal_[p], n)) >= smooth * length;
                fixed_[p] = fixed_[p] != 0 || moving == Moving::inner || !flat ? 1 : 0;
            }
        }
        for (Vec3& n : normal_) {
            const double length = glm::length(n);
            n = length > 0.0 ? n / length : n;
        }
    }

    Vec3 onSurface(std::uint32_t p, Vec3 d) const
    {
        const Vec3 n = normal_[p];
        return d - glm::dot(d, n) * n;
    }

    double meanEdge(std::uint32_t p) const
    {
        double sum = 0.0;
        for (const std::uint32_t t : star_[p]) {
            for (const std::uint32_t q : mesh_.tets[t]) {
                sum += glm::distance(mesh_.points[p], mesh_.points[q]);
            }
        }
        return sum / (3.0 * static_cast<double>(star_[p].size()));
    }

    // Of all tetrahedra at a point; stops where it is no more than `enough`.
    double worstAround(std::uint32_t p, double enough = -std::numeric_limits<double>::infinity()) const
    {
        double least = 180.0;
        for (const std::uint32_t t : star_[p]) {
            least = std::min(least, worst(t));
            if (least <= enough) {
                break;
            }
        }
        return least;
    }

    TetMesh& mesh_;
    std::vector<std::vector<std::uint32_t>> star_;  // tetrahedra at each point
    std::vector<Vec3> normal_;                      // of the surface at each point; nothing inside
    std::vector<char> fixed_;
};

void movePoints(TetMesh& mesh, double target, Moving moving)
{
    Improver improver(mesh, moving);
    std::vector<std::uint32_t> look(mesh.tets.size());
    std::iota(look.begin(), look.end(), 0U);
    for (int pass = 0; pass < passes && !look.empty(); ++pass) {
        std::vector<std::pair<double, std::uint32_t>> bad;
        for (const std::uint32_t t : look) {
            if (const double worst = improver.worst(t); worst < target) {
                bad.emplace_back(worst, t);
            }
        }
        std::ranges::sort(bad);
        look.clear();
        for (const auto& [angle, tet] : bad) {
            bool moved = false;
            for (const std::uint32_t p : mesh.tets[tet]) {
                moved = improver.move(p) || moved;
            }
            if (moved) {
                look.push_back(tet);
            }
        }
    }
}

}  // namespace

void improveAngles(TetMesh& mesh, double target, Moving moving)
{
    movePoints(mesh, target, moving);
    for (int round = 0; round < improvingRounds && swapBad(mesh, target) > 0; ++round) {
        movePoints(mesh, target, moving);
    }
}

}  // namespace palpate::reference
