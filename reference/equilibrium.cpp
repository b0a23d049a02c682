#include <reference/equilibrium.h>

#include <base/folds.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>

namespace palpate::reference {

namespace {

constexpr double onMirror = 1e-6;     // mm
constexpr int maxSteps = 30;          // of Newton's method to one load,
constexpr int hopeSteps = 10;         // after which the residual
constexpr double hope = 0.1;          // is to be this fraction of the first at most
constexpr int maxLooks = 10;          // along one of them,
constexpr double goodSlope = 0.3;     // until the energy's slope is that fraction of the first
constexpr double maxGrowth = 1.5;     // of the residual
constexpr int maxNearby = 50;         // iterations with an old factor: a new one costs about as much
constexpr double nothing = 1e-9;      // residual of a body that no tool touches, by rounding [mN]
constexpr double linearBest = 1e-4;   // residual of a linear system at last,
constexpr double linearWorst = 1e-2;  // and at first

// The columns and rows of `free`, by number.
SymmetricMatrix reduced(const SymmetricMatrix& all, std::span<const std::uint32_t> free, std::span<const int> number,
                        std::span<const int> blocks)
{
    SymmetricMatrix part;
    part.start.push_back(0);
    for (const std::uint32_t c : free) {
        for (std::size_t k = all.start[c]; k < all.start[c + 1]; ++k) {
            const int r = number[static_cast<std::size_t>(all.row[k])];
            if (r >= 0) {
                part.row.push_back(r);
                part.value.push_back(all.value[k]);
            }
        }
        part.start.push_back(part.row.size());
    }
    part.blocks.assign(blocks.begin(), blocks.end());
    return part;
}

}  // namespace

Equilibrium::Equilibrium(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& o)
    : options(o), fem(mesh, materials, o), state(fem.size()), held(fem.size())
{
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        for (const std::uint32_t n : fem.faceNodes()[f]) {
            for (std::size_t c = 0; c < 3 && mesh.faces[f].held; ++c) {
                held[3 * n + c] = 1;
            }
        }
    }
    for (std::size_t n = 0; n < fem.nodes().size(); ++n) {
        for (std::size_t c = 0; c < 3; ++c) {
            if (options.mirrored[c] && std::abs(fem.nodes()[n][static_cast<int>(c)]) < onMirror) {
                held[3 * n + c] = 1;
            }
        }
    }
    drive(std::vector<char>(fem.size()));
}

void Equilibrium::drive(const std::vector<char>& prescribed)
{
    free.clear();
    driven.clear();
    blocks.clear();
    number.assign(fem.size(), -1);
    for (std::uint32_t i = 0; i < fem.size(); ++i) {
        if (prescribed[i] != 0 && held[i] == 0) {
            driven.push_back(i);
        } else if (held[i] == 0) {
            const bool sameNode = !free.empty() && i < fem.displacements() && free.back() / 3 == i / 3;
            number[i] = static_cast<int>(free.size());
            if (!sameNode) {
                blocks.push_back(number[i]);
            }
            free.push_back(i);
        }
    }
    blocks.push_back(static_cast<int>(free.size()));
    factor.reset();
}

void Equilibrium::evaluate()
{
    residual = fem.tissueForces(state);
    const std::vector<double> contact = fem.contactForces(state);
    std::transform(residual.begin(), residual.end(), contact.begin(), residual.begin(), std::plus<>());
    for (std::size_t i = 0; i < load.size(); ++i) {
        residual[i] -= load[i];
    }
}

// The shape functions' integrals over a tetrahedron are -1/20 of its volume at corners and 1/5 at the middles of edges.
void Equilibrium::weigh(const TetMesh& mesh, std::span<const double> densities, Vec3 acceleration)
{
    constexpr double millimetre = 1e-3, millinewton = 1e-3;
    using Key = std::array<std::int64_t, 3>;
    const auto keyOf = [](Vec3 mm) {
        constexpr double grain = 1e-5;  // mm
        return Key{std::llround(mm.x / grain), std::llround(mm.y / grain), std::llround(mm.z / grain)};
    };
    std::map<Key, std::size_t> nodeAt;
    for (std::size_t n = 0; n < fem.nodes().size(); ++n) {
        nodeAt.emplace(keyOf(fem.nodes()[n]), n);
    }
    load.assign(fem.displacements(), 0.0);
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        std::array<Vec3, 4> p;
        std::ranges::transform(mesh.tets[t], p.begin(), [&](std::uint32_t i) { return mesh.points[i]; });
        const double volume = glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), p[3] - p[0]) / 6.0;
        const Vec3 weight = volume * densities[mesh.tissue[t]] / millinewton * acceleration;
        for (std::size_t a = 0; a < 4; ++a) {
            for (std::size_t b = a; b < 4; ++b) {
                const std::size_t node = nodeAt.at(keyOf(0.5 * (p[a] + p[b]) / millimetre));
                for (int c = 0; c < 3; ++c) {
                    load[3 * node + static_cast<std::size_t>(c)] += (a == b ? -0.05 : 0.2) * weight[c];
                }
            }
        }
    }
}

