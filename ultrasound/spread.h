#pragma once

#include <ultrasound/view.h>

#include <cstdint>
#include <vector>

namespace palpate::ultrasound {

/// Point spread and what is seen of it: noise, pulse along the lines, beam across them, grey.
class PointSpread {
public:
    PointSpread();

    /// Electronic noise of `level` [dB of a mirror]; `seed` chooses its pattern.
    void addNoise(EchoLines& echoes, float level, std::uint64_t seed);
    /// Spreads each echo along its line by the pulse.
    void axial(const Beam& beam, const EchoLines& echoes);
    /// ... and across the lines by the beam at its depth.
    void lateral(const Beam& beam);
    /// Square of the envelope (samples x lines), and its grey after gain and compression.
    void power(std::vector<float>& out) const;
    void compress(const Beam& beam, std::vector<std::uint8_t>& grey) const;

private:
    EchoLines pulse_, spread_;
    std::vector<float> noise_, row_;
};

/// Gain at depth `z` [m]: the probe's own, the compensation of depth, and the sliders [dB].
float gainAt(const Beam& beam, float z) noexcept;

}  // namespace palpate::ultrasound
