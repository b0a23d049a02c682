#pragma once

#include <channel/layout.h>

#include <cmath>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::ultrasound {

/// A figure of the simulator beside what it has to be.
struct Check {
    std::string what;
    std::string unit;
    double measured = 0, wanted = 0;
    double tolerance = 0;  // of their difference
    std::string source;    // of what is wanted

    bool good() const noexcept { return std::abs(measured - wanted) <= tolerance; }
};

/// What a tissue of the table that is checked does to sound. Throws for one that it does not have.
using SoundOf = std::function<channel::TissueSound(std::string_view)>;

/// All checks, one group after the other: `progress` is called with the share that is done. Half a minute.
std::vector<Check> runChecks(const SoundOf& soundOf, const std::function<void(double)>& progress);

// The groups, each on bodies of its own.
std::vector<Check> checkReflections(const SoundOf& soundOf);
std::vector<Check> checkAttenuation(const SoundOf& soundOf);
std::vector<Check> checkPointSpread(const SoundOf& soundOf);
std::vector<Check> checkSpeckle(const SoundOf& soundOf);
std::vector<Check> checkMotion(const SoundOf& soundOf);
std::vector<Check> checkNeedle(const SoundOf& soundOf);
std::vector<Check> checkShadows(const SoundOf& soundOf);

}  // namespace palpate::ultrasound
