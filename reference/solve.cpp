#include <reference/solve.h>

#include <reference/equilibrium.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>

namespace palpate::reference {

namespace {

constexpr double perMetre = 1e3;      // mm
constexpr double newtonPer = 1e-3;    // of a mN
constexpr double pascalPer = 1e3;     // of a kPa
constexpr double joulePer = 1e-6;     // of a uJ
constexpr double coarse = 1e-3;       // residual while multipliers still move
constexpr int mostUpdates = 10;       // of the multipliers
constexpr double sinks = 1e-4;        // how deep a sphere may sink in, share of the way it has pressed
constexpr double stepOfRadius = 0.2;  // load step of a sphere, in its radius
constexpr double shortest = 1e-4;     // share of a load that a step must take

void checkMesh(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options)
{
    if (mesh.tets.empty()) {
        throw std::runtime_error("mesh: there are no tetrahedra");
    }
    if (const auto worst = std::max_element(mesh.tissue.begin(), mesh.tissue.end()); *worst >= materials.size()) {
        throw std::runtime_error(fmt::format("mesh: tissue row {} of a table of {}", *worst, materials.size()));
    }
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const Material& m = materials[i];
        const bool used = std::find(mesh.tissue.begin(), mesh.tissue.end(), i) != mesh.tissue.end();
        if (used && (!(m.youngsModulus > 0.0) || !(m.poisson > -1.0 && m.poisson < 0.5) || !(m.stiffening >= 0.0))) {
            throw std::runtime_error(
                fmt::format("tissue row {}: Young's modulus {:g} kPa, Poisson's ratio {:g}, stiffening {:g}: "
                            "must be over 0, between -1 and 0.5, and not under 0",
                            i, 1e-3 * m.youngsModulus, m.poisson, m.stiffening));
        }
    }
    const auto& still = options.mirrored;
    const bool held = std::any_of(mesh.faces.begin(), mesh.faces.end(), [](const auto& f) { return f.held; });
    if (!held && !(still[0] && still[1] && still[2])) {
        throw std::runtime_error("mesh: no face is held: the body would fly away");
    }
}

// Throws when tetrahedra that share no point, not even by others, are left over.
void checkOneBody(const TetMesh& mesh)
{
    std::vector<std::uint32_t> group(mesh.points.size());
    std::iota(group.begin(), group.end(), 0U);
    const auto root = [&](std::uint32_t p) {
        while (group[p] != p) {
            p = group[p] = group[group[p]];
        }
        return p;
    };
    for (const auto& tet : mesh.tets) {
        for (const std::uint32_t p : tet) {
            group[root(p)] = root(tet[0]);
        }
    }
    std::size_t apart = 0;
    for (const auto& tet : mesh.tets) {
        apart += root(tet[0]) != root(mesh.tets.front()[0]) ? 1 : 0;
    }
    if (apart > 0) {
        throw std::runtime_error(fmt::format(
            "mesh: {} of {} tetrahedra do not hang together with the first one: keep one body", apart, mesh.tets.size()));
    }
}

}  // namespace

struct Solver::Impl {
    Impl(const TetMesh& m, std::span<const Material> materials, const SolveOptions& options)
        : mesh(m), body(mesh, materials, options)
    {
    }

    Obstacle retreat(const Obstacle& from) const;
    double sunk(const Obstacle& at) const;
    bool balance(double depth, bool last);
    void extrapolate(const Obstacle& to);
    bool moveSphere(const Obstacle& to, bool last);
    std::vector<double> prescribed(const Patch& patch);
    void say(double share) const;
    Vec3 force() const;

    TetMesh mesh;
    Equilibrium body;
    std::optional<Obstacle> sphere;
    std::vector<double> lastChange;  // of the state, by the last step of the sphere
    Vec3 lastWay{0.0};               // of the sphere [mm]
};

// Where the sphere is when it has just left the body at rest, straight out of the faces that it presses.
Obstacle Solver::Impl::retreat(const Obstacle& from) const
{
    Vec3 out(0.0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto& six = body.fem.faceNodes()[f];
        const bool in = std::any_of(six.begin(), six.end(), [&](std::uint32_t n) {
            return glm::distance(body.fem.nodes()[n], from.centre) < from.radius;
        });
        if (in && body.fem.freeFaces()[f] != 0) {
            const auto& p = mesh.faces[f].points;
            out += glm::cross(mesh.points[p[1]] - mesh.points[p[0]], mesh.points[p[2]] - mesh.points[p[0]]);
        }
    }
    if (glm::length(out) == 0.0) {
        return from;
    }
    out = glm::normalize(out);
    double way = 0.0;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        for (const std::uint32_t n : body.fem.faceNodes()[f]) {
            const Vec3 d = body.fem.nodes()[n] - from.centre;
            const double along = glm::dot(d, out);
            const double across = glm::dot(d, d) - along * along;
            if (across < from.radius * from.radius) {
                way = std::max(way, along + std::sqrt(from.radius * from.radius - across));
            }
        }
    }
    return {from.centre + way * out, from.radius};
}

