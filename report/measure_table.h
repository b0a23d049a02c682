#pragma once

#include <report/groups.h>

#include <optional>
#include <string>
#include <vector>

namespace palpate::report {

/// A value of a measure; "-" where it is not finite.
std::string cell(double value, int decimals);

/// Cliff's delta with its sign; "-" where there is none.
std::string deltaText(const std::optional<double>& delta);

/// Measures down, columns across: a row for each of haptics::measures() that any column has. Ends without a line break.
/// @param columns  one for each head, with a text for each measure
std::string measureTable(const std::vector<std::string>& heads, const std::vector<std::vector<std::string>>& columns);

/// Medians and quartiles of groups, and Cliff's delta of each pair.
std::string groupTable(const std::vector<ScoredGroup>& groups);

}  // namespace palpate::report
