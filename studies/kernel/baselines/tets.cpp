#include <studies/kernel/baselines/tets.h>

#include <base/error.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace palpate::studies {

namespace {

constexpr double farthestMove = 0.9;  // of a corner to the surface, in spacings
constexpr double thinnest = 0.2;      // volume of a tetrahedron, as a fraction of that in a whole cell
constexpr int moveHalvings = 6;
constexpr int anchorCorners = 4;  // held corners with which a cell cannot swing

// Corners of a cell by number, x fastest: a tetrahedron in the middle, and one at each corner left.
constexpr std::array<std::array<int, 4>, 5> evenSplit{
    {{0, 3, 5, 6}, {0, 1, 3, 5}, {0, 3, 2, 6}, {0, 6, 4, 5}, {7, 6, 3, 5}}};
constexpr std::array<std::array<int, 4>, 5> oddSplit{
    {{1, 2, 4, 7}, {1, 2, 0, 4}, {1, 7, 3, 2}, {1, 4, 5, 7}, {2, 7, 6, 4}}};

Index3 cornerOf(int c)
{
    return {c & 1, (c >> 1) & 1, c >> 2};
}

double determinant(const std::vector<Vec3>& p, const std::array<std::uint32_t, 4>& t)
{
    return glm::dot(p[t[1]] - p[t[0]], glm::cross(p[t[2]] - p[t[0]], p[t[3]] - p[t[0]]));
}

// Builds a mesh step by step.
class Cutter {
public:
    Cutter(const volume::Tissue& tissue, const volume::NodeGrid& cells, double poissonCap)
        : cells_(cells), materials_(tissue.materialOn(cells)), poissonCap_(poissonCap)
    {
        mesh_.corners = {cells.size + 1, cells.origin - 0.5 * cells.spacing, cells.spacing};
        held_.assign(mesh_.corners.count(), 0);
        full_.assign(cells.count(), 0);
        modulus_ = tissue.youngsModulusOn(cells).values;
        const auto rows = tissue.tissueOn(cells);
        std::ranges::transform(rows, full_.begin(), [](std::uint8_t row) { return row != 0 ? 1 : 0; });
    }

    TetBody cut(const volume::DistanceField& surface)
    {
        hold();
        dropLoose();
        addPoints();
        addTets();
        moveToSurface(surface);
        return std::move(mesh_);
    }

private:
    bool full(Index3 c) const { return cells_.contains(c) && full_[cells_.offset(c)] != 0; }

    void hold()
    {
        bool any = false;
        int front = cells_.size.y, back = 0;
        volume::forEachIndex(Index3(0), cells_.size - 1, [&](Index3 c) {
            if (!full(c)) {
                return;
            }
            front = std::min(front, c.y);
            back = std::max(back, c.y + 1);
            if (materials_[cells_.offset(c)].fixed >= 0.5F) {
                any = true;
                holdFrom(c, c + 1);
            }
        });
        if (!any && back > 0) {
            holdFrom({0, back - static_cast<int>(onItsBack * (back - front)), 0}, mesh_.corners.size - 1);
        }
    }

    void holdFrom(Index3 low, Index3 high)
    {
        volume::forEachIndex(low, high, [&](Index3 n) { held_[mesh_.corners.offset(n)] = 1; });
    }

    // Keeps what is held, and what hangs on it face by face.
    void dropLoose()
    {
        std::vector<std::uint8_t> kept(full_.size(), 0);
        std::vector<Index3> open;
        const auto keep = [&](Index3 c) {
            if (full(c) && kept[cells_.offset(c)] == 0) {
                kept[cells_.offset(c)] = 1;
                open.push_back(c);
            }
        };
        volume::forEachIndex(Index3(0), cells_.size - 1, [&](Index3 c) {
            int held = 0;
            volume::forEachIndex(c, c + 1, [&](Index3 n) { held += held_[mesh_.corners.offset(n)] != 0 ? 1 : 0; });
            if (held >= anchorCorners) {
                keep(c);
            }
        });
        while (!open.empty()) {
            const Index3 c = open.back();
            open.pop_back();
            for (int axis = 0; axis < 3; ++axis) {
                Index3 step(0);
                step[axis] = 1;
                keep(c - step);
                keep(c + step);
            }
        }
        full_ = std::move(kept);
    }

    void addPoints()
    {
        number_.assign(mesh_.corners.count(), 0);
        volume::forEachIndex(Index3(0), mesh_.corners.size - 1, [&](Index3 n) {
            int around = 0;
            volume::forEachIndex(n - 1, n, [&](Index3 c) { around += full(c) ? 1 : 0; });
            if (around == 0) {
                return;
            }
            number_[mesh_.corners.offset(n)] = static_cast<std::uint32_t>(mesh_.points.size());
            mesh_.points.push_back(mesh_.corners.position(n));
            mesh_.held.push_back(held_[mesh_.corners.offset(n)]);
            mesh_.outer.push_back(around < 8 ? 1 : 0);
        });
    }

