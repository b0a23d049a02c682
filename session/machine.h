#pragma once

#include <datasets/scene.h>
#include <haptics/timing.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <string>

namespace palpate::session {

/// What the tissue of a scene has to bear, which decides how long a tick takes.
struct TissueLoad {
    bool needle = false;  // and no ball or finger: the force of a needle does not wait for the tissue's shape
    bool probe = false;   // an ultrasound probe is pressed beside
};
TissueLoad loadOf(const datasets::Scene& scene) noexcept;

/// The setting of level `elastic` that this machine holds at 1 kHz, and why.
struct FittingSetting {
    std::string setting;  // one of datasets::elasticSettings()
    std::string reason;   // "a tick of default takes 0.35 ms (slow ones 0.52 ms) here"
};

/// A tick may take at most this long at the 99th percentile, with a viewer beside it [s].
inline constexpr double fittingTick = 0.7e-3;

/// Time of ticks in contact, at a setting [s].
struct TickTime {
    double p50 = 0;  // half are at most so long
    /// 99 of 100 are at most so long. With a needle, all: windows move in one of a hundred ticks, and in a small body more
    /// cheaply than in a patient.
    double slow = 0;
};

/// The finest setting whose ticks fit; the fastest where none does. `default` comes first: `fine` is only asked for where a
/// tick of `default` takes less than a third of what there is.
/// @param timeOf  measures a setting
FittingSetting fittingSetting(const std::function<TickTime(const std::string&)>& timeOf);

/// A ball pressed into a small block, or a needle pushed into small layers under skin, as fast as the program goes, while
/// another thread keeps the memory busy as a viewer does: 0.1 s (0.2 s with a needle at `default`). Times are of the
/// processor, so that other programs do not count: the servo thread goes before them.
/// @param setting  of level `elastic`
/// @param load     which tools
TickTime measureSetting(const std::string& setting, const TissueLoad& load = {});

/// For so long a measurement is good: a machine becomes slower on its battery, or when others use it [s].
inline constexpr double fittingKept = 3600.0;

/// fittingSetting() of this machine and build, from `cache` where it is known; else it is measured, and written there. A
/// cache that cannot be read or written costs the measurement and nothing else.
/// @param cache  the file
/// @param load   each has its own measurement
/// @param now    time of day; a measurement is kept for `fittingKept`
FittingSetting fittingHere(const std::filesystem::path& cache, const TissueLoad& load = {},
                           std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

/// Fraction of a session's ticks that took over 1 ms [-], and what of it is bearable.
double overrunsOf(const haptics::ServoTiming& timing) noexcept;
inline constexpr double bearableOverruns = 0.005;

/// Corrects a fitted setting that a session was too slow with: within `fittingKept`, fittingHere() gives the next faster
/// one, with the reason. A session of under a second tells nothing.
/// @param cache   as of fittingHere()
/// @param scene   of the session, with the fitted setting
/// @param timing  of the session
/// @param now     time of day
/// @returns       the setting of the next session, or nothing where it remains
std::string learnFrom(const std::filesystem::path& cache, const datasets::Scene& scene, const haptics::ServoTiming& timing,
                      std::chrono::system_clock::time_point now = std::chrono::system_clock::now());

/// machine.json of base::UserFolder::cache; empty where there is none.
std::filesystem::path machineCache();

}  // namespace palpate::session
