#include <reference/solve.h>

#include <base/error.h>
#include <base/folds.h>
#include <base/mapped.h>
#include <base/units.h>
#include <reference/equilibrium.h>
#include <reference/groups.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

namespace palpate::reference {

namespace {

constexpr double newtonPer = 1e-3;    // of a mN
constexpr double pascalPer = 1e3;     // of a kPa
constexpr double joulePer = 1e-6;     // of a uJ
constexpr double coarse = 1e-3;       // residual while multipliers still move, at first,
constexpr double finer = 0.3;         // and from one update of theirs to the next
constexpr int maxUpdates = 10;        // of the multipliers
constexpr double sinks = 1e-4;        // how deep a tool may sink in, fraction of the way it has pressed
constexpr double stepOfRadius = 0.2;  // load step of a tool at the start of a way, in its radius, at most
constexpr double minStride = 0.02;    // and at least
constexpr int easySteps = 7;          // of Newton's method: the next load step may be longer
constexpr double shortest = 1e-4;     // fraction of a load that a step must take

void checkMesh(const TetMesh& mesh, std::span<const Material> materials, const SolveOptions& options)
{
    base::failIf(mesh.tets.empty(), "mesh: there are no tetrahedra");
    if (const auto worst = std::max_element(mesh.tissue.begin(), mesh.tissue.end()); *worst >= materials.size()) {
        throw base::error("mesh: tissue row {} of a table of {}", *worst, materials.size());
    }
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const Material& m = materials[i];
        const bool used = std::find(mesh.tissue.begin(), mesh.tissue.end(), i) != mesh.tissue.end();
        base::failIf(used && (!(m.youngsModulus > 0.0) || !(m.poisson > -1.0 && m.poisson < 0.5) ||
                              !(m.stiffening >= volume::minStiffening)),
                     "tissue row {}: Young's modulus {:g} kPa, Poisson's ratio {:g}, stiffening {:g}: "
                     "must be over 0, between -1 and 0.5, and not under {:g}",
                     i, 1e-3 * m.youngsModulus, m.poisson, m.stiffening, volume::minStiffening);
    }
    const auto& still = options.mirrored;
    const bool held = std::any_of(mesh.faces.begin(), mesh.faces.end(), [](const auto& f) { return f.held; });
    base::failIf(!held && !(still[0] && still[1] && still[2]), "mesh: no face is held: the body would fly away");
}

// Throws when tetrahedra that share no point, not even by others, are left over.
void checkOneBody(const TetMesh& mesh)
{
    Groups bodies(mesh.points.size());
    for (const auto& tet : mesh.tets) {
        for (const std::uint32_t p : tet) {
            bodies.join(p, tet[0]);
        }
    }
    std::size_t apart = 0;
    for (const auto& tet : mesh.tets) {
        apart += bodies.root(tet[0]) != bodies.root(mesh.tets.front()[0]) ? 1 : 0;
    }
    base::failIf(apart > 0, "mesh: {} of {} tetrahedra are not connected with the first one: keep one body", apart,
                 mesh.tets.size());
}

// Calls step(to) for shares of a load from 0 to 1, shorter where it fails; longer where it was `easy`.
// @param length  of the first step, and then of the next one
// @returns  how far it got
template <typename Step, typename Easy>
double takeSteps(double& length, int most, Step&& step, Easy&& easy)
{
    double done = 0.0;
    for (int count = 0; done < 1.0 && length >= shortest && count < most; ++count) {
        const double to = done + length > 1.0 - shortest ? 1.0 : done + length;
        if (step(to)) {
            done = to;
            length *= easy() ? 1.5 : 1.0;
        } else {
            length *= 0.5;
        }
    }
    return done;
}

}  // namespace

struct Solver::Impl {
    Impl(const TetMesh& m, std::span<const Material> materials, const SolveOptions& options)
        : mesh(m), body(mesh, materials, options)
    {
    }

    // The free face that is nearest to a point at rest: its normal, out of the body, and how deep the point is under it.
    struct Above {
        Vec3 normal{0.0};
        double depth = -std::numeric_limits<double>::infinity();  // [mm]
    };
    Above above(Vec3 p) const;
    Vec3 areaNormal(std::size_t face) const;
    Obstacle retreat(const Obstacle& from) const;
    double sunk(const Obstacle& at) const;
    bool balance(double depth, bool last);
    void extrapolate(const Obstacle& to);
    bool moveTool(const Obstacle& to, bool last);
    std::vector<double> prescribed(const Patch& patch);
    void say(double fraction) const;
    Vec3 force() const;