// How deep the sphere lies in the body at rest.
double Solver::Impl::sunk(const Obstacle& at) const
{
    double deepest = 0.0;
    for (const auto& six : body.fem.faceNodes()) {
        for (const std::uint32_t n : six) {
            deepest = std::max(deepest, at.radius - glm::distance(body.fem.nodes()[n], at.centre));
        }
    }
    return deepest;
}

// Equilibrium with the sphere where it is; in between, the multipliers need only follow.
bool Solver::Impl::balance(double depth, bool last)
{
    for (int update = 0; update < mostUpdates; ++update) {
        if (!body.find(coarse)) {
            return false;
        }
        std::vector<double> before = body.fem.multipliers();
        const double deep = body.fem.updateMultipliers(body.state);
        if (!last) {
            return true;
        }
        if (deep <= sinks * depth) {
            body.fem.setMultipliers(std::move(before));
            return body.find(body.options.tolerance);
        }
    }
    return false;
}

// Goes on as in the last step, if that is nearer to equilibrium.
void Solver::Impl::extrapolate(const Obstacle& to)
{
    const Vec3 way = to.centre - sphere->centre;
    const double straight = glm::dot(way, lastWay);
    if (lastChange.empty() || straight <= 0.9 * glm::length(way) * glm::length(lastWay)) {
        return;
    }
    const auto unbalanced = [&] {
        body.fem.findContact(body.state);
        body.evaluate();
        return body.unbalanced();
    };
    const double before = unbalanced();
    const std::vector<double> stay = body.state;
    const double share = straight / glm::dot(lastWay, lastWay);
    for (std::size_t i = 0; i < body.state.size(); ++i) {
        body.state[i] += share * lastChange[i];
    }
    if (!(unbalanced() <= before)) {
        body.state = stay;
    }
}

// One load step; leaves everything as it was where it fails.
bool Solver::Impl::moveSphere(const Obstacle& to, bool last)
{
    const std::vector<double> state = body.state;
    const std::vector<double> multipliers = body.fem.multipliers();
    body.fem.setObstacle(to);
    extrapolate(to);
    if (balance(std::max(sunk(to), sinks * to.radius), last)) {
        lastWay = to.centre - sphere->centre;
        lastChange.resize(state.size());
        std::transform(body.state.begin(), body.state.end(), state.begin(), lastChange.begin(), std::minus<>());
        sphere = to;
        return true;
    }
    body.state = state;
    body.factor.reset();
    body.fem.setMultipliers(multipliers);
    body.fem.setObstacle(*sphere);
    body.fem.findContact(body.state);
    body.evaluate();
    return false;
}

// Frees all but what the patch drives; gives the goals of the state.
std::vector<double> Solver::Impl::prescribed(const Patch& patch)
{
    const auto rest = [&](std::uint32_t node) { return body.fem.nodes()[node] / perMetre; };
    std::vector<char> drives(body.fem.size());
    std::vector<double> goal(body.fem.size());
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto& six = body.fem.faceNodes()[f];
        if (body.fem.freeFaces()[f] == 0 ||
            !std::all_of(six.begin(), six.end(), [&](auto n) { return patch.in(rest(n)); })) {
            continue;
        }
        for (const std::uint32_t n : six) {
            const Vec3 u = perMetre * patch.u(rest(n));
            for (std::size_t c = 0; c < 3; ++c) {
                drives[3 * n + c] = patch.components[c] ? 1 : 0;
                goal[3 * n + c] = u[static_cast<int>(c)];
            }
        }
    }
    body.drive(drives);
    return goal;
}

void Solver::Impl::say(double share) const
{
    if (body.options.progress) {
        fmt::print(stderr, "load {:5.1f} %: {:.4f} N, {} Newton steps\n", 1e2 * share, glm::length(force()), body.steps);
    }
}

