#pragma once

#include <chainmail/level.h>
#include <datasets/scene.h>
#include <haptics/tick.h>
#include <ultrasound/transducer.h>
#include <volume/scalar_field.h>

#include <array>
#include <optional>
#include <span>

namespace palpate::haptics {

/// Of a needle, what the ultrasound picture has.
struct NeedleInBeam {
    double length = 0;  // of the shaft in tissue, in the picture [m]
    bool tip = false;   // the tip is in the picture
};

/// The ultrasound probe that a scene holds: a body that presses, and a beam that sees. It allocates nothing after it is
/// made.
///
/// It presses with its lens and housing: along the face a bar with rounded edges, linear probes straight, curved ones in
/// straight pieces that are at most 0.1 mm off the arc. Without friction: there is gel.
class Probe {
public:
    /// @param spec  of the scene; of kind `none` it neither presses nor sees
    explicit Probe(const datasets::ProbeSpec& spec);

    /// Puts it where script and hand have moved it.
    /// @param move  from where the scene has it at first    @param surface  of the body at rest
    void place(const datasets::ProbeMove& move, const volume::DistanceField& surface) noexcept;

    const datasets::ProbePlace& at() const noexcept { return at_; }
    /// From the middle of its face to the outer edge of its housing, along the face [m].
    double halfLength() const noexcept;
    /// What presses the tissue there.
    std::span<const chainmail::ElasticTool> tools() const noexcept { return std::span(tools_).first(count_); }

    /// What of a needle the picture has: what is within half the width of the beam (-6 dB, at its depth) and a radius of
    /// the needle from the picture's plane, between the picture's sides, and no deeper than it.
    /// @param tip      of the needle, patient frame [m]    @param axis  unit vector towards the tip
    /// @param length   of the shaft that is in tissue, behind the tip [m]    @param radius  of the needle [m]
    NeedleInBeam look(Vec3 tip, Vec3 axis, double length, double radius) const noexcept;

    static constexpr double edge =
        5e-3;  // radius of the face across the picture, assumed: housings are 8 to 12 mm wide [m]

private:
    bool sees(Vec3 p, double radius) const noexcept;

    datasets::ProbeSpec spec_;
    std::optional<ultrasound::Beam> beam_;
    datasets::ProbePlace at_;
    std::array<chainmail::ElasticTool, chainmail::ElasticLevel::maxOthers> tools_{};
    std::size_t count_ = 0;
};

}  // namespace palpate::haptics
