#pragma once

#include <datasets/ct.h>
#include <datasets/gravity.h>
#include <datasets/phantom.h>
#include <datasets/probe.h>
#include <volume/geometry.h>
#include <volume/law.h>
#include <volume/tissue.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::datasets {

/// `sphere`: its centre is the device's position. `capsule`: a rod with hemispherical ends, like a finger; the middle of
/// its front end is the device's position, that of the other end lies `length` behind, along the device's axis.
enum class ToolKind : std::uint8_t { sphere, needle, capsule };
/// Their names in scenes, records and on the command line, in the order of the enum.
inline constexpr std::array<std::string_view, 3> toolKinds{"sphere", "needle", "capsule"};

struct ToolSpec {
    ToolKind kind = ToolKind::needle;
    double radius = 1.05e-3;      // sphere, capsule, or needle shaft [m]; 14 G: 2.1 mm across
    double length = 0.12;         // of the needle; of the capsule between the middles of its ends [m]
    double throwLength = 0.022;   // of the biopsy gun [m]
    double notchLength = 0.020;   // [m]
    double notchRadius = 0.8e-3;  // inner radius of the notch [m]
    double tipLength = 4e-3;      // of the needle's conical tip [m]
    double bevel = 0;             // angle of a bevelled tip that bends the needle [rad]; 0 = symmetric, stays straight
    double bevelTurn = 0;         // about the needle: which way it bends [rad]

    /// Of the segment that its pressing surface goes around: 0 of a sphere and of a needle, which begins with its point
    /// [m].
    double pressedLength() const noexcept { return kind == ToolKind::capsule ? length : 0.0; }
};

/// A mass, damper and spring with a magnitude: one term of equation 3 of the thesis and its fraction of equations 6-8.
struct ForceTerm {
    double force = 0;      // magnitude [N]
    double mass = 0;       // [kg]
    double damping = 0;    // [N s/m]
    double stiffness = 0;  // [N/m]
};

enum class DffbMode : std::uint8_t { off, thesis, field };

/// Differential force feedback, equations 1-8 of the thesis.
struct DffbParameters {
    DffbMode mode = DffbMode::field;
    ForceTerm surgery, structure, tissue, task;  // set by the user
    double floorDistance = 2e-3;                 // distance in equation 4 never falls below this [m]
    double range = 15e-3;                        // `field`: no proximity force beyond this distance [m]
    double budget = 3.0;                         // `field`: most additional force in all [N]
    double gain = 1.0;                           // of all of it
    double fade = 0;                             // over which the gain falls to 0 from the session's start [s]; 0 = never
};

/// One row of the lookup table of vital structures, in the order of the procedure.
struct VitalStructure {
    std::string name;            // structure or tissue of the volume
    double gain = 1.0;           // of its proximity force
    double warnDistance = 5e-3;  // [m]
};

enum class ModelLevel : std::uint8_t { spring, chainmail, elastic };
/// Their names in scenes, records and on the command line, in the order of the enum.
inline constexpr std::array<std::string_view, 3> modelLevels{"spring", "chainmail", "elastic"};
constexpr std::string_view name(ModelLevel level) noexcept
{
    return modelLevels[static_cast<std::size_t>(level)];
}
/// @pre  one of modelLevels
constexpr ModelLevel modelLevelCalled(std::string_view name) noexcept
{
    const auto* const at = std::find(modelLevels.begin(), modelLevels.end(), name);
    assert(at != modelLevels.end());
    return static_cast<ModelLevel>(at - modelLevels.begin());
}

/// Level `elastic`: equilibrium on nested windows around the tool.
struct ElasticSettings {
    double spacing = 2e-3;  // of the finest window [m]; each window further out is twice as coarse
    int window = 13;        // nodes along each side of a window: odd, 9 to 41
    int cycles = 2;         // of the solver per tick, at most
    volume::Law law = volume::NeoHookean{};
    double poissonCap = 0.49;  // Poisson's ratios above are lowered to this [-], 0 to 0.499
    double friction = 0;       // of sphere and capsule on tissue (Coulomb) [-]

    bool operator==(const ElasticSettings&) const = default;
};

std::vector<std::string> elasticSettings();  // "fast", "default", "fine"
/// `base` with spacing, window and cycles of the setting called `name`; what it says of the tissue stays. Throws
/// std::runtime_error for a name that is not there.
ElasticSettings elasticSetting(const std::string& name, const ElasticSettings& base = {});

struct ModelSettings {
    ModelLevel level = ModelLevel::elastic;
    double spacing = 2e-3;            // of the ChainMail lattice [m]; widened when the body would need over maxNodes
    std::uint32_t maxMoves = 5000;    // node moves per tick; what is left over is reported as residual
    double stiffness = 0;             // level `spring`: K of equation 2 [N/m]; 0 = from the tissue at the contact
    bool relaxation = false;          // stress that is held falls by the tissue table's Prony series; not at level `spring`
    bool walls = false;               // needles meet the walls that the tissue table has inside a tissue
    std::string setting = "default";  // of level `elastic`: the one that `elastic` started from, see elasticSettings()
    bool settingNamed = false;        // the scene's text names a setting, or spacing, window or cycles of its own
    ElasticSettings elastic;
};

