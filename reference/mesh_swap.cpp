#include <reference/mesh_swap.h>

#include <base/folds.h>
#include <reference/mesh_parts.h>
#include <reference/mesh_quality.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <iterator>
#include <optional>
#include <vector>

namespace palpate::reference {

namespace {

constexpr std::size_t maxAround = 10;  // tetrahedra at an edge that is removed
constexpr double leastGain = 1e-3;     // least that a change has to bring [degrees]
constexpr double unchanged = 1e-9;     // share by which the volume around a point inside the body may change, by rounding
constexpr double outsideChange =
    5e-3;  // six times the volume that one on the outside may change, in cubes of its longest edge

using Tet = std::array<std::uint32_t, 4>;

class Swapper {
public:
    explicit Swapper(TetMesh& mesh) : mesh_(mesh), star_(mesh.points.size())
    {
        for (std::uint32_t t = 0; t < mesh.tets.size(); ++t) {
            enter(t);
            ++count_[mesh.tissue[t]];
        }
    }

    std::vector<std::uint32_t> bad(double target) const
    {
        std::vector<std::pair<double, std::uint32_t>> found;
        for (std::uint32_t t = 0; t < mesh_.tets.size(); ++t) {
            if (const double angle = worst(mesh_.tets[t]); angle < target) {
                found.emplace_back(angle, t);
            }
        }
        std::ranges::sort(found);
        std::vector<std::uint32_t> out;
        std::ranges::transform(found, std::back_inserter(out), [](const auto& f) { return f.second; });
        return out;
    }

    // Whether something came of it. A tetrahedron that a change before this one took is no longer bad, or another.
    bool mend(std::uint32_t t, double target)
    {
        if (dead(t) || worst(mesh_.tets[t]) >= target) {
            return false;
        }
        const Tet tet = mesh_.tets[t];
        for (std::size_t i = 0; i < 4; ++i) {
            for (std::size_t j = 0; j < i; ++j) {
                if (removeEdge(tet[i], tet[j])) {
                    return true;
                }
            }
        }
        for (std::size_t side = 0; side < 4; ++side) {
            if (removeFace(t, side)) {
                return true;
            }
        }
        for (std::size_t i = 0; i < 12; ++i) {
            if (contract(tet[i / 3], tet[(i / 3 + 1 + i % 3) % 4])) {
                return true;
            }
        }
        return giveAway(t);
    }

    void finish()
    {
        std::size_t kept = 0;
        for (std::uint32_t t = 0; t < mesh_.tets.size(); ++t) {
            if (!dead(t)) {
                mesh_.tets[kept] = mesh_.tets[t];
                mesh_.tissue[kept++] = mesh_.tissue[t];
            }
        }
        mesh_.tets.resize(kept);
        mesh_.tissue.resize(kept);
    }

private:
    double worst(const Tet& t) const { return worstDihedral(mesh_, t); }
    bool dead(std::uint32_t t) const { return t < gone_.size() && gone_[t] != 0; }

    void enter(std::uint32_t t)
    {
        for (const std::uint32_t p : mesh_.tets[t]) {
            star_[p].push_back(t);
        }
    }

    // Puts `made`, which fill the same place, where `old` are.
    void replace(const std::vector<std::uint32_t>& old, const std::vector<Tet>& made)
    {
        const std::uint8_t tissue = mesh_.tissue[old.front()];
        count_[tissue] += made.size() - old.size();
        gone_.resize(mesh_.tets.size(), 0);
        for (const std::uint32_t t : old) {
            gone_[t] = 1;
            for (const std::uint32_t p : mesh_.tets[t]) {
                std::erase(star_[p], t);
            }
        }
        for (const Tet& tet : made) {
            mesh_.tets.push_back(tet);
            mesh_.tissue.push_back(tissue);
            gone_.push_back(0);
            enter(static_cast<std::uint32_t>(mesh_.tets.size() - 1));
        }
    }

    // Tetrahedra around an edge, and the points across from it in order, counterclockwise seen from `b`.
    struct Ring {
        std::vector<std::uint32_t> tets, points;
    };

    // Nothing where the edge is on a surface, or has too many tetrahedra.
    std::optional<Ring> ringOf(std::uint32_t a, std::uint32_t b) const
    {
        Ring ring;
        std::vector<std::array<std::uint32_t, 2>> across;
        for (const std::uint32_t t : star_[a]) {
            const Tet& tet = mesh_.tets[t];
            if (std::ranges::find(tet, b) == tet.end()) {
                continue;
            }
            const auto& corners = faceCorners[static_cast<std::size_t>(std::ranges::find(tet, a) - tet.begin())];
            std::size_t at = 0;
            while (tet[corners[at]] != b) {
                ++at;
            }
            across.push_back({tet[corners[(at + 1) % 3]], tet[corners[(at + 2) % 3]]});
            ring.tets.push_back(t);
            if (ring.tets.size() > maxAround || mesh_.tissue[t] != mesh_.tissue[ring.tets.front()]) {
                return std::nullopt;
            }
        }
        for (std::uint32_t p = across.front()[0]; ring.points.size() < across.size();) {
            ring.points.push_back(p);
            const auto next = std::ranges::find(across, p, [](const auto& e) { return e[0]; });
            if (next == across.end()) {
                return std::nullopt;
            }
            p = (*next)[1];
        }
        return ring;
    }

