#pragma once

#include <planner/planner.h>

#include <nlohmann/json_fwd.hpp>

#include <string>

namespace palpate::planner {

/// What `palpate plan --json` gives: the keys of the choice, if there is one, what was asked for, and all candidates.
/// @param scene  as the user called it
/// @param costs  where request.costs come from; empty: they are built in
nlohmann::json planFigures(const std::string& scene, const Plan& plan, const PlanRequest& request,
                           const std::string& costs);

}  // namespace palpate::planner
