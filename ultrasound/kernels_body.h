// The loops of Kernels, once for each vector unit: included by kernels_v2.cpp and kernels_avx2.cpp. Everything is internal,
// so that no code for one unit is linked into the other. No guard: one inclusion each.

#include <ultrasound/kernels.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace palpate::ultrasound {
namespace {

// Places on a curved face: depth from the radius, line by a polynomial for the arc tangent (error 2e-5 rad within 1 rad).
void bend(float radius, BlockEchoes& b)
{
    for (int j = 0; j < perBlock; ++j) {
        const float z = b.z[j] + radius, t = b.l[j] / z, u = t * t;
        b.z[j] = std::sqrt(b.l[j] * b.l[j] + z * z) - radius;
        b.l[j] = t * (0.99997726F +
                      u * (-0.33262347F + u * (0.19354346F + u * (-0.11643287F + u * (0.05265332F - 0.0117212F * u)))));
    }
}

void echoes(const BlockScale& s, BlockEchoes& b)
{
    if (s.radius > 0)
        bend(s.radius, b);
    for (int j = 0; j < perBlock; ++j) {
        const float t = s.turns * b.z[j], f = t - std::floor(t + 0.5F);  // in [-1/2, 1/2] turns
        // (1 - x / 16)^16 for exp(-x), and nothing beyond the cut
        const float g = 1 - b.y[j] * b.y[j] * s.elevation, g2 = g * g, g4 = g2 * g2, g8 = g4 * g4;
        const float w = std::abs(b.y[j]) < s.cut ? g8 * g8 : 0.0F;
        // Within a quarter turn by polynomials; the other half turn has the opposite sign.
        const float h = f - 0.5F * std::floor(2 * f + 0.5F), u = 39.478418F * h * h;
        const float c = 1 - u * (0.5F - u * (0.041666638F - u * (0.0013888397F - u * 2.4760495e-5F)));
        const float n =
            6.2831853F * h * (1 - u * (0.16666667F - u * (0.0083333310F - u * (0.00019840874F - u * 2.7525562e-6F))));
        const float signedWeight = std::abs(f) > 0.25F ? -w : w;
        b.cosine[j] = signedWeight * c;
        b.sine[j] = signedWeight * n;
        b.y[j] = std::floor(b.y[j] * s.planes + 0.5F);
        b.l[j] = b.l[j] * s.perLine + s.middle;
        b.z[j] = b.z[j] * s.perSample - 0.5F;
    }
}

void addRows(float* __restrict out, const float* __restrict a, const float* __restrict b, float w, int n)
{
    for (int i = 0; i < n; ++i)
        out[i] += w * (a[i] + b[i]);
}

void axial(const float* from, float* to, int samples, int lines, const float* weight, int radius)
{
    const auto row = [&](int k) { return static_cast<std::ptrdiff_t>(std::clamp(k, 0, samples - 1)) * lines; };
    for (int k = 0; k < samples; ++k) {
        float* out = to + row(k);
        std::copy_n(from + row(k), lines, out);
        for (int j = 1; j <= radius; ++j)
            addRows(out, from + row(k - j), from + row(k + j), weight[j], lines);
    }
}

void lateral(const float* in, float* __restrict out, int lines, const float* weight, int radius)
{
    for (int i = 0; i < lines; ++i)
        out[i] = weight[0] * in[i];
    for (int j = 1; j <= radius; ++j)
        addRows(out, in - j, in + j, weight[j], lines);
}

void noise(float* __restrict row, const float* __restrict table, float level, int lines)
{
    for (int i = 0; i < lines; ++i)
        row[i] += level * table[i];
}

void power(const float* __restrict re, const float* __restrict im, int lines, float* __restrict out)
{
    for (int i = 0; i < lines; ++i)
        out[i] = re[i] * re[i] + im[i] * im[i];
}

// log2 from the exponent and a polynomial in the mantissa: error 0.01 dB.
void compress(const float* __restrict re, const float* __restrict im, float add, float scale, int lines,
              std::uint8_t* __restrict grey)
{
    for (int i = 0; i < lines; ++i) {
        const float square = re[i] * re[i] + im[i] * im[i] + 1e-30F;
        const auto bits = std::bit_cast<std::int32_t>(square);
        const float m = std::bit_cast<float>((bits & 0x7fffff) | 0x3f800000);
        const float log2 =
            static_cast<float>((bits >> 23) - 127) + (-2.153620F + m * (3.047884F + m * (-1.051875F + m * 0.1582487F)));
        const float v = (3.0103F * log2 + add) * scale;
        grey[i] = static_cast<std::uint8_t>(static_cast<std::int32_t>(std::min(std::max(v, 0.0F), 255.0F)));
    }
}

constexpr Kernels table(const char* name)
{
    return {name, echoes, axial, lateral, noise, compress, power};
}

}  // namespace
}  // namespace palpate::ultrasound
