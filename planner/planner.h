#pragma once

#include <chainmail/window_stack.h>
#include <datasets/scene.h>
#include <haptics/session_model.h>

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace palpate::planner {

/// What a tick of level `elastic` has to do: means over the ticks in contact.
struct TickWork {
    double slots = 0;     // nodes of all windows, rows filled up to whole vectors
    double cycles = 0;    // of relaxation
    double contacts = 0;  // points that a tool may press
};

/// What that takes under one law [ns]: slots (perSlot + cycles perSlotCycle) + contacts (perContact + cycles
/// perContactCycle).
struct LawCosts {
    double perSlot = 0;
    double perSlotCycle = 0;
    double perContact = 0;
    double perContactCycle = 0;
};

/// Time of the work [us].
double tickTime(const LawCosts& costs, const TickWork& work) noexcept;

/// One measured model.
struct TickSample {
    std::string name;
    TickWork work;
    bool finite = false;      // strain
    double microseconds = 0;  // mean
};

/// The costs, none negative, with the least sum of squared relative errors of the predicted times. Throws
/// std::runtime_error for fewer than four samples.
LawCosts fitCosts(std::span<const TickSample> samples);

/// Times ticks of the models that the planner chooses from, for the scene's own push with spheres of 5 and 10 mm radius.
/// `quick`: few of them. Cost: a minute or two, quick some seconds.
std::vector<TickSample> measureTicks(const haptics::SessionModel& model, bool quick,
                                     const std::function<void(const std::string& what)>& progress);

/// Nodes of the windows, rows filled up to whole vectors.
std::size_t slotsOf(const chainmail::WindowStack& stack) noexcept;

/// What a tick costs, by counts, of small strain and of neo-Hookean tissue: measured, see docs/accuracy.md; `palpate bench
/// costs` measures a machine's own. These are of one core of an x86-64 server of 2024 (Zen 5, AVX-512).
struct PlanCosts {
    LawCosts small{1.6, 8.8, 60, 105};
    LawCosts finite{7.0, 10.7, 43, 118};
    double nsPerMove = 230;  // per node that ChainMail moves
    double usPerTick = 20;   // collision, distances, forces and the rest of a tick [us]

    /// Of a law: a law of finite strain costs what neo-Hookean does, and more per node by its `work`.
    LawCosts of(const volume::Law& law) const noexcept;
};

/// Speeds of a test push [m/s]: a slower one takes memory and time for ticks in which nothing happens.
inline constexpr double minPlanSpeed = 1e-3, maxPlanSpeed = 1.0;

struct PlanRequest {
    double error = 0.03;               // of the shape near the tool, share that may not be passed: see PlanCandidate::error
    std::optional<double> forceError;  // of the force: only level `elastic` can hold it; nothing: any
    double budget = 4e-4;              // of a tick [s]
    double speed = 0.02;               // of the test pushes [m/s]
    bool all = false;  // try every candidate within the budget, also those that are no cheaper than the choice
    PlanCosts costs;
};

/// One model that may be chosen. Errors are worst over the looks of the test push.
struct PlanCandidate {
    datasets::ModelLevel level = datasets::ModelLevel::spring;
    datasets::ElasticSettings elastic;  // of level `elastic`
    double spacing = 0;                 // of level `chainmail` [m]
    std::size_t nodes = 0;              // of the windows
    std::size_t slots = 0;              // the same, rows filled up to whole vectors
    double meanCycles = 0;              // that a tick took; before it is tried, fewer than any took
    double touched = 0;                 // contact points, or moved nodes, per tick; before it is tried, fewer than any
    double microseconds = 0;            // predicted per tick
    bool tried = false;                 // false: no cheaper than the choice, or over the budget
    double rms = 0, near = 0;           // against the reference [%], see TrialErrors
    double error = 0;                   // predicted: `near`, and what the reference is off by itself [%]
    std::optional<double> force;        // [%]; nothing: the level's force does not come from its shape
    bool holdsError = false;
    bool holdsBudget = false;

    /// "elastic, 2 mm, window 15, 2 cycles"
    std::string name() const;
};

struct Plan {
    std::vector<PlanCandidate> candidates;  // by predicted time
    std::optional<std::size_t> choice;
    std::size_t nearest = 0;      // of those that were tried: over error and budget by the least factor
    double referenceSpacing = 0;  // [m]
    std::size_t referenceNodes = 0;
    double strain = 0;             // local, of the reference [-]
    bool finiteReference = false;  // errors are against finite strain
};

/// What the planner's references are off by themselves near the tool, against outside finite elements (`palpate accuracy`:
/// windows of 1 mm, 0.2 to 0.7 %) [%].
inline constexpr double referenceError = 0.5;

/// Strain beyond which small strain is no reference any more [-].
inline constexpr double largeStrain = 0.15;

/// Predicted time of a tick [us]: counts times costs, never a clock.
double predictedTime(const PlanCandidate& candidate, const PlanCosts& costs) noexcept;

/// Pushes the scene's own tool a short way into the tissue with one model after the other, against the converged solution
/// on the finest grid of the ladder. The next is always the one that may be the cheapest; it ends when none that is left
/// can be cheaper than the best that holds both error and budget, or when all are tried. Deterministic.
/// Throws std::runtime_error when there is no tissue under the entry. Cost: seconds to minutes.
Plan planModel(const haptics::SessionModel& model, const PlanRequest& request,
               const std::function<void(const std::string& what)>& progress);

}  // namespace palpate::planner
