#pragma once

#include <nlohmann/json_fwd.hpp>

#include <optional>
#include <string>
#include <vector>

namespace palpate::trainer {

/// A session that runs on this machine.
struct LiveSession {
    std::string session;                          // its name, for viewers
    std::string who, scene;                       // who may be empty: not known
    std::string doing;                            // "outside", "inserted", "paused", in the user's language
    std::string warning;                          // in words; empty: none
    bool touching = false;                        // the warning is that a vital structure is touched
    double seconds = 0, inserted = 0, force = 0;  // [s], [mm], [N]
    std::optional<double> target, vital;          // distances of the tip [mm]
    int cores = 0;
    std::optional<double> lastCore;  // target in it [%]
    bool stuck = false;              // nothing was heard of it for two seconds
};

/// What `palpate sessions --json` gives.
std::vector<LiveSession> liveIn(const nlohmann::json& figures);

/// Values of one measure in one group.
struct Spread {
    double median = 0, lower = 0, upper = 0;  // infinite where more than that many sessions have none
    std::vector<double> values;               // finite ones
};

/// "12.3 (10.1 to 14.0)", with "-" for what is infinite, or in words that there is nothing.
std::string inWords(const Spread& spread, int decimals);

/// A measure in all groups.
struct ComparedMeasure {
    std::string label, unit;
    int decimals = 0;
    std::vector<Spread> groups;
    std::optional<double> effect;  // Cliff's delta of the first group over the second, -1 to 1
};

struct Comparison {
    std::vector<std::string> names;
    std::vector<int> sessions;              // of each group
    std::vector<ComparedMeasure> measures;  // those that differ, as printed
    std::vector<std::string> same;          // the others in words, with their one value: "Passes 1"
};

/// The groups in what `palpate progress --group .. --json` gives.
Comparison comparisonIn(const nlohmann::json& figures);

}  // namespace palpate::trainer
