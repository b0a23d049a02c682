#pragma once

#include <haptics/measures.h>

#include <nlohmann/json_fwd.hpp>

namespace palpate::apps {

using haptics::Measure;
using haptics::measures;

/// A score in --json, the same of a live session and of a record: every measure by its key, and points{core, vital,
/// technique}.
nlohmann::json scoreFigures(const haptics::Score& score);

}  // namespace palpate::apps
