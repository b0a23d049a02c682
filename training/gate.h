#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::training {

/// What a measure has to be in a session that counts as done well; in the unit that the measure's key names.
struct Level {
    std::string measure;  // key of haptics::measures()
    std::optional<double> atLeast, atMost;

    /// A value that is not there (NaN: never fired, never inside) meets nothing, an infinite one what its side lets it.
    bool met(double value) const noexcept;
};

/// The level of proficiency that opens what comes next: all levels met in `pass` of the last `of` sessions.
struct Gate {
    std::vector<Level> levels;
    int pass = 3, of = 5;   // 1 <= pass <= of
    bool testOnly = false;  // only sessions in test mode count
};

/// Measures of one session, by key. A key that is missing is a value that is not there.
using Values = std::map<std::string, double, std::less<>>;
/// Not a number where it is missing.
double valueIn(const Values& values, std::string_view key) noexcept;

/// A session as a gate sees it.
struct Trial {
    Values values;
    bool test = false;  // mode: test, without hints and guidance
};

/// Whether all levels are met.
bool meets(const Gate& gate, const Values& values) noexcept;

/// What a row of sessions came to.
struct GateState {
    bool open = false;    // it was reached in one of the sessions; later ones do not change it
    int openedAt = -1;    // index of the session that opened it; -1: none
    int counted = 0;      // sessions that count for the gate
    int recentMet = 0;    // of the last `of` that count
    int recentTried = 0;  // at most `of`
};

/// Goes through sessions in their order.
GateState stateOf(const Gate& gate, std::span<const Trial> trials);

}  // namespace palpate::training