    double worstOf(const std::vector<std::uint32_t>& tets) const
    {
        double least = 180.0;
        for (const std::uint32_t t : tets) {
            least = std::min(least, worst(mesh_.tets[t]));
        }
        return least;
    }

    // Triangulates the ring so that the worst angle of what its triangles make with both ends is largest.
    bool removeEdge(std::uint32_t a, std::uint32_t b)
    {
        const auto ring = ringOf(a, b);
        if (!ring || ring->points.size() < 3) {
            return false;
        }
        const auto& p = ring->points;
        const std::size_t count = p.size();
        const double enough = worstOf(ring->tets) + leastGain;
        // Of the polygon from one point to another: the best worst angle, and the third point of the triangle at its chord.
        std::array<std::array<double, maxAround>, maxAround> best{};
        std::array<std::array<std::size_t, maxAround>, maxAround> third{};
        for (std::size_t length = 1; length < count; ++length) {
            for (std::size_t i = 0; i + length < count; ++i) {
                const std::size_t j = i + length;
                best[i][j] = length == 1 ? 180.0 : -1.0;
                for (std::size_t k = i + 1; k < j; ++k) {
                    double angle = std::min(best[i][k], best[k][j]);
                    if (angle > std::max(best[i][j], enough)) {
                        angle = std::min({angle, worst({a, p[i], p[k], p[j]}), worst({b, p[i], p[j], p[k]})});
                    }
                    if (angle > best[i][j]) {
                        best[i][j] = angle;
                        third[i][j] = k;
                    }
                }
            }
        }
        if (best[0][count - 1] <= enough) {
            return false;
        }
        std::vector<Tet> made;
        std::vector<std::array<std::size_t, 2>> chords{{0, count - 1}};
        while (!chords.empty()) {
            const auto [i, j] = chords.back();
            chords.pop_back();
            if (j - i > 1) {
                const std::size_t k = third[i][j];
                made.push_back({a, p[i], p[k], p[j]});
                made.push_back({b, p[i], p[j], p[k]});
                chords.push_back({i, k});
                chords.push_back({k, j});
            }
        }
        replace(ring->tets, made);
        return true;
    }

    // The tetrahedron on the other side of a face; itself where there is none.
    std::uint32_t beyond(std::uint32_t t, std::size_t side) const
    {
        const auto& c = faceCorners[side];
        const Tet& tet = mesh_.tets[t];
        for (const std::uint32_t other : star_[tet[c[0]]]) {
            const auto has = [&](std::size_t corner) {
                return std::ranges::find(mesh_.tets[other], tet[c[corner]]) != mesh_.tets[other].end();
            };
            if (other != t && has(1) && has(2)) {
                return other;
            }
        }
        return t;
    }

    // Three tetrahedra around the line between the points across from a face, in place of the two at it.
    bool removeFace(std::uint32_t t, std::size_t side)
    {
        const std::uint32_t other = beyond(t, side);
        if (other == t || mesh_.tissue[other] != mesh_.tissue[t]) {
            return false;
        }
        const Tet& tet = mesh_.tets[t];
        const std::uint32_t a = tet[side];
        const auto& c = faceCorners[side];
        const std::array<std::uint32_t, 3> face{tet[c[0]], tet[c[1]], tet[c[2]]};
        const auto across = [&](std::uint32_t p) { return p != face[0] && p != face[1] && p != face[2]; };
        const std::uint32_t b = *std::ranges::find_if(mesh_.tets[other], across);
        std::vector<Tet> made;
        double least = 180.0;
        for (std::size_t i = 0; i < 3; ++i) {
            made.push_back({a, b, face[i], face[(i + 1) % 3]});
            least = std::min(least, worst(made.back()));
        }
        if (least <= worstOf({t, other}) + leastGain) {
            return false;
        }
        replace({t, other}, made);
        return true;
    }

    // Tissues at a point, or with `q` at an edge, and whether it is on the outside: as bits.
    std::bitset<257> tissuesAt(std::uint32_t p, std::uint32_t q) const
    {
        std::bitset<257> out;
        for (const std::uint32_t t : star_[p]) {
            const Tet& tet = mesh_.tets[t];
            if (std::ranges::find(tet, q) == tet.end()) {
                continue;
            }
            out.set(mesh_.tissue[t]);
            for (std::size_t side = 0; side < 4 && !out.test(256); ++side) {
                out.set(256, tet[side] != p && tet[side] != q && beyond(t, side) == t);
            }
        }
        return out;
    }

