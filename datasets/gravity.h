#pragma once

#include <volume/geometry.h>

#include <array>
#include <string_view>

namespace palpate::datasets {

/// How a patient lies or stands, and where things fall then.
struct PatientPosture {
    std::string_view name;  // in scenes
    Vec3 down{0.0};         // unit vector, patient frame LPS; zero: nothing falls
};
/// Those that scenes know by name.
inline constexpr std::array<PatientPosture, 6> patientPostures{{{"unloaded", {0, 0, 0}},
                                                                {"supine", {0, 1, 0}},
                                                                {"prone", {0, -1, 0}},
                                                                {"left-side", {1, 0, 0}},
                                                                {"right-side", {-1, 0, 0}},
                                                                {"standing", {0, 0, -1}}}};

/// Gravity of a scene: the posture that the volume's shape was taken in, and that of the session.
struct GravitySpec {
    bool given = false;      // the scene says something of gravity
    Vec3 down{0.0};          // in the session, unit vector; zero: unloaded
    Vec3 shapeDown{0.0};     // when the shape was taken, unit vector; zero: it is the unloaded one
    double strength = 9.81;  // [m/s^2]
    double modulus = 1;      // of all tissue while its posture is computed, in the table's [-]
};

}  // namespace palpate::datasets
