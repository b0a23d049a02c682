#include <ultrasound/spread.h>

#include <ultrasound/kernels.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::ultrasound {

namespace {

constexpr int widest = 40;  // of a spread to each side [rows, lines]
constexpr std::size_t noises = 1U << 15U;
constexpr float maxCompensation = 75;  // [dB]

// Weights of a Gaussian of `sigma` steps, of 1 in the middle; returns how many there are to each side.
int gaussian(float sigma, float cut, std::array<float, widest + 1>& weight)
{
    const int radius = std::clamp(static_cast<int>(std::ceil(cut * sigma)), 0, widest);
    for (int j = 0; j <= radius; ++j) {
        const auto x = static_cast<float>(j) / std::max(sigma, 1e-6F);
        weight[static_cast<std::size_t>(j)] = std::exp(-0.5F * x * x);
    }
    return radius;
}

}  // namespace

PointSpread::PointSpread() : noise_(noises)
{
    std::uint32_t state = 1;
    for (float& n : noise_) {
        n = 0;  // the sum of eight uniforms is near enough to a Gaussian
        for (int i = 0; i < 8; ++i) {
            state = scrambled(state + 1);
            n += static_cast<float>(state >> 8U) / 16777216.0F - 0.5F;
        }
        n *= 1.2247449F;
    }
}

void PointSpread::addNoise(EchoLines& echoes, float level, std::uint64_t seed)
{
    const float amplitude = std::pow(10.0F, level / 20);
    auto state = scrambled(static_cast<std::uint32_t>(seed ^ seed >> 32U));
    const std::size_t last = noises - static_cast<std::size_t>(echoes.lines);
    for (int k = 0; k < echoes.samples; ++k) {
        state = scrambled(state + 1);
        kernels().noise(&echoes.re[echoes.at(k, 0)], &noise_[(state & 0xffffU) % last], amplitude, echoes.lines);
        kernels().noise(&echoes.im[echoes.at(k, 0)], &noise_[(state >> 16U) % last], amplitude, echoes.lines);
    }
}

void PointSpread::axial(const Beam& beam, const EchoLines& echoes)
{
    pulse_.lines = echoes.lines;
    pulse_.samples = echoes.samples;
    pulse_.re.resize(echoes.re.size());
    pulse_.im.resize(echoes.im.size());
    std::array<float, widest + 1> weight{};
    const int radius = gaussian(beam.axialSigma() / beam.sample(), 2.8F, weight);
    kernels().axial(echoes.re.data(), pulse_.re.data(), echoes.samples, echoes.lines, weight.data(), radius);
    kernels().axial(echoes.im.data(), pulse_.im.data(), echoes.samples, echoes.lines, weight.data(), radius);
}

// Of sum 1, so that a mirror as wide as the beam keeps its level.
void PointSpread::lateral(const Beam& beam)
{
    spread_.lines = pulse_.lines;
    spread_.samples = pulse_.samples;
    spread_.re.resize(pulse_.re.size());
    spread_.im.resize(pulse_.im.size());
    const auto lines = static_cast<std::size_t>(pulse_.lines);
    row_.resize(lines + 2 * widest);
    std::array<float, widest + 1> weight{};
    for (int k = 0; k < pulse_.samples; ++k) {
        const float z = (static_cast<float>(k) + 0.5F) * beam.sample();
        const int radius = gaussian(beam.lateralSigma(z) / (beam.pitch() * beam.metresPerLine(z)), 2.6F, weight);
        float sum = -weight[0];
        for (int j = 0; j <= radius; ++j)
            sum += 2 * weight[static_cast<std::size_t>(j)];
        for (float& w : weight)
            w /= sum;
        for (const auto& [from, to] : {std::pair{&pulse_.re, &spread_.re}, std::pair{&pulse_.im, &spread_.im}}) {
            const float* in = &(*from)[pulse_.at(k, 0)];
            std::fill_n(row_.begin(), widest, in[0]);
            std::copy_n(in, lines, row_.begin() + widest);
            std::fill_n(row_.begin() + widest + static_cast<std::ptrdiff_t>(lines), widest, in[lines - 1]);
            kernels().lateral(&row_[widest], &(*to)[pulse_.at(k, 0)], pulse_.lines, weight.data(), radius);
        }
    }
}

void PointSpread::power(std::vector<float>& out) const
{
    out.resize(spread_.re.size());
    for (int k = 0; k < spread_.samples; ++k) {
        const std::size_t at = spread_.at(k, 0);
        kernels().power(&spread_.re[at], &spread_.im[at], spread_.lines, &out[at]);
    }
}

float gainAt(const Beam& beam, float z) noexcept
{
    const Settings& s = beam.settings();
    const float fraction = z / s.depth * tgcSliders - 0.5F;
    const float low = std::clamp(std::floor(fraction), 0.0F, static_cast<float>(tgcSliders - 1));
    const auto i = static_cast<std::size_t>(low), j = std::min<std::size_t>(i + 1, tgcSliders - 1);
    const float t = std::clamp(fraction - low, 0.0F, 1.0F), slider = s.tgc[i] + t * (s.tgc[j] - s.tgc[i]);
    const float perMetre = 100 * beam.transducer().compensation * beam.megahertz();
    return beam.transducer().baseGain + s.gain + slider + std::min(maxCompensation, perMetre * z);
}

void PointSpread::compress(const Beam& beam, std::vector<std::uint8_t>& grey) const
{
    grey.resize(spread_.re.size());
    const float scale = 255 / beam.settings().dynamicRange;
    for (int k = 0; k < spread_.samples; ++k) {
        const std::size_t at = spread_.at(k, 0);
        const float gain = gainAt(beam, (static_cast<float>(k) + 0.5F) * beam.sample());
        kernels().compress(&spread_.re[at], &spread_.im[at], gain, scale, spread_.lines, &grey[at]);
    }
}

}  // namespace palpate::ultrasound