/// What the scripted trainee does next.
struct TraineeStep {
    // pierce: push on towards `to` until the tissue is felt to give way
    enum class Kind : std::uint8_t { move, press, fire, wait, pierce } kind = Kind::move;
    Vec3 to{0.0};             // where the tip shall be, patient frame [m] (move, press)
    double speed = 0.02;      // of the hand [m/s]
    double seconds = 0;       // wait: how long; move, press: give up after
    double tolerance = 1e-3;  // the step is done when the tip is this near [m]
    double depth = 0;         // press: and when so much of the needle is inside [m]; 0 = not asked
};

/// Something put into a volume, over what was there: a lesion, a vessel, a rib.
struct Insert {
    std::string name = "lesion";            // of the structure
    std::string tissue = "idc_high_grade";  // a row of the volume's tissue table
    Vec3 centre{0.0};                       // patient frame [m]
    std::optional<Vec3> to;                 // the other end of a rod with round ends [m]; nothing: a ball
    double diameter = 8e-3;                 // [m]
    bool spiculated = false;                // a ball with lobes and thin spikes, of the same volume
    std::uint64_t seed = 1;                 // of lobes and spikes
};

/// Where the volume of a scene comes from: a file, or a phantom when `file` is empty.
struct VolumeSource {
    std::filesystem::path file;
    PhantomSpec phantom;
    std::vector<Insert> inserts;  // one after the other
};

/// What a scene changes in one row of its volume's tissue table, by the keys of tissue tables and in their units.
struct TissueChange {
    std::string tissue;
    std::vector<std::pair<std::string, double>> values;  // e.g. youngs_kpa, 10
    // For errors, "FILE:LINE": of the section and of each value; empty where no file says it.
    std::string place{};
    std::vector<std::string> places{};
};

/// What the trainee is asked for: a core of the target; where it is and how large (palpation); to rest on the skin and not
/// to pierce it; or to bring the needle's tip into the target, with no core.
enum class SessionTask : std::uint8_t { biopsy, find, touch, advance };

/// Everything that a session needs, checked. Lengths in the patient frame, SI.
struct Scene {
    std::string name;
    std::string text;  // the TOML it was read from; parsing it again gives this scene (replay relies on it)
    VolumeSource source;
    std::string tissues;  // tissue table file; empty = built-in
    std::vector<TissueChange> tissueChanges;
    SessionTask task = SessionTask::biopsy;
    ToolSpec tool;
    ModelSettings model;
    DffbParameters dffb;
    std::string target;  // structure to sample
    std::vector<VitalStructure> vital;
    std::optional<Vec3> entry;        // where the needle shall enter [m]; nothing = chosen by planApproach()
    std::optional<Vec3> aim;          // the point to reach [m]; nothing = inside the target structure
    double forceCap = 8.5;            // [N]
    std::string device = "premium";   // the haptic device that the stabiliser reckons with, see haptics/arm.h
    std::vector<TraineeStep> script;  // empty = the standard biopsy along entry and aim
    ProbeSpec probe;
    CtSpec ct;
    GravitySpec gravity;
};

/// Reads a scene. Errors: "FILE:LINE: [dffb] range_mm = -4 mm: must be 0 to 100 mm". Unknown keys are errors, with the
/// nearest known key.
Scene loadScene(const std::filesystem::path& file);
/// As loadScene() from text; `origin` stands for the file in errors, and relative paths start at its folder.
Scene parseScene(const std::string& text, const std::filesystem::path& origin);

/// What a session is judged by: the task, and whether the tool can do a biopsy.
struct SceneAim {
    SessionTask task = SessionTask::biopsy;
    ToolKind tool = ToolKind::needle;
};
/// Of the text of a scene, as a record keeps it. A text that is no scene asks for a biopsy.
SceneAim aimOf(const std::string& sceneText);

std::vector<std::string> builtInScenes();  // their names, in order
std::optional<Scene> builtInScene(const std::string& name);
/// The structure of a volume that a biopsy is for: the first of role tumour, else the first with a name such as lesion,
/// mass or nodule; "" where there is none.
std::string lesionOf(const volume::Tissue& tissue);
/// The structure of largest volume that is not air; "" where there is none.
std::string largestStructure(const volume::Tissue& tissue);
/// The names of all structures that are not air.
std::vector<std::string> solidNames(const volume::Tissue& tissue);
/// The scene for a volume file alone: target = lesionOf(), vital = all of role vital. Throws std::runtime_error where there
/// is no lesion and no target is named.
Scene sceneForVolume(const std::filesystem::path& file, const volume::Tissue& tissue, const std::string& target = {});

/// The scene's volume: loads the file or makes the phantom.
volume::Tissue sceneVolume(const Scene& scene);

/// The straight line of a procedure.
struct Approach {
    Vec3 entry;             // on the surface of the body [m]
    Vec3 aim;               // inside the target [m]
    bool isPlanned = true;  // false: there is no way, of what is no session and needs none
};

/// Takes entry and aim of the scene where given, else searches the surface: shortest line to the middle of the target that
/// keeps away from vital structures, bone and fixed tissue, and is long enough for the notch to be centred on the aim.
/// The surface near the image's border is a cut and no place to enter. Throws std::runtime_error when there is none.
Approach planApproach(const Scene& scene, const volume::Tissue& tissue);

/// How deep the tip goes by hand, so that the fired notch's middle is at an aim `length` deep [m].
double firingDepth(const ToolSpec& tool, double length) noexcept;

/// The scene's script, or the standard biopsy: approach, press, puncture, advance short of the target, fire, withdraw. Task
/// `touch`: rest on the skin and lift off; `advance`: to the aim and back, without firing.
std::vector<TraineeStep> traineeScript(const Scene& scene, const Approach& approach);

}  // namespace palpate::datasets
