#pragma once

#include <training/progress_page.h>

#include <nlohmann/json_fwd.hpp>

#include <vector>

namespace palpate::apps {

/// What `palpate progress --json` gives (docs/curriculum.md): rows by exercise and measure, where everybody stands, what is
/// next, all sessions, groups compared.
/// @param groups  may be empty
nlohmann::json progressFigures(const std::vector<training::PersonProgress>& people,
                               const std::vector<report::ScoredGroup>& groups);

/// Medians, quartiles and values of a group, by measure.
nlohmann::json groupFigures(const report::ScoredGroup& group);
/// Cliff's delta of one group over another, by measure.
nlohmann::json effectFigures(const report::ScoredGroup& a, const report::ScoredGroup& b);

}  // namespace palpate::apps