    TetMesh mesh;
    Equilibrium body;
    std::optional<Obstacle> tool;
    std::vector<double> lastChange;  // of the state, by the last step of the tool
    Vec3 lastWay{0.0};               // of the tool [mm]
    double stride = 0;               // of the tool, that Newton's method can be expected to follow [mm]
};

// Twice the face's area, out of the body [m^2].
Vec3 Solver::Impl::areaNormal(std::size_t face) const
{
    const auto& p = mesh.faces[face].points;
    return glm::cross(mesh.points[p[1]] - mesh.points[p[0]], mesh.points[p[2]] - mesh.points[p[0]]);
}

Solver::Impl::Above Solver::Impl::above(Vec3 p) const
{
    Above nearest;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        for (const std::uint32_t n : body.fem.faceNodes()[f]) {
            const Vec3 away = body.fem.nodes()[n] - p;
            if (body.fem.freeFaces()[f] != 0 && glm::length(away) < least) {
                least = glm::length(away);
                nearest.normal = glm::normalize(areaNormal(f));
                nearest.depth = std::copysign(least, glm::dot(away, nearest.normal));
            }
        }
    }
    return nearest;
}

// Where the tool is when it has just left the body at rest, straight out of the faces that it presses, or, where it lies
// under the surface altogether, of the one above it.
Obstacle Solver::Impl::retreat(const Obstacle& from) const
{
    Vec3 out(0.0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto& six = body.fem.faceNodes()[f];
        const bool in =
            std::any_of(six.begin(), six.end(), [&](std::uint32_t n) { return from.distance(body.fem.nodes()[n]) < 0.0; });
        if (in && body.fem.freeFaces()[f] != 0) {
            out += areaNormal(f);
        }
    }
    if (glm::length(out) == 0.0) {
        const Above face = above(from.centre);
        if (face.depth <= 0.0) {
            return from;
        }
        out = face.normal;
    }
    out = glm::normalize(out);
    double way = 0.0;
    const int spheres = 1 + static_cast<int>(std::ceil(2.0 * glm::length(from.shaft) / from.radius));
    for (int s = 0; s < spheres; ++s) {
        const Vec3 centre = from.centre + (static_cast<double>(s) / std::max(1, spheres - 1)) * from.shaft;
        for (const auto& six : body.fem.faceNodes()) {
            for (const std::uint32_t n : six) {
                const Vec3 d = body.fem.nodes()[n] - centre;
                const double along = glm::dot(d, out);
                const double across = glm::dot(d, d) - along * along;
                if (across < from.radius * from.radius) {
                    way = std::max(way, along + std::sqrt(from.radius * from.radius - across));
                }
            }
        }
    }
    return {from.centre + way * out, from.radius, from.shaft};
}

// How deep the tool's front lies in the body at rest.
double Solver::Impl::sunk(const Obstacle& at) const
{
    return at.radius + above(at.centre).depth;
}

