#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <array>
#include <cmath>
#include <cstdint>

namespace palpate::ultrasound {

inline constexpr float soundSpeed = 1540;  // that a scanner reckons with [m/s]
inline constexpr int tgcSliders = 8;

enum class ProbeShape : std::uint8_t { linear, curved };

/// What a probe is by its making.
struct Transducer {
    ProbeShape shape = ProbeShape::linear;
    float width = 38e-3F;                                    // linear: of the face [m]
    float radius = 50e-3F, sector = 1.15F;                   // curved: of the face [m], [rad]
    float frequency = 9e6F, lowest = 5e6F, highest = 14e6F;  // at first, and what there is to choose from [Hz]
    float bandwidth = 0.5F;                                  // pulse-echo at -6 dB, fraction of the frequency
    float fNumber = 2;                                       // of transmit and receive
    // In elevation the lens is fixed: width at its focus at -6 dB, focus, depth of field [m].
    float elevationWidth = 1.3e-3F, elevationFocus = 18e-3F, elevationRange = 14e-3F;
    float depth = 40e-3F, shallowest = 20e-3F, deepest = 80e-3F;  // of the picture [m]
    float focus = 18e-3F;                                         // [m]
    float compensation = 1.44F;                                   // of depth, before the sliders [dB/cm/MHz both ways]
    float baseGain = 72;                                          // [dB]
    float rayStep = 0.1e-3F;                                      // along a line [m]
    float block = 1e-3F;                                          // edge of the block that 32 scatterers fill [m]
};

Transducer linearProbe();
Transducer curvedProbe();

/// What the person at the scanner sets.
struct Settings {
    float depth = 40e-3F;                 // [m]
    float frequency = 9e6F;               // [Hz]
    float focus = 18e-3F;                 // of transmission [m]
    float gain = 0;                       // over the probe's own [dB]
    float dynamicRange = 60;              // from black to white [dB]
    std::array<float, tgcSliders> tgc{};  // gain at the middles of as many layers of the picture [dB]
    int lines = 192, samples = 1000, planes = 3;

    bool operator==(const Settings&) const = default;
};

Settings settingsOf(const Transducer& transducer);
/// The nearest settings that the probe has.
Settings within(Settings settings, const Transducer& transducer);

/// Where a probe is: middle of its face [m] and right-handed unit vectors, patient frame.
struct Pose {
    glm::dvec3 face{0.0};
    glm::dvec3 lateral{1, 0, 0};    // along the face, towards the marked side
    glm::dvec3 elevation{0, 1, 0};  // across the picture's plane
    glm::dvec3 axial{0, 0, 1};      // into the body
};

/// @pre `lateral` is not along `axial`
Pose poseOf(glm::dvec3 face, glm::dvec3 axial, glm::dvec3 lateral);

/// The beam of a probe at its settings. A place is (l, z): along the face [m], curved: [rad]; depth below the face [m].
///
/// Pulse, transmit and receive beam are Gaussian: axial width at half height 2 ln 2 / pi c / (B f); lateral w0 = 0.886
/// lambda F at the focus both ways, from a transmit beam of fixed focus, w_t = w1 sqrt(1 + ((z - z_f) / 3.5 lambda F^2)^2),
/// and a receive beam that follows the depth, w1 = sqrt(2) w0, so that 1 / w^2 = 1 / w_t^2 + 1 / w1^2.
class Beam {
public:
    Beam(const Transducer& transducer, const Settings& settings);

    float wavelength() const noexcept { return wavelength_; }
    float axialSigma() const noexcept { return axialSigma_; }  // [m]
    float lateralSigma(float z) const noexcept;                // [m]
    float elevationSigma(float z) const noexcept;              // [m]
    float megahertz() const noexcept { return 1e-6F * settings_.frequency; }

    bool curved() const noexcept { return transducer_.shape == ProbeShape::curved; }
    float lineAt(float i) const noexcept { return (i - 0.5F * static_cast<float>(settings_.lines - 1)) * pitch_; }
    float pitch() const noexcept { return pitch_; }    // between lines: of l
    float sample() const noexcept { return sample_; }  // between samples [m]
    /// Metres along the picture that one of l is at depth z.
    float metresPerLine(float z) const noexcept { return curved() ? transducer_.radius + z : 1.0F; }
    /// Offset of plane `e` [sigmas of the elevation beam].
    float plane(int e) const noexcept;
    /// The point (l, y, z) in the probe's frame: lateral, elevation, axial [m].
    glm::vec3 point(float l, float y, float z) const noexcept;
    glm::vec3 direction(float l) const noexcept;
    /// Of the picture: half its width, and its upper border, which is above 0 for curved probes [m].
    float halfWidth() const noexcept;
    float top() const noexcept { return curved() ? transducer_.radius * (std::cos(0.5F * transducer_.sector) - 1) : 0.0F; }
    /// (l, z) of a point of the picture's plane.
    glm::vec2 place(float lateral, float axial) const noexcept;

    const Transducer& transducer() const noexcept { return transducer_; }
    const Settings& settings() const noexcept { return settings_; }

private:
    Transducer transducer_;
    Settings settings_;
    float wavelength_, axialSigma_, pitch_, sample_;
};

inline constexpr float planeReach = 1.6F;  // how far the outer planes are off [sigmas]

}  // namespace palpate::ultrasound
