#pragma once

#include <haptics/score.h>

#include <span>

namespace palpate::haptics {

/// One number of a score as figures and tables give it, in the unit that its key names.
struct Measure {
    const char* key;    // in --json
    const char* title;  // in a table
    int decimals;       // in a table
    double (*value)(const Score&);
};

/// All measures, in the order of docs/score.md.
std::span<const Measure> measures() noexcept;

}  // namespace palpate::haptics
