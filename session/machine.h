#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace palpate::session {

/// The setting of level `elastic` that this machine holds at 1 kHz, and why.
struct FittingSetting {
    std::string setting;  // one of datasets::elasticSettings()
    std::string reason;   // "a tick of default takes 0.35 ms (p99 0.52 ms) here"
};

/// A tick may take at most this long at the 99th percentile, with a viewer beside it [s].
inline constexpr double fittingTick = 0.7e-3;

/// Time of ticks in contact, at a setting [s].
struct TickTime {
    double p50 = 0;  // half are at most so long
    double p99 = 0;  // 99 of 100
};

/// The finest setting whose ticks fit; the fastest where none does. `default` comes first: `fine` is only asked for where a
/// tick of `default` takes less than a third of what there is.
/// @param timeOf  measures a setting
FittingSetting fittingSetting(const std::function<TickTime(const std::string&)>& timeOf);

/// A ball pressed into a small block, as fast as it goes, while another thread keeps the memory busy as a viewer does: 0.1
/// s. Times are of the processor, so that other programs do not count: the servo thread goes before them.
/// @param setting  of level `elastic`
/// @param probe  an ultrasound probe is pressed beside the ball
TickTime measureSetting(const std::string& setting, bool probe = false);

/// fittingSetting() of this machine and build, from `cache` where it is known; else it is measured, and written there. A
/// cache that cannot be read or written costs the measurement and nothing else.
/// @param cache  the file
/// @param probe  of a scene with an ultrasound probe: the body has two tools to bear
FittingSetting fittingHere(const std::filesystem::path& cache, bool probe = false);

/// machine.json of base::UserFolder::cache; empty where there is none.
std::filesystem::path machineCache();

}  // namespace palpate::session
