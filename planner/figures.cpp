#include <planner/figures.h>

#include <base/mapped.h>

#include <nlohmann/json.hpp>

namespace palpate::planner {

using datasets::ModelLevel;

namespace {

nlohmann::json candidateFigures(const PlanCandidate& c)
{
    const bool elastic = c.level == ModelLevel::elastic;
    nlohmann::json out{{"level", name(c.level)},
                       {"spacing_mm", 1e3 * (elastic ? c.elastic.spacing : c.spacing)},
                       {"windows", nlohmann::json::array()},
                       {"sweeps", elastic ? c.elastic.cycles : 0},
                       {"strain", elastic && !volume::isSmall(c.elastic.law) ? "finite" : "small"},
                       {"law", elastic ? nlohmann::json(volume::nameOf(c.elastic.law)) : nlohmann::json()},
                       {"nodes", c.nodes},
                       {"slots", c.slots},
                       {"cycles", c.meanCycles},
                       {"touched", c.touched},
                       {"tried", c.tried},
                       {"predicted_us", c.microseconds},
                       {"holds_budget", c.holdsBudget}};
    if (elastic) {
        out["windows"].push_back(c.elastic.window);
    }
    if (c.tried) {
        out["predicted_error_pct"] = c.error;
        out["rms_pct"] = c.rms;
        out["near_pct"] = c.near;
        out["force_pct"] = nullptr;
        out["holds_error"] = c.holdsError;
    }
    if (c.force) {
        out["force_pct"] = *c.force;
    }
    return out;
}

}  // namespace

nlohmann::json planFigures(const std::string& scene, const Plan& plan, const PlanRequest& request, const std::string& costs)
{
    const auto candidates = base::mapped<nlohmann::json>(plan.candidates, candidateFigures);
    nlohmann::json out = plan.choice ? candidateFigures(plan.candidates[*plan.choice]) : nlohmann::json::object();
    out["scene"] = scene;
    out["found"] = plan.choice.has_value();
    out["error_pct"] = 100.0 * request.error;
    out["budget_us"] = 1e6 * request.budget;
    out["costs"] = costs.empty() ? "built in" : costs;
    out["reference_spacing_mm"] = 1e3 * plan.referenceSpacing;
    out["reference_nodes"] = plan.referenceNodes;
    out["reference_strain"] = plan.finiteReference ? "finite" : "small";
    out["local_strain"] = plan.strain;
    out["candidates"] = candidates;
    return out;
}

}  // namespace palpate::planner
