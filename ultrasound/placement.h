#pragma once

#include <ultrasound/medium.h>
#include <ultrasound/transducer.h>

#include <optional>

namespace palpate::ultrasound {

/// A probe on the skin for a needle along the line from `entry` to `aim` [m], in the body at rest: the picture's plane
/// holds the line, the aim is in the picture, the face lies on the skin beside the needle's way in, and the needle is as
/// broadside to the beams as the skin allows; the needle comes from the marked side.
/// Where entry and aim are the same, the line is taken from the middle of the body to its front.
/// Nothing where no such place is.
std::optional<Pose> placeProbe(const Medium& medium, const Beam& beam, glm::dvec3 entry, glm::dvec3 aim);

/// How an examination of a session begins.
struct Examination {
    Transducer transducer;
    Settings settings;
    Pose pose;          // where no hand of the session holds the probe
    bool held = false;  // the scene holds the probe: its pose is that of each tick
};

/// Where the scene holds no probe: linear, and curved for a line over 45 mm. If the aim is too deep for the linear probe's
/// picture, that is up to 60 mm deep; if it is still not in it, the other probe. If neither has it, the first one lies
/// along the line, from where that enters.
Examination examinationOf(const channel::Scenery& scenery, const Medium& medium);

/// How a probe is moved by hand.
struct ProbeMove {
    double slide = 0, sweep = 0;  // along its face, across the picture [m]
    double rock = 0, turn = 0;    // within the picture's plane, about the probe's axis [rad]
    double press = 0;             // into the body [m]
    double tilt = 0;              // about the line along its face: the picture fans [rad]

    bool operator==(const ProbeMove&) const = default;
    ProbeMove& operator+=(const ProbeMove& more) noexcept;
};

/// The probe moved so and laid on the skin at rest again, however it was pressed; where there is no skin it stays.
Pose movedOnSkin(const Medium& medium, const Examination& examination, const ProbeMove& move);

/// Where the probe is at a tick.
Pose poseAt(const Examination& examination, const channel::State& state);

}  // namespace palpate::ultrasound