    std::vector<std::uint32_t> neighbours(std::uint32_t p, std::uint32_t q) const
    {
        std::vector<std::uint32_t> out;
        for (const std::uint32_t t : star_[p]) {
            if (std::ranges::find(mesh_.tets[t], q) != mesh_.tets[t].end()) {
                std::ranges::copy_if(mesh_.tets[t], std::back_inserter(out), [&](auto r) { return r != p && r != q; });
            }
        }
        std::ranges::sort(out);
        out.erase(std::unique(out.begin(), out.end()), out.end());
        return out;
    }

    // Puts `p` where `q` is, with which it shares all its tissues, so that the tetrahedra at their edge are no more; not
    // where a tissue might end so.
    bool contract(std::uint32_t p, std::uint32_t q)
    {
        const auto tissues = tissuesAt(p, p);
        if (tissues != tissuesAt(p, q)) {
            return false;
        }
        const auto of = neighbours(p, p), its = neighbours(q, q);
        std::vector<std::uint32_t> common;
        std::ranges::set_intersection(of, its, std::back_inserter(common));
        if (common != neighbours(p, q)) {
            return false;
        }
        const double enough = worstOf(star_[p]) + leastGain;
        double before = 0.0, after = 0.0;
        std::vector<std::uint32_t> lost, kept;
        for (const std::uint32_t t : star_[p]) {
            Tet tet = mesh_.tets[t];
            before += sixVolumes(mesh_, t);
            const bool at = std::ranges::find(tet, q) != tet.end();
            (at ? lost : kept).push_back(t);
            if (!at) {
                std::ranges::replace(tet, p, q);
                if (worst(tet) <= enough) {
                    return false;
                }
                after += sixVolumes(mesh_, tet);
            }
        }
        const double longest =
            base::largestOf(of, [&](std::uint32_t r) { return glm::distance(mesh_.points[p], mesh_.points[r]); });
        const double most = tissues.test(256) ? outsideChange * longest * longest * longest : unchanged * before;
        if (std::abs(after - before) > most) {
            return false;
        }
        if (std::ranges::any_of(lost, [&](auto t) { return count_[mesh_.tissue[t]] <= lost.size(); })) {
            return false;
        }
        gone_.resize(mesh_.tets.size(), 0);
        for (const std::uint32_t t : lost) {
            gone_[t] = 1;
            --count_[mesh_.tissue[t]];
            for (const std::uint32_t r : mesh_.tets[t]) {
                std::erase(star_[r], t);
            }
        }
        for (const std::uint32_t t : kept) {
            std::ranges::replace(mesh_.tets[t], p, q);
            star_[q].push_back(t);
        }
        star_[p].clear();
        return true;
    }

    // To the tissue that two faces or more part it from, the one with the largest faces; not the last of its tissue.
    bool giveAway(std::uint32_t t)
    {
        const std::uint8_t tissue = mesh_.tissue[t];
        std::array<int, 4> same{};
        std::array<double, 4> area{};
        std::array<std::uint8_t, 4> beside{};
        for (std::size_t side = 0; side < 4; ++side) {
            const std::uint32_t other = beyond(t, side);
            beside[side] = other == t ? tissue : mesh_.tissue[other];
        }
        std::size_t to = 4;
        for (std::size_t side = 0; side < 4; ++side) {
            for (std::size_t i = 0; i < 4; ++i) {
                if (beside[i] == beside[side]) {
                    const auto& c = faceCorners[i];
                    const auto at = [&](std::size_t corner) { return mesh_.points[mesh_.tets[t][c[corner]]]; };
                    area[side] += 0.5 * glm::length(glm::cross(at(1) - at(0), at(2) - at(0)));
                    ++same[side];
                }
            }
            if (beside[side] != tissue && same[side] >= 2 && (to == 4 || area[side] > area[to])) {
                to = side;
            }
        }
        if (to == 4 || count_[tissue] < 2) {
            return false;
        }
        --count_[tissue];
        ++count_[beside[to]];
        mesh_.tissue[t] = beside[to];
        return true;
    }

    TetMesh& mesh_;
    std::vector<std::vector<std::uint32_t>> star_;  // tetrahedra at each point
    std::vector<char> gone_;                        // of each tetrahedron; those at the end that have none are there
    std::array<std::size_t, 256> count_{};          // tetrahedra of each tissue
};

}  // namespace

std::size_t swapBad(TetMesh& mesh, double target)
{
    Swapper swapper(mesh);
    const auto changes = static_cast<std::size_t>(
        std::ranges::count_if(swapper.bad(target), [&](std::uint32_t t) { return swapper.mend(t, target); }));
    swapper.finish();
    dropUnusedPoints(mesh);
    return changes;
}

}  // namespace palpate::reference
