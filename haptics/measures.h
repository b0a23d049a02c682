#pragma once

#include <haptics/score.h>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace palpate::haptics {

/// One number of a score as figures, tables and lists give it, in the unit that its key names.
struct Measure {
    enum class Listed : std::uint8_t { always, ifFired, ifMarked, ifProbe, ifCt, ifTouch, ifAdvance, never };

    const char* key;    // in --json
    const char* title;  // in a table
    const char* label;  // in a list
    const char* unit;   // behind the value in a list
    int decimals;
    Listed listed;                  // ifFired: "-" when the gun was not fired, and nothing where no core is asked for
    double (*value)(const Score&);  // infinite: never reached, worse than any; not a number: no session of its kind has it
};

/// All measures, in the order of docs/score.md.
std::span<const Measure> measures() noexcept;

/// One of the parts of a total.
struct PartOfTotal {
    const char* key;    // in --json
    const char* label;  // in a list
    double most;
    double ScoreParts::*points;
};
inline constexpr std::array<PartOfTotal, 3> partsOfTotal{{{"core", "Core", 50, &ScoreParts::core},
                                                          {"vital", "Vital structures", 25, &ScoreParts::vital},
                                                          {"technique", "Technique", 25, &ScoreParts::technique}}};
/// What the part `core` is called in a list: by what it is for, see judgedBy().
const char* labelOfCore(const Score& score) noexcept;

using LabelledValues = std::vector<std::pair<std::string, std::string>>;
/// The total and its parts, in points.
LabelledValues describeTotal(const Score& score);
/// All other measures in the units of screens (mm, N, s, %).
LabelledValues describeMeasures(const Score& score);
/// Both, for printing.
LabelledValues describe(const Score& score);

}  // namespace palpate::haptics