    void addTets()
    {
        volume::forEachIndex(Index3(0), mesh_.corners.size - 1, [&](Index3 c) {
            mesh_.first.push_back(static_cast<std::uint32_t>(mesh_.tets.size()));
            if (full(c)) {
                split(c);
            }
        });
        mesh_.first.push_back(static_cast<std::uint32_t>(mesh_.tets.size()));
    }

    void split(Index3 c)
    {
        const double e = static_cast<double>(modulus_[cells_.offset(c)]);
        const double nu = std::min(static_cast<double>(materials_[cells_.offset(c)].poissonRatio), poissonCap_);
        for (const auto& corners : (c.x + c.y + c.z) % 2 == 0 ? evenSplit : oddSplit) {
            std::array<std::uint32_t, 4> tet{};
            for (std::size_t i = 0; i < 4; ++i) {
                tet[i] = number_[mesh_.corners.offset(c + cornerOf(corners[i]))];
            }
            if (determinant(mesh_.points, tet) < 0.0) {
                std::swap(tet[2], tet[3]);
            }
            mesh_.add(tet, e, nu);
        }
    }

    void moveToSurface(const volume::DistanceField& surface)
    {
        std::vector<Vec3> way(mesh_.points.size(), Vec3(0.0));
        for (std::size_t p = 0; p < way.size(); ++p) {
            const double off = surface.distance(mesh_.points[p]);
            if (onSurface(p) && std::abs(off) < farthestMove * cells_.spacing) {
                way[p] = -off * surface.normal(mesh_.points[p]);
                mesh_.points[p] += way[p];
            }
        }
        dropFlat();
        // Points of thin tetrahedra go half of their way back, until none is thin.
        for (int i = 0; i <= moveHalvings; ++i) {
            const double fraction = i < moveHalvings ? 0.5 : 1.0;
            for (const auto& tet : mesh_.tets) {
                if (!thin(tet)) {
                    continue;
                }
                for (const std::uint32_t p : tet) {
                    mesh_.points[p] -= fraction * way[p];
                    way[p] -= fraction * way[p];
                }
            }
        }
    }

    bool onSurface(std::size_t p) const { return mesh_.outer[p] != 0 && mesh_.held[p] == 0; }

    bool thin(const std::array<std::uint32_t, 4>& tet) const
    {
        return determinant(mesh_.points, tet) < thinnest * cells_.spacing * cells_.spacing * cells_.spacing;
    }

    // Leaves out thin tetrahedra with all points on the surface. Points that have no other one are out of the body: held.
    void dropFlat()
    {
        std::size_t kept = 0;
        std::uint32_t next = 0;
        std::vector<std::uint8_t> used(mesh_.points.size(), 0);
        for (std::size_t c = 0; c + 1 < mesh_.first.size(); ++c) {
            const std::uint32_t from = next;
            next = mesh_.first[c + 1];
            mesh_.first[c] = static_cast<std::uint32_t>(kept);
            for (std::uint32_t t = from; t < next; ++t) {
                const auto tet = mesh_.tets[t];
                if (thin(tet) && std::ranges::all_of(tet, [&](std::uint32_t p) { return onSurface(p); })) {
                    continue;
                }
                std::ranges::for_each(tet, [&](std::uint32_t p) { used[p] = 1; });
                mesh_.tets[kept] = tet;
                mesh_.mu[kept] = mesh_.mu[t];
                mesh_.lambda[kept++] = mesh_.lambda[t];
            }
        }
        mesh_.first.back() = static_cast<std::uint32_t>(kept);
        mesh_.tets.resize(kept);
        mesh_.mu.resize(kept);
        mesh_.lambda.resize(kept);
        mesh_.inCell.resize(kept);
        std::iota(mesh_.inCell.begin(), mesh_.inCell.end(), 0U);
        for (std::size_t p = 0; p < used.size(); ++p) {
            mesh_.held[p] = used[p] != 0 ? mesh_.held[p] : 1;
        }
    }

