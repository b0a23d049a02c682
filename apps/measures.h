#pragma once

#include <haptics/score.h>

#include <nlohmann/json_fwd.hpp>

#include <span>

namespace palpate::apps {

/// One number of a score as figures and tables give it, in the unit that its key names.
struct Measure {
    const char* key;    // in --json
    const char* title;  // in a table
    int decimals;       // in a table
    double (*value)(const haptics::Score&);
};

/// All measures, in the order of docs/score.md.
std::span<const Measure> measures() noexcept;

/// A score in --json, the same of a live session and of a record: every measure by its key, and points{core, vital,
/// technique}.
nlohmann::json scoreFigures(const haptics::Score& score);

}  // namespace palpate::apps
