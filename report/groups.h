#pragma once

// A page that compares groups of sessions, measure by measure.

#include <haptics/measures.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate::report {

/// Sessions of one kind of trainee.
struct ScoredGroup {
    std::string name;
    std::vector<std::vector<double>> sessions;  // a row each: its values in the order of haptics::measures()
};

/// A row of a group.
std::vector<double> rowOf(const haptics::Score& score);

/// Of the sessions that have the measure. Infinite is a value: the targeting error of a session that never fired.
std::vector<double> valuesOf(const ScoredGroup& group, const haptics::Measure& measure);

/// With which groups give a measure, and to which they compare it.
int decimalsOf(const haptics::Measure& measure) noexcept;

/// The value below which a fraction of the values lies, straight between neighbours; not a number without values. Infinity
/// sorts last: the targeting error of a session that never fired is worse than any other.
double quantile(std::vector<double> values, double fraction);

/// How much more often a value of `a` is above one of `b` than below it, -1 to 1. It needs no distribution.
/// Source: N. Cliff, "Dominance statistics: ordinal analyses to answer ordinal questions", Psychological Bulletin 114,
/// 1993.
/// @pre  neither is empty
double cliffsDelta(const std::vector<double>& a, const std::vector<double>& b);

/// Cliff's delta of one group over another. Values that are the same as printed are ties. Nothing where a group has less
/// than two values, or all values of both are infinite.
std::optional<double> effectSize(const ScoredGroup& a, const ScoredGroup& b, const haptics::Measure& measure);

/// "median (low to high)" of a median and quartiles as printed; "-" where none of them is a number.
std::string quartilesText(const std::string& median, const std::string& low, const std::string& high);

/// The comparison as part of a page: heading, what the drawings mean, a table.
/// @pre  at least one group; every row is whole
std::string groupsPart(const std::vector<ScoredGroup>& groups);

/// Writes the page: every session as a dot on a common axis, medians and quartiles of each group, Cliff's delta of the
/// first group over the others. Measures that are the same in all sessions, as printed, are only named. Needs no other
/// file. Throws std::runtime_error.
void writeGroupReport(const std::filesystem::path& html, const std::vector<ScoredGroup>& groups);

}  // namespace palpate::report
