#pragma once

#include <datasets/probe.h>
#include <volume/geometry.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>

namespace palpate::haptics {

inline constexpr double tickSeconds = 1e-3;  // the usual period of the loop [s]
/// Forces are ramped up after the start of a session: a prescribed path touches nothing before [s].
inline constexpr double settledAfter = 0.6;

inline constexpr std::size_t maxStructures = 16;  // target first, then the lookup table of vital structures
inline constexpr std::size_t maxTissues = 64;
inline constexpr std::size_t maxEventsPerTick = 16;
inline constexpr std::size_t maxMarks = 32;  // of a session; further ones do not count

inline constexpr std::uint32_t buttonDeadMan = 1U << 0;  // held: forces are on
inline constexpr std::uint32_t buttonFire = 1U << 1;     // the biopsy gun
inline constexpr std::uint32_t buttonMark = 1U << 2;     // "here": the trainee marks the place of the tool
inline constexpr std::uint32_t buttonUnmark = 1U << 3;   // takes the last mark back
inline constexpr std::uint32_t buttonPicture = 1U << 8;  // stores the ultrasound picture, or takes a CT scan
inline constexpr std::uint32_t modelTooSlow = 1U << 30;  // the loop cannot keep up: use a cheaper model from now on
inline constexpr std::uint32_t poseInvalid = 1U
                                             << 31;  // the pose was none (not finite, out of bounds); records keep the last

/// What a device says in one tick.
struct DeviceSample {
    Vec3 position{0.0};           // of the tool's tip (sphere: its centre), patient frame [m]
    Vec3 axis{0, 1, 0};           // unit vector along the tool, towards the tip
    std::uint32_t buttons = 0;    // button.. and the two marks above, added up
    bool fresh = true;            // false when the device had no new pose for this tick
    datasets::ProbeMove probe{};  // of the hand that holds the ultrasound probe, beside the scene's script
};

/// A button that is heeded once as it goes down.
struct PressedButton {
    std::uint32_t button;  // button.. and the two marks above
    bool down = false;     // in the last sample

    /// Whether it has gone down with this sample.
    bool with(const DeviceSample& sample) noexcept
    {
        const bool before = std::exchange(down, (sample.buttons & button) != 0);
        return down && !before;
    }
};

/// The tasks of the thesis (Table 1) that run in every tick, in their order, and the deformation.
enum class Task : std::uint8_t { h2, h3, h4, deform, h6, h7, h5, count };
inline constexpr std::size_t taskCount = static_cast<std::size_t>(Task::count);
inline constexpr std::array<std::string_view, taskCount> taskNames{"H2", "H3", "H4", "deform", "H6", "H7", "H5"};
constexpr std::string_view name(Task task) noexcept
{
    return taskNames[static_cast<std::size_t>(task)];
}

enum class Phase : std::uint8_t { free, contact, inserted };
inline constexpr std::array<std::string_view, 3> phaseNames{"free", "contact", "inserted"};

enum class EventKind : std::uint8_t {
    contact,       // the tool touched the body; tissue: touched; value: how far it went on in this tick [m]
    release,       // the tool left the body
    puncture,      // tissue: entered; value: force at which it gave way [N]
    warning,       // structure: came nearer than its warning distance; value: distance [m]
    vitalTouch,    // structure: was touched by the tool's surface; value: how deep that is in it [m]
    fire,          // the gun; value: distance from the notch's middle to the target's surface [m]
    fault,         // a force was not finite; the output is zero from now on
    stepDown,      // ticks came late: a cheaper model from now on; value: how many steps down from the scene's
    veryNear,      // structure: came nearer than 0.4 of its warning distance; value: distance [m]
    fireRefused,   // the gun's button went down and the needle was not inside, or its tip was at bone; tissue: that bone
    throwStopped,  // bone stopped the needle that the gun threw; tissue: that bone; value: how far it got [m]
};
inline constexpr std::array<std::string_view, 11> eventNames{"contact",     "release",      "puncture",     "warning",
                                                             "vital touch", "fire",         "fault",        "step down",
                                                             "very near",   "fire refused", "throw stopped"};
constexpr std::string_view name(EventKind kind) noexcept
{
    return eventNames[static_cast<std::size_t>(kind)];
}

/// How urgent the warning of a vital structure is (task H8). Each level starts with an event: warning, veryNear,
/// vitalTouch.
enum class WarningLevel : std::uint8_t { none, near, veryNear, touch };
inline constexpr std::array<std::string_view, 4> warningNames{"none", "near", "very near", "touch"};

/// What lies ahead on the needle's line, in the deformed tissue; infinite where nothing does within reach.
struct LookAhead {
    double tissueDistance = std::numeric_limits<double>::infinity();  // from the tip to the next tissue [m]
    std::uint8_t tissue = 0;                                          // its row
    std::array<double, maxStructures> structure = [] {
        std::array<double, maxStructures> none{};
        none.fill(std::numeric_limits<double>::infinity());
        return none;
    }();               // from the tip to where the needle would touch each structure [m]
    double speed = 0;  // of the tip along the needle, low-passed [m/s]

