#pragma once

#include <array>
#include <cstdint>
#include <type_traits>

/// What lies in the shared memory between the simulation and its viewers: plain data, no pointers, no VTK.
///
///     Header      magic, version, layout hash, offsets     written once
///     Scenery     names, colours, grids, tool, line        written once
///     labels      tissue row and shellBit per voxel        written once
///     image       code of its intensity per voxel          written once; only of bodies that came with an image
///     fine        tissue row per voxel of scenery.fine     written once; only where the body is finer than the labels
///     State       sequence lock                            every tick
///     Input       sequence lock, in a page of its own      by the viewer whose mouse is the hand
///     Displaced   four slots, a sequence lock each         at frame rate
///
/// Lengths in metres, forces in newtons, patient frame LPS.
namespace palpate::channel {

inline constexpr std::uint64_t magic = 0x31455441504c4150;  // "PALPATE1"
inline constexpr std::uint32_t version = 9;
inline constexpr std::uint64_t frameTicks = 33;  // from one publication of displaced nodes to the next: 30 a second
inline constexpr std::size_t maxTissues = 64;
inline constexpr std::size_t maxStructures = 16;
inline constexpr std::size_t maxWindows = 4;
inline constexpr std::size_t maxDisplaced = 1U << 16;
inline constexpr std::size_t maxHoles = 8;
inline constexpr std::size_t maxMarks = 32;
inline constexpr double lookAheadReach = 40e-3;  // from the tip, along the needle [m]
inline constexpr std::size_t nameLength = 32;
/// Of a display voxel: the row of its tissue, and whether it lies on the border of a vital structure's warning distance.
inline constexpr std::uint8_t rowBits = maxTissues - 1, shellBit = 0x80;

using Name = std::array<char, nameLength>;  // ends with '\0'
using Triple = std::array<double, 3>;

/// A cubic grid aligned with the patient axes, x fastest.
struct Grid {
    std::array<std::int32_t, 3> size{};
    std::int32_t padding = 0;
    Triple origin{};     // of node (0, 0, 0) [m]
    double spacing = 0;  // [m]
};

struct TissueLook {
    Name name{};
    std::array<float, 3> colour{};  // RGB in [0, 1]
    float opacity = 0;
};

/// What a tissue does to ultrasound, see volume::Acoustics.
struct TissueSound {
    float soundSpeed = 0;  // [m/s]
    float density = 0;     // [kg/m^3]
    float attenuation = 0, attenuationPower = 0;
    float echo = 0, echoVariation = 0;  // [dB]
    std::uint32_t pattern = 0;          // 0 even, 1 lobules, 2 fibres, 3 septa
};

/// A range of an image's values that is shown from black to white.
struct GreyWindow {
    Name name{};
    double low = 0, high = 0;  // in the image's unit
};

/// Scenery::viewersHand: who holds the tool.
inline constexpr std::uint32_t handElsewhere = 0,  // viewers only look on
    handIsViewers = 1,                             // the mouse or the keys of a viewer
    handIsDevices = 2;                             // a haptic device; a viewer may pause the session and end it

enum class ToolKind : std::uint32_t { sphere, needle, capsule };
enum class ProbeKind : std::uint32_t { none, linear, curved };
/// What the trainee is asked for, see datasets::SessionTask.
enum class Task : std::uint32_t { biopsy, find, touch, advance };

/// What does not change during a session.
struct Scenery {
    Name scene{};
    Grid labels;   // grid of the display label volume
    Grid lattice;  // grid of the displaced nodes
    std::uint32_t tissues = 0;
    std::uint32_t structures = 0;  // target first, then the vital structures of the lookup table
    std::array<TissueLook, maxTissues> tissue{};
    std::array<Name, maxStructures> structure{};
    std::array<double, maxStructures> warnDistance{};
    ToolKind tool = ToolKind::needle;
    std::uint32_t viewersHand = handElsewhere;
    double toolRadius = 0;
    double toolLength = 0;
    Triple entry{};
    Triple aim{};
    double forceCap = 0;
    double throwLength = 0;  // of the biopsy gun [m]
    // Of the intensity image, whose value at a display voxel is imageLow + imageStep * code.
    std::uint32_t windows = 0;  // to choose from, the best one first; 0: there is no image
    std::uint32_t padding = 0;
    std::array<GreyWindow, maxWindows> window{};
    Name imageUnit{};  // "HU"; empty: not known
    double imageLow = 0;
    double imageStep = 0;
    // Of the ultrasound picture.
    std::array<TissueSound, maxTissues> sound{};
    Grid fine;                          // of the fine labels; size 0: there are none
    ProbeKind probe = ProbeKind::none;  // that the scene holds; none: a viewer puts one on the skin where it likes
    std::uint32_t soundPadding = 0;
    double probeDepth = 0, probeFrequency = 0,
           probeFocus = 0;  // that the scene asks for [m], [Hz], [m]; 0: the probe's own
    double holeRadius = 0;  // of State::hole [m]
    // Of a CT scan, which the scene has on demand; 0 slices: it has none.
    std::uint32_t ctSlices = 0;
    Task task = Task::biopsy;
    double ctWidth = 0;       // of a slice [m]
    double ctDoseIndex = 0;   // CTDIvol of a scan [mGy]
    double ctDoseLength = 0;  // of a scan [mGy cm]
    Name who{};               // trains: a name or a pseudonym; empty: not known
};

enum class Phase : std::uint32_t { free, contact, inserted };
enum class Warning : std::uint32_t { none, near, veryNear, touching };
enum class Status : std::uint32_t { running, finished, faulted };
/// A session that has been paused; toolElsewhere: it is to go on, and waits for the tool to come back to where it was.
enum class Standing : std::uint32_t { no, paused, toolElsewhere };

/// Where a core was taken, at rest: the middles of its ends [m].
struct Hole {
    std::array<float, 3> from{}, to{};
};

/// A place that the trainee marked.
struct Mark {
    std::array<float, 3> place{};        // of the tool, on what it touched [m]
    std::array<float, 3> axis{0, 1, 0};  // of the tool, unit vector from its shaft to its tip
};

/// Where the ultrasound probe is; of a scene that holds one.
struct ProbePose {
    Triple face{};            // middle of its face [m]
    Triple axial{0, 1, 0};    // unit vector into the body
    Triple lateral{1, 0, 0};  // unit vector along the face, towards the marked side
    double force = 0;         // that the body presses back with [N]
};

/// State::missed of a session that keeps no clock, and of a record that does not say it.
inline constexpr std::uint64_t notCounted = ~std::uint64_t{0};

/// The state of one tick.
struct State {
    std::uint64_t tick = 0;
    double time = 0;  // of the session [s]
    Triple tip{};     // of the tool (sphere: centre; capsule: middle of its front end)
    Triple axis{};    // unit vector, from the shaft to the tip
    Triple bend{};    // of the tip off the line of the shaft outside, across the axis [m]
    Triple proxy{};   // where the tip would be without penetration
    Triple basic{}, additional{}, total{};
    Phase phase = Phase::free;
    Status status = Status::running;
    Warning warning = Warning::none;
    std::uint32_t warned = 0;     // index of the structure that the warning is about
    std::uint32_t tissue = 0;     // row of the tissue table at the tip
    std::uint32_t cores = 0;      // samples taken
    std::uint32_t bestCore = 0;   // the one with the largest share of target, from 1; 0: none
    std::uint16_t refusedBy = 0;  // row of the bone in whose way the gun did not fire; 0: the needle was not inside
    std::uint16_t stoppedBy = 0;  // row of the bone that stopped a throw
    double inserted = 0;          // length of the shaft inside [m]
    std::array<double, maxStructures> distance{};  // tip to structure, in the deformed tissue [m]
    // From the tip to where the needle's line touches it; infinite: not within lookAheadReach, nor within the throw [m].
    std::array<double, maxStructures> ahead{};
    double aheadTissueDistance = 0;  // tip to the next tissue on that line; infinite: nowhere near [m]
    double aheadSpeed = 0;           // of the tip along it [m/s]
    std::uint32_t aheadTissue = 0;   // row of the tissue table
    std::uint16_t rested = 0;        // on the skin so far, and not inside; 65535 stands for more [ms]
    std::uint16_t reached = 0;       // 1: the tip has been in the target
    double coreTarget = 0;           // fraction of target tissue in the last core
    double coreLength = 0;           // length in the target of the last core [m]
    double bestTarget = 0;           // fraction of target tissue in bestCore
    double refused = -1;             // when the gun did not fire [s]; below 0: never
    double stopped = -1;             // when bone stopped the needle that the gun threw [s]; below 0: never
    double thrown = 0;               // how far that got [m]
    ProbePose probe;
    std::uint32_t holes = 0;  // cores so far that are in `hole`: the last maxHoles
    Standing standing = Standing::no;
    std::uint32_t pictures = 0;     // that the hand asked for so far: stored ultrasound pictures, or CT scans
    std::uint32_t pictureHeld = 0;  // 1: its button is down
    std::array<Hole, maxHoles> hole{};
    std::uint32_t marks = 0;     // places that are marked: the first ones of `mark`; there are no more than maxMarks
    std::uint32_t markHeld = 0;  // 1: its button is down, 2: that which takes a mark back, 3: both
    std::array<Mark, maxMarks> mark{};
    std::uint64_t missed = 0;     // ticks; notCounted where nobody counts them
    double tickP99 = 0;           // [s]
    std::uint64_t published = 0;  // CLOCK_MONOTONIC when written [ns]
};

/// What the user of a viewer asks of the simulation.
struct Input {
    Triple target{};       // of the tool's tip [m]
    Triple axis{0, 1, 0};  // unit vector, from the shaft to the tip
    // How far the other hand has moved the scene's ultrasound probe: press, slide, sweep [m], rock, tilt, turn [rad].
    std::array<double, 6> probe{};
    std::uint32_t held = 0;     // 1: the dead-man switch
    std::uint32_t ended = 0;    // 1: the session is to end, 2: and to begin anew
    std::uint32_t fires = 0;    // how often the gun was fired: counted, so that a short press is never between two looks
    std::uint32_t marks = 0;    // how often the place of the tool was marked
    std::uint32_t unmarks = 0;  // how often the last mark was taken back
    std::uint32_t padding = 0;
    std::uint32_t pictures = 0;  // how often the ultrasound picture was stored
    std::uint32_t paused = 0;    // 1: the session is to stand still
    std::uint64_t beat = 0;      // how often this was written: it stands still when the viewer is dead or stuck
};

/// One displaced node of the lattice.
struct Displacement {
    std::uint32_t node = 0;  // offset in the lattice grid
    std::array<float, 3> u{};
};

/// The displaced nodes of one moment; all others are at rest.
struct Displaced {
    std::uint64_t tick = 0;
    std::uint64_t publication = 0;  // of a viewer's copy: which one it is, from 1; 0: none yet
    std::uint32_t count = 0;
    std::uint32_t padding = 0;
    std::array<Displacement, maxDisplaced> nodes{};
};

static_assert(std::is_trivially_copyable_v<State> && std::is_trivially_copyable_v<Scenery> &&
              std::is_trivially_copyable_v<Displaced> && std::is_trivially_copyable_v<Input>);

}  // namespace palpate::channel
