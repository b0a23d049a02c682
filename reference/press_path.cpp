#include <reference/press_path.h>

#include <base/mapped.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::reference {

using studies::ReferenceState;
using studies::TrialPose;

namespace {

constexpr double nearField = 30e-3;      // around the contact's path [m]
constexpr double nearSpacing = 2e-3;     // of the points in it [m]
constexpr int coarser = 3;               // how much wider they lie beyond
constexpr double depth = 0.5e-3;         // of the points under the surface, at least [m]
constexpr double strainedVolume = 1e-7;  // [m^3]

// Poses at which errors are measured, in the order in which the tool takes them.
std::vector<TrialPose> looksOf(const PressProblem& problem)
{
    std::vector<TrialPose> poses = problem.looks;
    if (!poses.empty()) {
        return poses;
    }
    for (const auto& tick : schedule(problem.path, problem.speed)) {
        if (tick.look && (poses.empty() || poses.back() != tick.pose)) {
            poses.push_back(tick.pose);
        }
    }
    return poses;
}

// First and last point of the surface that the tool presses on.
std::pair<Vec3, Vec3> contactEnds(const PressProblem& problem)
{
    studies::TrialLoad load(problem.path);
    load.set({problem.path.gap, 0.0});
    const Vec3 first = load.load().focus.point;
    load.set({problem.path.press, problem.path.drag});
    return {first, load.load().focus.point};
}

// ReferenceState::strain, among the cubes of the fine lattice.
double localStrain(const std::vector<Vec3f>& u, const studies::PositionCells& cells)
{
    std::vector<double> strains;
    for (const auto& corners : cells.corners) {
        std::array<Vec3, 8> at;
        std::ranges::transform(corners, at.begin(), [&](std::uint32_t c) { return Vec3(u[c]); });
        strains.push_back(studies::equivalentStrain(studies::meanGradient(at, cells.side)));
    }
    return studies::exceededStrain(std::move(strains), cells.side);
}

ReferenceState stateOf(const Solver& solver, const studies::TrialLoad& load, const std::vector<Vec3>& points,
                       const studies::PositionCells& cells)
{
    ReferenceState state;
    state.pose = load.pose();
    state.focus = load.load().focus.point;
    for (const Vec3 u : solver.displacement(points)) {
        state.u.emplace_back(u);
        state.largest = std::max(state.largest, glm::length(u));
    }
    state.force = solver.force();
    state.energy = solver.energy();
    state.strain = localStrain(state.u, cells);
    return state;
}

// Of the whole body, given that of one side of its planes of symmetry.
ReferenceState ofAll(ReferenceState part, const SolveOptions& options)
{
    for (int axis = 0; axis < 3; ++axis) {
        if (options.mirrored[static_cast<std::size_t>(axis)]) {
            part.force *= 2.0;
            part.force[axis] = 0.0;
            part.energy *= 2.0;
        }
    }
    return part;
}

}  // namespace

std::vector<Material> materialsOf(const PressProblem& problem, const BodyMesh& body)
{
    auto materials = base::mapped<Material>(problem.tissue.table().rows, [&](const auto& row) {
        return Material{row.youngsModulus, row.poissonRatio, row.stiffening};
    });
    materials.insert(materials.end(), body.mixtures.begin(), body.mixtures.end());
    for (Material& m : materials) {
        m.poisson = std::min(m.poisson, problem.poissonCap);
    }
    return materials;
}

std::vector<Vec3f> referencePoints(const PressProblem& problem)
{
    const auto [from, to] = contactEnds(problem);
    const auto box = problem.tissue.box();
    const volume::Tissue::Reader reader(problem.tissue);
    const auto& rows = problem.tissue.table().rows;
    std::vector<Vec3f> points;
    const Index3 low(glm::floor(box.low / nearSpacing)), high(glm::ceil(box.high / nearSpacing));
    volume::forEachIndex(low, high, [&](Index3 n) {
        const Vec3 p = nearSpacing * Vec3(n);
        const bool coarse = n.x % coarser == 0 && n.y % coarser == 0 && n.z % coarser == 0;
        if ((!coarse && distanceToLine(p, from, to) > nearField) || problem.surface.distance(p) > -depth) {
            return;
        }
        const auto& row = rows[reader.tissue(p)];
        if (!isHeld(row) && row.role != volume::Role::air) {
            points.emplace_back(p);
        }
    });
    return points;
}

MeshOptions meshOptions(const PressProblem& problem, double size)
{
    MeshOptions options;
    std::tie(options.from, options.to) = contactEnds(problem);
    options.size = size;
    // A shallow press touches less: of a half-space, a circle of radius sqrt(R depth).
    const double touched = std::sqrt(problem.path.tool.radius * (problem.path.press - problem.path.gap));
    options.radius = std::min(problem.path.tool.radius, 2.0 * touched);
    return options;
}

RigidTool toolAt(const PressProblem& problem, TrialPose pose)
{
    const auto& tool = problem.path.tool;
    return {problem.path.at(pose), tool.radius, -tool.length * problem.path.inward};
}

studies::Reference solvePath(const PressProblem& problem, const BodyMesh& body, const LookSink& sink)
{
    studies::Reference out;
    out.position = referencePoints(problem);
    const auto cells = studies::positionCells(out.position);
    const std::vector<Vec3> points(out.position.begin(), out.position.end());
    const auto materials = materialsOf(problem, body);
    Solver solver(body.mesh, materials, problem.solve);
    solver.press(toolAt(problem, {}));
    out.nodes = solver.unknowns() / 3;
    out.residual = problem.solve.tolerance;
    const auto poses = looksOf(problem);
    for (std::size_t look = 0; look < poses.size(); ++look) {
        studies::TrialLoad load(problem.path);
        load.set(poses[look]);
        solver.press(toolAt(problem, poses[look]));
        out.states.push_back(ofAll(stateOf(solver, load, points, cells), problem.solve));
        const ReferenceState& state = out.states.back();
        out.peakForce = std::max(out.peakForce, glm::length(state.force));
        out.strain = std::max(out.strain, state.strain);
        sink(solver, look, poses.size(), state);
    }
    return out;
}

}  // namespace palpate::reference
