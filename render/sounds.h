#pragma once

#include <channel/layout.h>

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace palpate::render {

inline constexpr int sampleRate = 44100;  // [Hz]

/// Beeps that say how urgent a warning is: one, two higher ones, three of the highest; nothing for `none`.
/// @returns  samples at `sampleRate`, in [-32767, 32767]; they begin and end softly
std::vector<std::int16_t> soundOf(channel::Warning warning);

/// Plays a sound whenever a warning becomes more urgent, in a thread of its own, by ALSA. Where there is no sound card
/// nothing is heard, and it is said once.
class Sounds {
public:
    /// @param say  is told why nothing can be heard
    explicit Sounds(std::function<void(const std::string&)> say);
    ~Sounds();

    /// Never waits.
    void heed(const channel::State& state);

private:
    void run();
    bool play(std::span<const std::int16_t> samples);

    std::function<void(const std::string&)> say_;
    channel::Warning last_ = channel::Warning::none;
    std::mutex guard_;
    std::condition_variable wake_;
    channel::Warning wanted_ = channel::Warning::none;
    bool ending_ = false;
    std::thread thread_;
};

}  // namespace palpate::render