    const volume::NodeGrid& cells_;
    std::vector<volume::CellMaterial> materials_;
    std::vector<float> modulus_;  // of what is in a cell [Pa]
    double poissonCap_;
    std::vector<std::uint8_t> full_;     // by cell
    std::vector<std::uint8_t> held_;     // by corner
    std::vector<std::uint32_t> number_;  // of the point at a corner
    TetBody mesh_;
};

// The best tetrahedron so far: the one whose least coordinate is largest.
struct Nearest {
    double least = -1e30;
    std::size_t tet = 0;
    std::array<double, 4> weights{};
};

void lookIn(const TetBody& mesh, Index3 cell, Vec3 rest, Nearest& best)
{
    const auto& g = mesh.corners;
    if (!g.contains(cell)) {
        return;
    }
    const std::size_t at = g.offset(cell);
    for (std::size_t i = mesh.first[at]; i < mesh.first[at + 1]; ++i) {
        const std::uint32_t t = mesh.inCell[i];
        const auto& p = mesh.tets[t];
        const Vec3 a = mesh.points[p[1]] - mesh.points[p[0]];
        const Vec3 b = mesh.points[p[2]] - mesh.points[p[0]];
        const Vec3 c = mesh.points[p[3]] - mesh.points[p[0]];
        const Vec3 off = (rest - mesh.points[p[0]]) / glm::dot(a, glm::cross(b, c));
        const double x = glm::dot(off, glm::cross(b, c));
        const double y = glm::dot(off, glm::cross(c, a));
        const double z = glm::dot(off, glm::cross(a, b));
        const double least = std::min({x, y, z, 1.0 - x - y - z});
        if (least > best.least) {
            best = {least, t, {1.0 - x - y - z, x, y, z}};
        }
    }
}

}  // namespace

bool TetBody::moves(std::size_t tet) const noexcept
{
    return std::ranges::any_of(tets[tet], [&](std::uint32_t p) { return held[p] == 0; });
}

void TetBody::add(const std::array<std::uint32_t, 4>& tet, double youngsModulus, double poisson)
{
    tets.push_back(tet);
    mu.push_back(youngsModulus / (2.0 * (1.0 + poisson)));
    lambda.push_back(youngsModulus * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)));
}

TetBody latticeTets(const volume::Tissue& tissue, const volume::DistanceField& surface, double spacing, double poissonCap,
                    std::size_t maxPoints)
{
    const auto cells = volume::coveringGrid(tissue.box(), spacing, 2.0 * spacing);
    base::failIf(cells.count() / 2 > maxPoints, "{} cells of {:g} mm: too many for {} points; take a larger spacing",
                 cells.count(), 1e3 * spacing, maxPoints);
    TetBody mesh = Cutter(tissue, cells, poissonCap).cut(surface);
    base::failIf(mesh.tets.empty(), "no cell of {:g} mm is half full of tissue and held; take a smaller spacing",
                 1e3 * spacing);
    base::failIf(mesh.points.size() > maxPoints, "{} points at {:g} mm: {} are the most; take a larger spacing",
                 mesh.points.size(), 1e3 * spacing, maxPoints);
    return mesh;
}

TetShape shapeOf(const TetBody& mesh, std::size_t tet)
{
    const auto& t = mesh.tets[tet];
    const auto edge = [&](std::size_t i) { return mesh.points[t[i]] - mesh.points[t[0]]; };
    const double six = determinant(mesh.points, t);
    TetShape shape;
    shape.volume = six / 6.0;
    shape.gradient[1] = glm::cross(edge(2), edge(3)) / six;
    shape.gradient[2] = glm::cross(edge(3), edge(1)) / six;
    shape.gradient[3] = glm::cross(edge(1), edge(2)) / six;
    shape.gradient[0] = -(shape.gradient[1] + shape.gradient[2] + shape.gradient[3]);
    return shape;
}

// lambda a b^T + mu (b a^T + a.b I), a and b the gradients.
std::array<std::array<Mat3, 4>, 4> stiffnessOf(const TetBody& mesh, std::size_t tet)
{
    const TetShape shape = shapeOf(mesh, tet);
    std::array<std::array<Mat3, 4>, 4> out;
    for (std::size_t i = 0; i < 4; ++i) {
        for (std::size_t j = 0; j < 4; ++j) {
            const Vec3 a = shape.gradient[i], b = shape.gradient[j];
            out[i][j] = shape.volume * (mesh.lambda[tet] * glm::outerProduct(a, b) +
                                        mesh.mu[tet] * (glm::outerProduct(b, a) + Mat3(glm::dot(a, b))));
        }
    }
    return out;
}

TetPlace placeOf(const TetBody& mesh, Vec3 rest)
{
    constexpr double inside = -1e-9;
    const auto& g = mesh.corners;
    const Index3 cell(glm::clamp(glm::floor((rest - g.origin) / g.spacing), Vec3(0.0), Vec3(g.size - 2)));
    Nearest best;
    lookIn(mesh, cell, rest, best);
    if (best.least < inside) {
        volume::forEachIndex(cell - 1, cell + 1, [&](Index3 c) { lookIn(mesh, c, rest, best); });
    }
    TetPlace place;
    if (best.least < -1e29) {
        return place;  // nothing is near
    }
    place.points = mesh.tets[best.tet];
    double sum = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
        place.weights[i] = std::max(best.weights[i], 0.0);
        sum += place.weights[i];
    }
    for (double& w : place.weights) {
        w /= sum;
    }
    return place;
}

}  // namespace palpate::studies
