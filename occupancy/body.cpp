#include <occupancy/body.h>

#include <glm/geometric.hpp>

#include <array>
#include <cstddef>

namespace palpate::occupancy {

namespace {

// The largest integer not above `g`, for |g| < 2^31. std::floor() is a call where a processor need not have SSE 4.1.
int floorOf(double g) noexcept
{
    const int i = static_cast<int>(g);
    return static_cast<double>(i) > g ? i - 1 : i;
}

// Displacements of the eight elements around a place, fetched once for all steps that stay between them.
class Corners {
public:
    explicit Corners(const Body& body) noexcept : body_(body) {}

    // Trilinear over the elements that are there [m].
    Vec3 displacement(Vec3 rest) noexcept { return displacement(rest, Vec3(0.0)); }
    // The same, and `elsewhere` where there are none.
    Vec3 displacement(Vec3 rest, Vec3 elsewhere) noexcept
    {
        const Vec3 g = (rest - body_.grid.origin) / body_.grid.spacing;
        const Index3 low(floorOf(g.x), floorOf(g.y), floorOf(g.z));
        if (!fetched_ || low != low_) {
            fetch(low);
        }
        return between(g - Vec3(low), elsewhere);
    }

private:
    void fetch(Index3 low) noexcept
    {
        low_ = low;
        fetched_ = true;
        const auto& grid = body_.grid;
        for (std::size_t corner = 0; corner < 8; ++corner) {
            const Index3 n = low + Index3(corner & 1, corner >> 1 & 1, corner >> 2);
            const bool inside = grid.contains(n);
            const std::size_t e = inside ? grid.offset(n) : 0;
            const bool there = inside && body_.solid[e] != 0;
            const Vec3 u = there ? Vec3(body_.u[e]) : Vec3(0.0);
            values_[corner] = {u.x, u.y, u.z, there ? 1.0 : 0.0};
        }
    }

    // Sums all four columns alike, in the order of the corners: what is not there adds zero.
    Vec3 between(Vec3 t, Vec3 elsewhere) const noexcept
    {
        const std::array<double, 2> x{1.0 - t.x, t.x}, y{1.0 - t.y, t.y}, z{1.0 - t.z, t.z};
        std::array<double, 4> sum{};
        for (std::size_t corner = 0; corner < 8; ++corner) {
            const double weight = x[corner & 1] * y[corner >> 1 & 1] * z[corner >> 2];
            for (std::size_t i = 0; i < 4; ++i) {
                sum[i] += weight * values_[corner][i];
            }
        }
        return sum[3] > 0.0 ? Vec3(sum[0], sum[1], sum[2]) / sum[3] : elsewhere;
    }

    const Body& body_;
    bool fetched_ = false;
    Index3 low_{0};
    std::array<std::array<double, 4>, 8> values_;  // u_x, u_y, u_z [m], 1; all zero where there is no element
};

// One point whose undeformed place is sought.
struct Search {
    Search(const Body& body, Vec3 point) noexcept : p(point), rest(point), corners(body)
    {
        const double h = body.grid.spacing;
        Vec3 start = p;
        double nearest = 4.0 * h * h;
        bool found = false;
        RestPositions restPosition(body.grid);
        body.map.visit(p - 0.5 * h, p + 0.5 * h, [&](Element e) {
            const Vec3 at = restPosition(e);
            const Vec3 away = p - (at + Vec3(body.u[e]));
            const double square = glm::dot(away, away);
            moved = moved || body.u[e] != Vec3f(0.0F);
            if (square < nearest) {
                nearest = square;
                start = at + away;
                shift = Vec3(body.u[e]);
                found = true;
            }
        });
        if (!found) {
            // Where tissue would be at rest and is not, as in a dent: by as much as that has moved away.
            shift = corners.displacement(p);
            moved = shift != Vec3(0.0);
            start = p - shift;
        }
        rest = moved ? start : p;
    }

    // Half a step keeps the iteration a contraction for gradients of u up to 3.
    void step() noexcept { rest += 0.5 * miss(); }

    // From where `rest` is seen to the point. Off the tissue, space goes along with what is next to it.
    Vec3 miss() noexcept
    {
        shift = corners.displacement(rest, shift);
        return p - shift - rest;
    }

    Vec3 p;
    Vec3 rest;
    Vec3 shift{0.0};
    bool moved = false;
    Corners corners;
};

// Step by step for all points: a step waits for the one before it, but not for those of other points.
void solve(std::span<Search> searches) noexcept
{
    constexpr int steps = 6;
    for (int i = 0; i < steps; ++i) {
        for (Search& s : searches) {
            if (s.moved) {
                s.step();
            }
        }
    }
}

}  // namespace

Vec3 displacementAt(const Body& body, Vec3 rest) noexcept
{
    return Corners(body).displacement(rest);
}

Vec3 restPoint(const Body& body, Vec3 p) noexcept
{
    Search search(body, p);
    solve({&search, 1});
    return search.rest;
}

Vec3 exactRestPoint(const Body& body, Vec3 p) noexcept
{
    constexpr int steps = 60;
    Search search(body, p);
    const double enough = 1e-3 * body.grid.spacing;
    for (int i = 0; i < steps && search.moved; ++i) {
        if (glm::length(search.miss()) < enough) {
            break;
        }
        search.step();
    }
    return search.rest;
}

double distance(const Body& body, Vec3 p) noexcept
{
    return body.surface.distance(restPoint(body, p));
}

Vec3 distanceDifference(const Body& body, Vec3 p, double h) noexcept
{
    const Vec3 x(h, 0, 0), y(0, h, 0), z(0, 0, h);
    std::array<Search, 6> searches{Search(body, p + x), Search(body, p - x), Search(body, p + y),
                                   Search(body, p - y), Search(body, p + z), Search(body, p - z)};
    solve(searches);
    const auto d = [&](std::size_t i) { return body.surface.distance(searches[i].rest); };
    return {d(0) - d(1), d(2) - d(3), d(4) - d(5)};
}

}  // namespace palpate::occupancy
