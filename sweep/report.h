#pragma once

#include <sweep/folder.h>

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <vector>

namespace palpate::sweep {

/// How strongly each axis acts on each output, by what the design allows: Sobol's indices (saltelli), Morris's effects
/// (morris), shares of the variance (a whole grid), else rank correlations.
/// {"method": .., "measures": [names of columns], "outputs": {OUTPUT: [{"axis": .., "values": [..]}]}}, strongest first.
nlohmann::json sensitivity(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows);

/// One page that needs nothing else: response curves with spread, maps over any two axes, sensitivity, the cases that
/// failed.
std::string sweepPage(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows);

}  // namespace palpate::sweep
