#pragma once

// What cases and curricula read alike; no public header.

#include <datasets/toml_section.h>

#include <string>
#include <string_view>

namespace palpate::training {

/// A text that must be there; `what` says what it is.
std::string called(datasets::Section& section, std::string_view key, std::string_view what);

/// Refuses the name of a measure that haptics::measures() does not have.
void checkMeasure(const datasets::Section& section, std::string_view key, const std::string& measure);

}  // namespace palpate::training
