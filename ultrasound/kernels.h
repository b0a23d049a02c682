#pragma once

#include <cstdint>
#include <span>

namespace palpate::ultrasound {

inline constexpr int perBlock = 32;  // scatterers

/// The scatterers of one block: in the probe's frame on entry, where and how they echo afterwards.
struct BlockEchoes {
    alignas(64) float l[perBlock];       // lateral [m] -> line
    alignas(64) float y[perBlock];       // elevation [m] -> plane, from the middle one
    alignas(64) float z[perBlock];       // axial [m] -> sample
    alignas(64) float cosine[perBlock];  // of the phase, times the weight across the picture's plane
    alignas(64) float sine[perBlock];
};

/// What turns a block's scatterers into echoes.
struct BlockScale {
    float radius = 0;  // of a curved face [m]; 0: linear
    float turns = 0;   // of phase per metre: 2 / wavelength
    float perLine = 0, middle = 0, perSample = 0;
    float elevation = 0;  // 1 / (32 sigma^2) [1/m^2]
    float cut = 0;        // no echo from further off the plane [m]
    float planes = 0;     // per metre
};

/// Inner loops, compiled for several vector units; all give the same bits.
struct Kernels {
    const char* name;
    void (*echoes)(const BlockScale& scale, BlockEchoes& block);
    /// Each sample's row: from[k] + sum over j of weight[j] (from[k - j] + from[k + j]), j = 1 .. radius.
    void (*axial)(const float* from, float* to, int samples, int lines, const float* weight, int radius);
    /// One row: sum over j of weight[j] (in[i - j] + in[i + j]) / 2 for j = 0 twice; `in` has `radius` more at both ends.
    void (*lateral)(const float* in, float* out, int lines, const float* weight, int radius);
    void (*noise)(float* row, const float* table, float level, int lines);
    /// 8-bit grey of the square of an amplitude: (10 log10(re^2 + im^2) + add) scale, in [0, 255].
    void (*compress)(const float* re, const float* im, float add, float scale, int lines, std::uint8_t* grey);
    void (*power)(const float* re, const float* im, int lines, float* out);
};

/// Those that this processor has, the best one last.
std::span<const Kernels* const> supportedKernels() noexcept;
const Kernels& kernels() noexcept;

}  // namespace palpate::ultrasound