    /// When the needle is there at this speed [s]; infinite while it does not come nearer.
    double seconds(double distance) const noexcept
    {
        return speed > 1e-3 ? distance / speed : std::numeric_limits<double>::infinity();
    }
};

/// Something that happened in a tick.
struct Event {
    EventKind kind = EventKind::contact;  // says which of the others count, see there
    std::uint8_t structure = 0xFF;        // index in the session's structures, 0xFF = none
    std::uint8_t tissue = 0;              // row of the tissue table
    double value = 0;                     // see EventKind, in SI units
};

/// The tissue in the notch when the gun fired, in rest space.
struct CoreSample {
    std::array<double, maxTissues> fraction{};  // by row of the tissue table; sums to 1 when anything is in the notch
    double volume = 0;                          // of tissue [m^3]
    double targetFraction = 0;                  // fraction of the target structure
    double targetLength = 0;                    // length of the notch's axis inside the target [m]
    std::uint32_t fragments = 0;                // pieces that the core comes out in
    Vec3 notchStart{0.0};                       // patient frame [m]
    Vec3 notchEnd{0.0};                         // patient frame [m]
    Vec3 restStart{0.0};                        // where notchStart was at rest [m]
    Vec3 restEnd{0.0};                          // and notchEnd [m]
};

/// Everything that one tick computed. A pure function of the model and of the samples up to here, but for `seconds`.
struct TickRecord {
    std::uint64_t tick = 0;  // from 0 up, without gaps
    DeviceSample device;     // what the device said
    Vec3 proxy{0.0};         // where the tip would be without penetration [m]
    Vec3 tissueForce{0.0};   // what the tissue does to the tool, before the controller: not coupled, damped or capped [N]
    Vec3 basic{0.0};         // F_BFFB, equation 2, as sent [N]
    Vec3 additional{0.0};    // F_AFFB, equations 3-8 [N]
    Vec3 total{0.0};         // F_DFFB as sent: with the controller's damping [N]
    double energy = 0;       // net, that all forces so far gave to the hand [J]
    double damped = 0;       // that the controller's damping took from it so far [J]
    Phase phase = Phase::free;                     // of the tool
    std::uint8_t tissue = 0;                       // row of the tissue table at the tip
    std::uint8_t nearestVital = 0xFF;              // index of a structure
    WarningLevel warning = WarningLevel::none;     // the most urgent one
    std::uint8_t warned = 0xFF;                    // index of the structure that the warning is about
    bool fired = false;                            // the gun, in this tick
    bool faulted = false;                          // a force or a pose was not finite: zero from then on
    double inserted = 0;                           // length of the shaft inside [m]
    Vec3 deflection{0.0};                          // of a bent needle's tip from the device's position [m]
    std::array<double, maxStructures> distance{};  // tip to each structure, in the deformed tissue [m]
    LookAhead ahead;                               // in front of the tip
    std::uint32_t contacts = 0;                    // elements of tissue that the tool touches
    double penetration = 0;      // of the tool below the deformed surface, at level elastic without `behind` (HeldTool) [m]
    std::uint32_t moved = 0;     // nodes that the deformation moved
    double residual = 0;         // largest violated link that the work cap left over [m]
    CoreSample core;             // when fired
    Vec3 probeFace{0.0};         // of the ultrasound probe, where the scene holds one: middle of its face [m]
    Vec3 probeAxis{0, 1, 0};     // unit vector into the body
    Vec3 probeLateral{1, 0, 0};  // unit vector along the face
    Vec3 probeForce{0.0};        // that the body presses it back with; only level `elastic` knows it [N]
    double needleInBeam = 0;     // of the needle's shaft in tissue, what the ultrasound picture has [m]
    bool tipInBeam = false;      // the picture has its tip
    std::array<Event, maxEventsPerTick> events{};  // in their order; the first eventCount count
    std::uint32_t eventCount = 0;                  // of this tick
    std::array<float, taskCount> seconds{};        // by task, wall time [s]

    /// Where the tool's tip is, as its bend has moved it (sphere: its centre) [m].
    Vec3 tip() const noexcept { return device.position + deflection; }
};

}  // namespace palpate::haptics
