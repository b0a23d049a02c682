#pragma once

#include <volume/geometry.h>

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

namespace palpate::datasets {

enum class ProbeKind : std::uint8_t { none, linear, curved };
/// Their names in scenes, in the order of the enum.
inline constexpr std::array<std::string_view, 3> probeKinds{"none", "linear", "curved"};

/// How far a probe is from where it begins.
struct ProbeMove {
    double press = 0;  // along its axis into the body [m]
    double slide = 0;  // along its face [m]
    double sweep = 0;  // across the picture's plane [m]
    double rock = 0;   // turned within the picture's plane about the middle of its face [rad]
    double tilt = 0;   // turned about the line along its face: the picture fans [rad]
    double turn = 0;   // turned about its axis [rad]

    bool operator==(const ProbeMove&) const = default;
};
ProbeMove operator+(const ProbeMove& a, const ProbeMove& b) noexcept;

/// Where the probe is at one moment; between two moments it goes straight.
struct ProbeStep : ProbeMove {
    double time = 0;  // of the session [s]
};

/// The ultrasound probe of a scene.
struct ProbeSpec {
    ProbeKind kind = ProbeKind::none;  // none: the viewer may put one on the skin where it likes
    bool overTarget = false;           // face, directions and the needle's way are chosen with the session's model
    Vec3 face{0.0};                    // middle of its face at first [m]
    Vec3 direction{0, 1, 0};           // into the body, unit vector
    Vec3 lateral{1, 0, 0};             // along its face, unit vector across `direction`
    double depth = 0;                  // of the picture [m]; 0: the probe's own
    double frequency = 0;              // [Hz]; 0: the probe's own
    double focus = 0;                  // [m]; 0: the probe's own
    std::vector<ProbeStep> script;     // by time; none: it stays
};

/// A pose of the probe, patient frame.
struct ProbePlace {
    Vec3 face{0.0};           // middle of its face [m]
    Vec3 direction{0, 1, 0};  // into the body, unit vector
    Vec3 lateral{1, 0, 0};    // along its face, unit vector
};

/// How far the probe's script has moved it at `time` [s]. Allocates nothing.
ProbeMove scriptedMove(const ProbeSpec& probe, double time) noexcept;
/// Where a probe is that has moved so: shifted along its first axes, then turned, tilted and rocked, in this order.
ProbePlace probeAfter(const ProbeSpec& probe, const ProbeMove& move) noexcept;

}  // namespace palpate::datasets
