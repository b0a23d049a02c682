#pragma once

#include <channel/deformation.h>
#include <channel/layout.h>
#include <ultrasound/display.h>
#include <ultrasound/rays.h>
#include <ultrasound/scatterers.h>
#include <ultrasound/spread.h>

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace palpate::ultrasound {

enum class Stage : std::uint8_t { rays, blocks, scatterers, axial, lateral, grey, count };
inline constexpr std::size_t stageCount = static_cast<std::size_t>(Stage::count);
inline constexpr std::array<std::string_view, stageCount> stageNames{"rays",  "blocks",  "scatterers",
                                                                     "axial", "lateral", "grey"};

/// A point that echoes, for checks: fixed in the tissue at rest.
struct PointTarget {
    glm::dvec3 rest{0.0};  // patient frame [m]
    float level = 40;      // [dB over fat]
};

/// What of the physics is there; all of it but for checks.
struct Physics {
    bool speckle = true, interfaces = true;
    float variation = 1;  // of echoes within a tissue, 0 to 1
    float noise = -118;   // [dB of a mirror]
    std::vector<PointTarget> points;
};

/// A B-mode scanner on a body. Everything it gives is a function of body, state, pose and settings, bit for bit.
class Scanner {
public:
    /// Builds the medium from the scenery: a second or less. The spans need not outlive it.
    Scanner(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint8_t> fine);

    /// The picture of the body as `body` has it deformed and of the tool as `state` has it; state.tick chooses the noise.
    void scan(const Transducer& transducer, const Settings& settings, const Pose& pose, const channel::Deformation& body,
              const channel::State& state, BeamImage& out);
    /// The square of the last picture's envelope [a perfect mirror = 1] (samples x lines).
    void power(std::vector<float>& out) const { spread_.power(out); }

    void setPhysics(const Physics& physics);
    const Medium& medium() const noexcept { return medium_; }
    /// Tells bodies apart: a hash of the labels at rest, of where they lie and of what their tissues do to sound. Never 0.
    std::uint64_t body() const noexcept { return body_; }
    std::size_t blocks() const noexcept { return scatterers_.blocks(); }
    /// CPU time of each stage of the last picture [s].
    const std::array<double, stageCount>& seconds() const noexcept { return seconds_; }

private:
    Needle needleIn(const View& view, const channel::State& state) const;

    channel::Scenery scenery_;
    Medium medium_;
    std::uint64_t body_ = 0;
    Physics physics_;
    RayCaster rays_;
    Scatterers scatterers_;
    PointSpread spread_;
    Shade shade_;
    EchoLines echoes_;
    std::array<double, stageCount> seconds_{};
};

}  // namespace palpate::ultrasound