// Equilibrium with the tool where it is; in between, the multipliers need only follow.
bool Solver::Impl::balance(double depth, bool last)
{
    double tolerance = coarse;
    for (int update = 0; update < maxUpdates; ++update, tolerance *= finer) {
        if (!body.find(std::max(tolerance, body.options.tolerance))) {
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
    const Vec3 way = to.centre - tool->centre;
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
    const double fraction = straight / glm::dot(lastWay, lastWay);
    for (std::size_t i = 0; i < body.state.size(); ++i) {
        body.state[i] += fraction * lastChange[i];
    }
    if (!(unbalanced() <= before)) {
        body.state = stay;
    }
}

// One load step; leaves everything as it was where it fails.
bool Solver::Impl::moveTool(const Obstacle& to, bool last)
{
    const std::vector<double> state = body.state;
    const std::vector<double> multipliers = body.fem.multipliers();
    body.fem.setObstacle(to);
    body.fem.stiffenContact(body.state);
    extrapolate(to);
    if (balance(std::max(sunk(to), sinks * to.radius), last)) {
        lastWay = to.centre - tool->centre;
        lastChange.resize(state.size());
        std::transform(body.state.begin(), body.state.end(), state.begin(), lastChange.begin(), std::minus<>());
        tool = to;
        return true;
    }
    body.state = state;
    body.factor.reset();
    body.fem.setMultipliers(multipliers);
    body.fem.setObstacle(*tool);
    body.fem.findContact(body.state);
    body.evaluate();
    return false;
}

// Frees all but what the patch drives; gives the goals of the state.
std::vector<double> Solver::Impl::prescribed(const Patch& patch)
{
    const auto rest = [&](std::uint32_t node) { return body.fem.nodes()[node] / units::mm; };
    std::vector<char> drives(body.fem.size());
    std::vector<double> goal(body.fem.size());
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto& six = body.fem.faceNodes()[f];
        if (body.fem.freeFaces()[f] == 0 ||
            !std::all_of(six.begin(), six.end(), [&](auto n) { return patch.in(rest(n)); })) {
            continue;
        }
        for (const std::uint32_t n : six) {
            const Vec3 u = units::mm * patch.u(rest(n));
            for (std::size_t c = 0; c < 3; ++c) {
                drives[3 * n + c] = patch.components[c] ? 1 : 0;
                goal[3 * n + c] = u[static_cast<int>(c)];
            }
        }
    }
    body.drive(drives);
    return goal;
}

void Solver::Impl::say(double fraction) const
{
    if (body.options.progress) {
        fmt::print(stderr, "load {:5.1f} %: {:.4f} N, {} Newton steps\n", 1e2 * fraction, glm::length(force()), body.steps);
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

double RigidTool::distance(Vec3 p) const noexcept
{
    return Obstacle{centre, radius, shaft}.distance(p);  // in whatever unit its lengths are
}

void Solver::press(const RigidTool& tool)
{
    Impl& s = *impl_;
    const Obstacle to{units::mm * tool.centre, units::mm * tool.radius, units::mm * tool.shaft};
    base::failIf(!s.body.driven.empty(), "tool: displacements are prescribed already: take a new solver");
    if (!s.tool || s.tool->radius != to.radius || s.tool->shaft != to.shaft) {
        s.tool = s.retreat(to);
        s.lastChange.clear();
        s.stride = stepOfRadius * to.radius;
    }
    const Vec3 from = s.tool->centre;
    const double way = glm::distance(from, to.centre);
    s.body.steps = 0;
    double length = s.stride / std::max(way, 1e-9);
    int before = 0;
    const double done = takeSteps(
        length, s.body.options.maxSteps,
        [&](double fraction) {
            before = s.body.steps;
            const bool moved = s.moveTool({from + fraction * (to.centre - from), to.radius, to.shaft}, fraction == 1.0);
            s.say(fraction);
            return moved;
        },
        [&] { return s.body.steps - before <= easySteps; });
    if (way > 0.0) {
        s.stride = std::clamp(length * way, minStride * to.radius, stepOfRadius * to.radius);
    }
    base::failIf(done < 1.0,
                 "tool: does not converge at {:.3f} mm of {:.3f} mm: press less deep, or make the elements smaller there",
                 done * way, way);
}

void Solver::prescribe(const Patch& patch)
{
    Impl& s = *impl_;
    s.tool.reset();
    s.body.fem.setObstacle({});
    s.body.fem.setMultipliers(std::vector<double>(s.body.fem.multipliers().size()));
    s.body.state.assign(s.body.fem.size(), 0.0);
    s.body.steps = 0;
    const std::vector<double> goal = s.prescribed(patch);
    base::failIf(s.body.driven.empty(), "patch: no free face lies in it: make it larger, or the elements smaller");
    double length = 1.0;
    const auto step = [&](double fraction) {
        const std::vector<double> state = s.body.state;

        s.body.goal = base::mapped<double>(s.body.driven, [&](std::uint32_t i) { return fraction * goal[i]; });
        if (s.body.find(s.body.options.tolerance)) {
            s.say(fraction);
            return true;
        }
        s.body.state = state;
        return false;
    };
    const double done = takeSteps(length, s.body.options.maxSteps, step, [] { return true; });
    if (done < 1.0) {
        const double largest = base::largestOf(goal, [](double g) { return std::abs(g); });
        throw base::error(
            "patch: does not converge at {:.3f} mm of {:.3f} mm: prescribe less, or make "
            "the elements smaller there",
            done * largest, largest);
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
        p *= units::mm;
    }
    std::vector<Vec3> u = impl_->body.fem.displacementAt(impl_->body.state, points);
    for (Vec3& v : u) {
        v /= units::mm;
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