Vec3 Solver::Impl::force() const
{
    Vec3 sum(0.0);
    for (const std::uint32_t i : body.driven) {
        sum[static_cast<int>(i % 3)] -= body.residual[i];
    }
    const std::vector<double> forces = body.fem.contactForces(body.state);
    for (std::size_t i = 0; i < body.fem.displacements(); ++i) {
        sum[static_cast<int>(i % 3)] += forces[i];
    }
    return newtonPer * sum;
}

Solver::Solver(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options)
{
    checkMesh(mesh, materials, options);
    checkOneBody(mesh);
    impl_ = std::make_unique<Impl>(mesh, materials, options);
}

Solver::~Solver() = default;

namespace {

// Calls step(from, to) for shares of a load from 0 to 1, shorter where it fails.
// @returns  how far it got
template <typename Step>
double takeSteps(double first, int most, Step&& step)
{
    double done = 0.0;
    double length = first;
    for (int count = 0; done < 1.0 && length >= shortest && count < most; ++count) {
        const double to = done + length > 1.0 - shortest ? 1.0 : done + length;
        if (step(to)) {
            done = to;
            length *= 1.5;
        } else {
            length *= 0.5;
        }
    }
    return done;
}

}  // namespace

void Solver::press(const RigidSphere& sphere)
{
    Impl& s = *impl_;
    const Obstacle to{perMetre * sphere.centre, perMetre * sphere.radius};
    if (!s.body.driven.empty()) {
        throw std::runtime_error("sphere: displacements are prescribed already: take a new solver");
    }
    if (!s.sphere || s.sphere->radius != to.radius) {
        s.sphere = s.retreat(to);
        s.lastChange.clear();
    }
    const Vec3 from = s.sphere->centre;
    const double way = glm::distance(from, to.centre);
    s.body.steps = 0;
    const double first = std::min(1.0, stepOfRadius * to.radius / std::max(way, 1e-9));
    const double done = takeSteps(first, s.body.options.mostSteps, [&](double share) {
        const bool moved = s.moveSphere({from + share * (to.centre - from), to.radius}, share == 1.0);
        s.say(share);
        return moved;
    });
    if (done < 1.0) {
        throw std::runtime_error(fmt::format(
            "sphere: does not converge at {:.3f} mm of {:.3f} mm: press less deep, or make the elements smaller there",
            done * way, way));
    }
}

void Solver::prescribe(const Patch& patch)
{
    Impl& s = *impl_;
    s.sphere.reset();
    s.body.fem.setObstacle({});
    s.body.fem.setMultipliers(std::vector<double>(s.body.fem.multipliers().size()));
    s.body.state.assign(s.body.fem.size(), 0.0);
    s.body.steps = 0;
    const std::vector<double> goal = s.prescribed(patch);
    if (s.body.driven.empty()) {
        throw std::runtime_error("patch: no free face lies in it: make it larger, or the elements smaller");
    }
    const double done = takeSteps(1.0, s.body.options.mostSteps, [&](double share) {
        const std::vector<double> state = s.body.state;
        s.body.goal.clear();
        for (const std::uint32_t i : s.body.driven) {
            s.body.goal.push_back(share * goal[i]);
        }
        if (s.body.find(s.body.options.tolerance)) {
            s.say(share);
            return true;
        }
        s.body.state = state;
        return false;
    });
    if (done < 1.0) {
        double largest = 0.0;
        for (const double g : goal) {
            largest = std::max(largest, std::abs(g));
        }
        throw std::runtime_error(
            fmt::format("patch: does not converge at {:.3f} mm of {:.3f} mm: prescribe less, or make "
                        "the elements smaller there",
                        done * largest, largest));
    }
}

Vec3 Solver::force() const
{
    return impl_->force();
}

double Solver::energy() const
{
    return joulePer * impl_->body.fem.energy(impl_->body.state);
}

std::vector<Vec3> Solver::displacement(std::span<const Vec3> rest) const
{
    std::vector<Vec3> points(rest.begin(), rest.end());
    for (Vec3& p : points) {
        p *= perMetre;
    }
    std::vector<Vec3> u = impl_->body.fem.displacementAt(impl_->body.state, points);
    for (Vec3& v : u) {
        v /= perMetre;
    }
    return u;
}

std::vector<std::array<double, 6>> Solver::stress() const
{
    std::vector<std::array<double, 6>> stress = impl_->body.fem.meanStress(impl_->body.state);
    for (auto& s : stress) {
        for (double& v : s) {
            v *= pascalPer;
        }
    }
    return stress;
}

std::size_t Solver::unknowns() const
{
    return impl_->body.free.size();
}

int Solver::newtonSteps() const
{
    return impl_->body.steps;
}

}  // namespace palpate::reference
