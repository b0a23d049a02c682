#pragma once

#include <channel/deformation.h>
#include <channel/layout.h>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::ct {

/// Standard deviation of the noise [HU] of slices of `width` [m] at a CTDIvol of `doseIndex` [mGy]: 12 HU at 10 mGy and
/// 5 mm, assumed, as for an abdomen; it goes as 1 / sqrt(dose x width).
double noiseOf(double width, double doseIndex) noexcept;

/// One scan: axial slices side by side, `side` x `side` pixels each. Pixel (0, 0) is the patient's right front; x goes to
/// the left, y to the back.
struct Scan {
    int side = 0;
    double pixel = 0;                           // [m]
    glm::dvec2 corner{0.0};                     // x and y of the middle of pixel (0, 0) [m]
    std::vector<double> height;                 // z of each slice's middle, from the feet up [m]
    std::vector<std::vector<std::int16_t>> hu;  // by slice, x fastest

    /// CT number at a pixel of a slice [HU].
    std::int16_t at(std::size_t slice, int x, int y) const
    {
        return hu.at(slice).at(static_cast<std::size_t>(y * side + x));
    }
};

/// What a range of CT numbers is shown as.
struct Window {
    std::string_view name;
    double low = 0, high = 0;  // black and white [HU]

    std::uint8_t grey(double hu) const noexcept;
};
inline constexpr std::array<Window, 3> windows{{{"soft-tissue", -160, 240}, {"lung", -1350, 150}, {"bone", -450, 1050}}};

/// Scans the deformed body of a session whose scene has CT.
class Scanner {
public:
    /// @param scenery  with ctSlices over 0
    /// @param image    codes of the intensity image that the body came with; where it is CT its numbers are the tissue's.
    /// Copied; empty where there is none. The body ends where its labels do
    Scanner(const channel::Scenery& scenery, std::span<const std::uint16_t> image);

    /// One scan of this moment, with the needle in it. The middle slice goes through the needle's tip. The same tick gives
    /// the same noise.
    Scan scan(const channel::State& state, const channel::Deformation& body) const;

private:
    struct Plane;
    float numberAt(const channel::Deformation& body, glm::dvec3 rest) const noexcept;
    float codeAt(glm::ivec3 node) const noexcept;
    float numberBeside(const channel::Deformation& body, glm::ivec3 node) const noexcept;
    float shareOfHoles(const channel::State& state, const channel::Deformation& body, glm::dvec3 rest,
                       double pixel) const noexcept;
    void addPlane(const channel::State& state, const channel::Deformation& body, Plane& plane) const;
    std::vector<float> slice(const channel::State& state, const channel::Deformation& body, const Scan& frame,
                             double height) const;

    channel::Scenery scenery_;
    std::vector<std::uint16_t> image_;  // empty where there is none, or it is no CT
    std::array<float, channel::maxTissues> number_{};
};

/// One slice as a picture of greys, seen from the feet: the patient's right at the left, the front on top.
/// @param slice  from 0, the one nearest to the feet
/// @param side   pixels of the picture along each side
/// Returns side x side bytes, rows from the top down.
std::vector<std::uint8_t> shown(const Scan& scan, std::size_t slice, const Window& window, int side);

/// A scan as a PNG file: its slices side by side from the feet up, `side` pixels each. The text "palpate-ct" says tick,
/// places, window and dose as JSON.
std::string scanPng(const Scan& scan, std::uint64_t tick, double doseLength, const Window& window, int side);

}  // namespace palpate::ct
