#include <apps/command.h>
#include <command/json.h>
#include <command/options.h>

#include <base/error.h>
#include <base/outputs.h>
#include <base/quantities.h>
#include <command/progress.h>
#include <planner/costs.h>
#include <planner/figures.h>
#include <planner/planner.h>
#include <session/open.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <memory>

namespace palpate::apps {

namespace {

using datasets::ModelLevel;
using planner::Plan;
using planner::PlanCandidate;

struct PlanArguments {
    std::string scene;
    std::string error = "3%", forceError, budget = "400us";
    double speed = 20;  // [mm/s]
    bool all = false;
    std::string costs;
    std::string json;
};

std::string verdict(const PlanCandidate& c, bool chosen)
{
    if (chosen) {
        return "chosen: the cheapest that holds both";
    }
    if (!c.tried) {
        return c.holdsBudget ? "not tried: no cheaper than the choice" : "not tried: over the budget";
    }
    if (c.holdsError) {
        return c.holdsBudget ? "holds both, dearer than the choice" : "over the budget";
    }
    return c.holdsBudget ? "over the error" : "over error and budget";
}

void printCandidates(const Plan& plan)
{
    fmt::print("{:<52} {:>9} {:>8} {:>8} {:>10}\n", "candidate", "nodes", "error", "force", "predicted");
    constexpr std::size_t maxUntried = 4;
    std::size_t untried = 0;
    for (std::size_t i = 0; i < plan.candidates.size(); ++i) {
        const PlanCandidate& c = plan.candidates[i];
        untried += c.tried ? 0U : 1U;
        if (!c.tried && untried > maxUntried) {
            continue;
        }
        const auto percent = [&](double value) { return c.tried ? fmt::format("{:.2f}%", value) : std::string("-"); };
        fmt::print("{:<52} {:>9} {:>8} {:>8} {:>7.0f} us  {}\n", c.name(), c.nodes, percent(c.error),
                   c.force ? percent(*c.force) : "-", c.microseconds, verdict(c, plan.choice == i));
    }
    if (untried > maxUntried) {
        fmt::print("and {} more that were not tried (--json has them all)\n", untried - maxUntried);
    }
}

// What a better one would cost, and what the choice does not do.
void printGivenUp(const Plan& plan, const PlanCandidate& c)
{
    fmt::print("gives up: {:.2f} % of the largest displacement near the tool, {:.2f} % over all tissue (rms)", c.error,
               c.rms);
    if (c.force) {
        fmt::print(", {:.2f} % of the force", *c.force);
    }
    fmt::print("\n");
    if (c.level != ModelLevel::elastic) {
        fmt::print("gives up: forces from the tissue's energy: they come from the contact laws alone\n");
    } else if (volume::isSmall(c.elastic.law) && plan.finiteReference) {
        fmt::print("gives up: finite strain, though {:.0f} % of local strain are reached: its errors above hold that in\n",
                   100.0 * plan.strain);
    }
}

void printToml(const PlanCandidate& c)
{
    fmt::print("\n[model]\nlevel = \"{}\"\n", name(c.level));
    if (c.level == ModelLevel::chainmail) {
        fmt::print("spacing_mm = {:g}\n", 1e3 * c.spacing);
    }
    if (c.level == ModelLevel::elastic) {
        fmt::print("\n[model.elastic]\nspacing_mm = {:g}\nwindow = {}\ncycles = {}\nstrain = \"{}\"\n",
                   1e3 * c.elastic.spacing, c.elastic.window, c.elastic.cycles,
                   volume::isSmall(c.elastic.law) ? "small" : "finite");
        if (!volume::isSmall(c.elastic.law)) {
            fmt::print("law = \"{}\"\n", volume::nameOf(c.elastic.law));
        }
    }
}

void printReference(const Plan& plan, const planner::PlanCosts& costs, const std::string& origin)
{
    fmt::print(
        "errors are worst values over a push and a drag, against {} strain solved on {} nodes of {:g} mm; local strain "
        "reaches {:.0f} %\n",
        plan.finiteReference ? "finite" : "small", plan.referenceNodes, 1e3 * plan.referenceSpacing, 100.0 * plan.strain);
    const auto& [small, finite, move, rest] = costs;
    fmt::print(
        "time is counted: {:g} ns per node and {:g} per node and cycle ({:g} and {:g} with finite strain), {:g} and {:g} "
        "per contact point ({:g} and {:g}), {:g} per node that ChainMail moves, {:g} us for the rest of a tick; {}\n",
        small.perSlot, small.perSlotCycle, finite.perSlot, finite.perSlotCycle, small.perContact, small.perContactCycle,
        finite.perContact, finite.perContactCycle, move, rest,
        origin.empty() ? "measured on a Zen 5 server core with AVX-512; 'palpate bench costs' measures yours" : origin);
}

void planScene(const PlanArguments& o)
{
    base::checkOutputs({o.json}, {o.scene, o.costs});
    planner::PlanRequest request;
    request.error = base::parseShare("--error", o.error);
    if (!o.forceError.empty()) {
        request.forceError = base::parseShare("--force-error", o.forceError);
    }
    request.budget = base::parseTime("--budget", o.budget);
    request.speed = 1e-3 * o.speed;
    request.all = o.all;
    if (!o.costs.empty()) {
        request.costs = planner::loadCosts(o.costs);
    }

    command::Progress progress(command::Progress::Clock::ticking);
    progress.show(o.scene + ": volume");
    session::SceneChanges changes;
    changes.model = "spring";  // the bodies are made here, one per spacing
    const auto model = session::openSession(o.scene, changes);
    const Plan plan = planner::planModel(model, request, [&](const std::string& what) { progress.show(what); });
    progress.clear();
    command::writeJson(o.json, planner::planFigures(o.scene, plan, request, o.costs));
    const bool tell = o.json != "-";
    if (tell) {
        printReference(plan, request.costs, o.costs);
        printCandidates(plan);
        std::fflush(stdout);
    }
    if (!plan.choice) {
        const PlanCandidate& c = plan.candidates[plan.nearest];
        throw base::error("{}: no model holds {:g} %{} in {:g} us; the nearest is {}: {:.2f} %{} in {:.0f} us", o.scene,
                          100.0 * request.error,
                          request.forceError ? fmt::format(" and {:g} % of the force", 100.0 * *request.forceError) : "",
                          1e6 * request.budget, c.name(), c.error,
                          !request.forceError ? ""
                          : c.force           ? fmt::format(" and {:.2f} % of the force", *c.force)
                                              : ", of the force not known,",
                          c.microseconds);
    }
    if (tell) {
        const PlanCandidate& c = plan.candidates[*plan.choice];
        fmt::print("\n{}: error {:.2f} %, {:.0f} us per tick\n", c.name(), c.error, c.microseconds);
        printGivenUp(plan, c);
        printToml(c);
    }
}

}  // namespace

void addPlan(CLI::App& app)
{
    auto o = std::make_shared<PlanArguments>();
    auto* command = app.add_subcommand("plan", "Choose the cheapest tissue model within an error and a time per tick");
    command->add_option("SCENE", o->scene, "Built-in scene, scene file (.toml) or volume (.vdb)")->required();
    command->add_option("--error", o->error, "Maximum error of the shape within 30 mm of the tool (rms), e.g. 3% or 0.03")
        ->capture_default_str();
    command->add_option("--force-error", o->forceError,
                        "Maximum error of the force, e.g. 5% or 0.05: only level elastic can hold it (default: no limit)");
    command->add_option("--budget", o->budget, "Maximum time per tick, e.g. 400us or 0.4ms")->capture_default_str();
    command::addNumber(*command, "--speed", o->speed, "Speed of the test push [mm/s]", 1e3 * planner::minPlanSpeed,
                       1e3 * planner::maxPlanSpeed);
    command->add_flag("--all", o->all, "Try every model within the budget, to see how much a better one costs");
    command
        ->add_option("--costs", o->costs,
                     "Costs of a tick on this machine, a file from palpate bench costs --json (default: built-in costs)")
        ->check(CLI::ExistingFile);
    command->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    command->final_callback([o] { planScene(*o); });
}

}  // namespace palpate::apps
