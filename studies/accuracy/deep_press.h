#pragma once

#include <datasets/scene.h>
#include <haptics/session_model.h>
#include <studies/kernel/kernel_trial.h>
#include <studies/kernel/trial_path.h>

#include <cstddef>
#include <filesystem>
#include <istream>
#include <span>
#include <string>
#include <vector>

namespace palpate::studies {

/// Whether a tool goes into the tissue, stays where it is deepest, or is drawn back.
enum class PressWay : std::uint8_t { in, hold, out };
const char* wayName(PressWay way) noexcept;

/// The force on a tool that is pressed straight in at a scene's entry, by finite elements.
struct DeepReference {
    PressWay way = PressWay::in;
    double depth = 0;  // below the first touch at rest [m]
    Vec3 force{0.0};   // on the tool [N]
    double edges = 0;  // of the mesh at the contact [m]
    std::size_t elements = 0;
};

/// All references of one tool in one scene.
struct DeepCase {
    std::string scene;  // a built-in one
    TrialTool tool;     // sphere, or a capsule that is pressed end on; its name is for people: "sphere 10 mm"
    std::vector<DeepReference> references;

    double deepest() const noexcept;  // [m]
};

/// Reads the table of studies/accuracy/references/deep.csv: cases in the order in which they begin.
/// @param origin  what messages call the file
/// Throws std::runtime_error ("ORIGIN:LINE: what is wrong").
std::vector<DeepCase> readDeepCases(std::istream& in, const std::string& origin);
/// The same of a file.
std::vector<DeepCase> loadDeepCases(const std::filesystem::path& file);

/// A place of the contact in the grid of cells: how far the grid is shifted to the side. Tissue and tool stay where they
/// are, so that one reference holds for all.
struct GridPlace {
    double across = 0, along = 0;  // in x and z [cells]
    int weight = 1;                // of places that are like it by symmetry, of a cell with 4 x 4 places
};
/// The six places of a cell with 4 x 4 that symmetry leaves. Weights sum up to 16.
std::span<const GridPlace> gridPlaces() noexcept;

/// Our force beside the reference's.
struct DeepLook {
    std::size_t place = 0;  // index in gridPlaces()
    PressWay way = PressWay::in;
    double depth = 0;     // [m]
    Vec3 force{0.0};      // on the tool [N]
    Vec3 reference{0.0};  // [N]
    double edges = 0;     // of its mesh at the contact [m]

    double errorPercent() const noexcept;      // of the magnitude, signed
    double directionDegrees() const noexcept;  // between both
};

/// How far a press has come: radius a = sqrt(R d) of the contact as Hertz has it, in cells h, and depth d over radius R.
enum class DeepZone : std::uint8_t {
    faint,    // a < h / 2
    touch,    // to 1.5 h, or to R
    middle,   // to R
    deep,     // to 1.5 R
    deepest,  // beyond
};
DeepZone zoneOf(double depth, double radius, double spacing) noexcept;

/// A case at one setting of level elastic.
struct DeepPress {
    double spacing = 0;  // of the finest nodes [m]
    std::vector<DeepLook> looks;
    double pull = 0;        // largest force into the body in any tick [N]
    TickTimes times;        // processor time of ticks in contact
    std::size_t ticks = 0;  // in contact
};

struct DeepOptions {
    double speed = 20e-3;  // [m/s]
    std::span<const GridPlace> places = gridPlaces();
};

/// Presses from 0.5 mm above the surface to the deepest reference, holds for 0.2 s, and draws back to where it began, one
/// tick per ms as a session has them. A depth between two ticks is interpolated. References of the way in are those of the
/// way out, too, where that has none of its own: tissue without friction and viscosity has one force for a depth.
/// @param model  of the case's scene; level and setting are not its own
/// Throws std::runtime_error when there is no soft tissue under the entry, or a force is not finite.
DeepPress pressDeep(const haptics::SessionModel& model, const DeepCase& what, const datasets::ElasticSettings& settings,
                    const DeepOptions& options);

}  // namespace palpate::studies
