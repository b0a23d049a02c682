#include <render/sounds.h>

#include <alsa/asoundlib.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <numbers>
#include <utility>

namespace palpate::render {
namespace {

constexpr double loudness = 0.25;              // of the largest
constexpr double beep = 0.11, silence = 0.06;  // [s]
constexpr double softly = 0.008;               // of a beep's begin and end [s]

struct PcmCloser {
    void operator()(snd_pcm_t* pcm) const noexcept { snd_pcm_close(pcm); }
};

void append(std::vector<std::int16_t>& samples, double hertz)
{
    const auto count = static_cast<std::size_t>(beep * sampleRate);
    for (std::size_t i = 0; i < count; ++i) {
        const double t = static_cast<double>(i) / sampleRate;
        const double shape = std::min({1.0, t / softly, (beep - t) / softly});
        samples.push_back(
            static_cast<std::int16_t>(std::lround(32767 * loudness * shape * std::sin(2 * std::numbers::pi * hertz * t))));
    }
    samples.resize(samples.size() + static_cast<std::size_t>(silence * sampleRate));
}

// ALSA prints to the terminal what it could not do.
void quiet(const char*, int, const char*, int, const char*, ...) {}

}  // namespace

std::vector<std::int16_t> soundOf(channel::Warning warning)
{
    constexpr double low = 660, high = 880, highest = 1175;  // [Hz]
    const auto beeps = static_cast<int>(warning);
    std::vector<std::int16_t> samples;
    for (int i = 0; i < beeps; ++i)
        append(samples, beeps == 1 ? low : beeps == 2 ? high : highest);
    return samples;
}

Sounds::Sounds(std::function<void(const std::string&)> say) : say_(std::move(say)), thread_([this] { run(); }) {}

Sounds::~Sounds()
{
    {
        const std::lock_guard lock(guard_);
        ending_ = true;
    }
    wake_.notify_one();
    thread_.join();
}

void Sounds::heed(const channel::State& state)
{
    if (state.warning <= last_) {
        last_ = state.warning;
        return;
    }
    const std::unique_lock lock(guard_, std::try_to_lock);
    if (!lock)
        return;  // the next state has its warning too
    last_ = wanted_ = state.warning;
    wake_.notify_one();
}

void Sounds::run()
{
    snd_lib_error_set_handler(quiet);
    for (;;) {
        channel::Warning now;
        {
            std::unique_lock lock(guard_);
            wake_.wait(lock, [this] { return ending_ || wanted_ != channel::Warning::none; });
            if (ending_)
                return;
            now = std::exchange(wanted_, channel::Warning::none);
        }
        if (!play(soundOf(now)))
            return;
    }
}

bool Sounds::play(std::span<const std::int16_t> samples)
{
    snd_pcm_t* opened = nullptr;
    int failed = snd_pcm_open(&opened, "default", SND_PCM_STREAM_PLAYBACK, 0);
    const std::unique_ptr<snd_pcm_t, PcmCloser> pcm(failed < 0 ? nullptr : opened);
    constexpr unsigned latency = 50000;  // [us]
    if (pcm)
        failed =
            snd_pcm_set_params(pcm.get(), SND_PCM_FORMAT_S16, SND_PCM_ACCESS_RW_INTERLEAVED, 1, sampleRate, 1, latency);
    if (failed < 0) {
        say_(std::string("no sounds: ") + snd_strerror(failed));
        return false;
    }
    while (!samples.empty()) {
        const snd_pcm_sframes_t written = snd_pcm_writei(pcm.get(), samples.data(), samples.size());
        if (written < 0 && snd_pcm_recover(pcm.get(), static_cast<int>(written), 1) < 0)
            return true;
        samples = samples.subspan(static_cast<std::size_t>(std::max<snd_pcm_sframes_t>(written, 0)));
    }
    snd_pcm_drain(pcm.get());
    return true;
}

}  // namespace palpate::render