// Of the part that ought to vanish.
double Equilibrium::unbalanced() const noexcept
{
    return std::sqrt(base::sumOf(free, [&](std::uint32_t i) { return residual[i] * residual[i]; }));
}

// Of the forces that hold the body.
double Equilibrium::holding() const noexcept
{
    double sum = 0.0;
    for (std::size_t i = 0; i < fem.displacements(); ++i) {
        sum += number[i] < 0 ? residual[i] * residual[i] : 0.0;
    }
    return std::sqrt(sum);
}

bool Equilibrium::finite() const noexcept
{
    return std::isfinite(unbalanced()) && std::isfinite(holding());
}

// Newton's step, which also takes what is prescribed all the way.
std::vector<double> Equilibrium::direction()
{
    const SymmetricMatrix all = fem.tangent(state);
    std::vector<double> step(state.size());
    for (std::size_t i = 0; i < driven.size(); ++i) {
        step[driven[i]] = goal[i] - state[driven[i]];
    }
    std::vector<double> image(state.size());
    all.multiply(step, image);
    std::vector<double> right(free.size());
    std::vector<double> x(free.size());
    for (std::size_t i = 0; i < free.size(); ++i) {
        right[i] = -residual[free[i]] - image[free[i]];
    }
    const SymmetricMatrix matrix = reduced(all, free, number, blocks);
    // As exact as the last step was good.
    const double fall = unbalanced() / std::max(lastUnbalanced_, 1e-300);
    const double fraction = std::clamp(fall * fall, linearBest, linearWorst);
    lastUnbalanced_ = unbalanced();
    if (!factor || !solveNearby(matrix, *factor, right, x, fraction, maxNearby)) {
        factor.reset();
        factor = std::make_unique<Factor>(matrix);
        solveNearby(matrix, *factor, right, x, fraction, maxNearby);
    }
    for (std::size_t i = 0; i < free.size(); ++i) {
        step[free[i]] = x[i];
    }
    return step;
}

// Slope of the energy along `step` [uJ].
double Equilibrium::slope(const std::vector<double>& step) const noexcept
{
    return base::sumOf(free, [&](std::uint32_t i) { return residual[i] * step[i]; });
}

// Goes along Newton's step to about where the energy is least: contact opens and closes along it. With pressures there is
// no energy to look at, but a residual that must not grow much.
bool Equilibrium::advance(const std::vector<double>& step)
{
    const bool minimum = options.elements == Elements::p2;
    const bool drives = std::any_of(driven.begin(), driven.end(), [&](std::uint32_t i) { return step[i] != 0.0; });
    const std::vector<double> start = state;
    const double before = minimum ? slope(step) : unbalanced();
    double low = 0.0;
    double slopeLow = before;
    double high = 1.0;
    double fraction = 1.0;
    for (int look = 0; look <= maxLooks; ++look) {
        for (std::size_t i = 0; i < state.size(); ++i) {
            state[i] = start[i] + fraction * step[i];
        }
        evaluate();
        if (!finite()) {
            high = fraction;
            fraction = 0.5 * (low + high);
            continue;
        }
        const double now = minimum ? slope(step) : unbalanced();
        if (drives || (minimum ? std::abs(now) <= goodSlope * std::abs(before) || (now < 0.0 && fraction == 1.0)
                               : now < maxGrowth * before)) {
            return true;
        }
        if (!minimum) {
            fraction *= 0.5;
        } else if (now > 0.0) {
            high = fraction;
            fraction = low + (high - low) * std::clamp(slopeLow / (slopeLow - now), 0.1, 0.9);
        } else {
            low = fraction;
            slopeLow = now;
            fraction = 0.5 * (low + high);
        }
    }
    if (minimum && low > 0.0) {
        return true;
    }
    state = start;
    evaluate();
    return false;
}

bool Equilibrium::find(double tolerance)
{
    fem.findContact(state);
    evaluate();
    const double first = unbalanced();
    for (int step = 0; finite(); ++step) {
        const auto there = [&](std::size_t i) { return state[driven[i]] == goal[i]; };
        std::size_t arrived = 0;
        while (arrived < driven.size() && there(arrived)) {
            ++arrived;
        }
        if (arrived == driven.size() && unbalanced() <= std::max(tolerance * holding(), nothing)) {
            return true;
        }
        if (step == maxSteps || (driven.empty() && step == hopeSteps && unbalanced() > hope * first)) {
            return false;
        }
        ++steps;
        // A step from an old factor may be too rough to go down at all.
        if (!advance(direction())) {
            factor.reset();
            lastUnbalanced_ = std::numeric_limits<double>::max();
            if (!advance(direction())) {
                return false;
            }
        }
        fem.findContact(state);
    }
    return false;
}

}  // namespace palpate::reference
