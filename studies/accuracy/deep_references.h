#pragma once

#include <studies/kernel/trial_path.h>

#include <cstddef>
#include <filesystem>
#include <istream>
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

}  // namespace palpate::studies
