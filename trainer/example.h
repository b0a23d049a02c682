#pragma once

#include <trainer/state.h>

#include <string>
#include <utility>
#include <vector>

namespace palpate::trainer {

/// Every screen with a lot on it: as many people, sessions, curves and groups as a department has after a year. Each with
/// the name that it is measured under, "cases", "instructor, groups". Not part of the interface.
/// @param listed  with the cases and the settings that there are
std::vector<std::pair<std::string, State>> exampleScreens(const State& listed);

}  // namespace palpate::trainer
