#pragma once

#include <map>
#include <string>

namespace palpate::sweep {

/// The value of a formula over named numbers: "depth_mm + diameter_mm / 2", "gain > 0 && delay_ms < 20" (1 or 0). Not a
/// number where one that it uses is none. Throws std::runtime_error ("formula 'a +': what is wrong"), also where it has
/// several values, as "0,5".
double evaluate(const std::string& formula, const std::map<std::string, double>& values);

/// Whether `name` can stand in a formula.
bool isVariable(const std::string& name);

}  // namespace palpate::sweep
