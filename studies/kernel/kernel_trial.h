#pragma once

#include <chainmail/elastic.h>
#include <studies/kernel/trial_path.h>

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace palpate::studies {

/// The equilibrium under one pose's load.
struct ReferenceState {
    TrialPose pose;
    Vec3 focus{0.0};       // where the contact is, at rest [m]
    std::vector<Vec3f> u;  // displacement at Reference::position [m] (count x 3)
    Vec3 force{0.0};       // on the tool [N]
    double energy = 0;     // [J]
    double largest = 0;    // displacement of any node [m]
    double strain = 0;     // equivalent strain that a tenth of a millilitre of tissue exceeds [-]
    double residual = 0;   // fraction of the contacts' forces
    std::uint32_t sites = 0;
};

/// Every look of a path, solved to convergence on the whole grid: what errors are measured against.
struct Reference {
    std::vector<Vec3f> position;  // of tissue nodes that are free, at rest [m] (count x 3)
    std::vector<ReferenceState> states;
    std::size_t nodes = 0;  // of the grid
    double peakForce = 0;   // [N]
    double strain = 0;      // largest of any state [-]
    double residual = 0;    // worst of any state, fraction of the contacts' forces
};

/// The point itself, or where it lies outside the cells' staircase, the nearest one in a cell with tissue beside it [m].
Vec3 nearestTissue(const chainmail::CellLevel& level, Vec3 rest);
/// What is left of the residual, as a fraction of the contacts' forces.
double shareLeft(const chainmail::Elastic& elastic, const chainmail::ElasticResult& result);

/// A whole body in one window: every level covers all of it.
chainmail::ElasticOptions wholeGrid(int cycles, const volume::Law& law);

struct ReferenceOptions {
    volume::Law law = volume::SmallStrain{};
    double tolerance = 3e-5;                                              // residual, fraction of the contacts' forces
    int maxCycles = 200;                                                  // per look
    std::size_t maxPoints = std::numeric_limits<std::size_t>::max();      // of Reference::position: every n-th free node
    std::function<void(std::size_t look, std::size_t looks)> progress{};  // before each look, from 1; may throw to end it
};

/// Solves the looks of the path at all these speeds. Small strain is solved from rest at every look, so that no rounding is
/// carried along; finite strain from the look before. The body must outlive the call only. Cost: some 60 cycles over all
/// nodes per look.
Reference solveReference(const chainmail::ElasticBody& body, const TrialPath& path, std::span<const double> speeds,
                         const ReferenceOptions& options);

/// What a trial drives: anything that follows a load tick by tick.
struct TrialModel {
    std::function<chainmail::ElasticResult(const TrialLoad&)> tick;
    std::function<Vec3(Vec3)> displacement;  // of the material that is at rest there [m]
    std::function<Vec3()> force;             // on the tool [N]; none: the model has no force of its own
    std::function<std::size_t()> touched;    // contact points or moved nodes of the last tick; 0: it touched nothing
};

/// Windows around the tool, or the whole grid, by its options.
TrialModel elasticModel(chainmail::Elastic& elastic);
/// Tissue that does not move at all.
TrialModel nothingModel();

/// Errors at one look, in percent: of the largest displacement, of the force, of the energy.
struct TrialErrors {
    TrialPhase phase = TrialPhase::press;
    double rms = 0;     // over all free tissue nodes
    double near = 0;    // over those within 30 mm of the contact
    double max = 0;     // worst node
    double force = 0;   // vector; where the force is under 5 % of the path's peak, of those 5 %
    double energy = 0;  // by how much it is above the reference's
    double volume = 0;  // |J - J of the reference|, J = det(I + grad u), mean within 30 mm; not of a displacement but of 1
};

struct TrialResult {
    std::vector<TrialErrors> looks;
    double p50 = 0, p99 = 0;    // time of a tick in contact [s]
    double mean = 0;            // the same: a tick may need no cycle at all, so ratios are of means
    double cpu = 0;             // the same in this thread's processor time, which other programs do not lengthen [s]
    std::size_t ticks = 0;      // in contact
    double meanTouched = 0;     // contact points, or moved nodes, per tick in contact
    double meanCycles = 0;      // of relaxation, per tick in contact
    std::size_t shortened = 0;  // steps
    std::size_t windowMoves = 0;
};

/// Drives a model along the path, and measures its errors at the looks and its time in all other ticks. Throws
/// std::logic_error when the reference was not solved for this speed.
TrialResult runTrial(const TrialModel& model, const TrialPath& path, double speed, const Reference& reference);
/// The same against several references of one path, in one run: one result each, which differ in their looks only.
std::vector<TrialResult> runTrials(const TrialModel& model, const TrialPath& path, double speed,
                                   std::span<const Reference* const> references);

/// The times and counts alone.
TrialResult timeTrial(const TrialModel& model, const TrialPath& path, double speed);

/// Median and worst over looks of one figure. No numbers where one of the looks has none.
struct Spread {
    double median = 0;
    double worst = 0;  // of the largest size, with its sign
};
Spread spreadOf(std::span<const TrialErrors> looks, double TrialErrors::*figure);
/// Of the look at rest.
TrialErrors atRest(const TrialResult& result);

/// Median of values in any order; 0 of none, no number where one is none.
double median(std::vector<double> values);

/// What ticks take [s].
struct TickTimes {
    double p50 = 0, p99 = 0, max = 0;
};
/// Of times in any order; 0 of none.
TickTimes tickTimes(std::vector<double> seconds);

/// Time of one tick that is solved on the whole grid to a thousandth of the force, in the middle of the press.
struct FullSolve {
    double warm = 0;      // from the tick before: median of a few [s]
    double fromRest = 0;  // [s]
};
FullSolve fullSolve(const chainmail::ElasticBody& body, const TrialPath& path, double speed, const volume::Law& law);

inline constexpr double nearField = 30e-3;  // around the contact [m]

/// Mean gradient of u in a cube, by u at its corners, x fastest.
Mat3 meanGradient(const std::array<Vec3, 8>& u, double side);
/// |e| sqrt(2/3) of the strain e: the stretch of an incompressible bar with as much.
double equivalentStrain(const Mat3& gradient);
/// What a tenth of a millilitre exceeds, of the strains in cubes of one size.
double exceededStrain(std::vector<double> strains, double side);

/// Cubes between eight neighbours of the lattice that a reference's positions lie on. Without a lattice there are none.
struct PositionCells {
    double side = 0;                                    // [m]
    std::vector<std::array<std::uint32_t, 8>> corners;  // indices of positions, x fastest (count x 8)
};
PositionCells positionCells(std::span<const Vec3f> position);

/// Errors of displacements `u` at the reference's positions (count x 1) [m] and, where there is one, of a force on the
/// tool [N]. The energy is left at 0.
TrialErrors errorsOf(std::span<const Vec3> u, const std::optional<Vec3>& force, const Reference& reference,
                     const PositionCells& cells, const ReferenceState& state);

/// The state of a pose. Throws std::logic_error when the reference was not solved for it.
const ReferenceState& stateAt(const Reference& reference, TrialPose pose);

/// Errors of one reference against another at the looks of the path: what a law costs, whatever solves it. Throws
/// std::runtime_error when they do not have the same positions.
std::vector<TrialErrors> errorsBetween(const Reference& model, const Reference& reference, const TrialPath& path,
                                       double speed);

}  // namespace palpate::studies
