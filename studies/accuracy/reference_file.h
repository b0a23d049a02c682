#pragma once

#include <studies/kernel/kernel_trial.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

namespace palpate::studies {

/// Rises whenever the reference program would solve the same problem otherwise, so that what it solved before is not
/// taken any more.
inline constexpr int referenceVersion = 1;

/// Where a reference's tool presses. The rest of its path follows from tool and speed.
struct ReferencePress {
    Vec3 start{0.0};                  // of the sphere's middle [m]
    Vec3 inward{0.0}, sideways{0.0};  // unit vectors
    double press = 0;                 // from the start [m]
};

/// What a solved reference says of itself.
struct ReferenceInfo {
    std::string key;       // content hash of what was solved: see referenceKey()
    std::string scene;     // name
    std::string tool;      // TrialTool::name
    std::string law;       // "linear" or "neo-hookean"
    std::string elements;  // "P2" or "P2/P1"
    double speed = 0;      // the looks are those of schedule(path, speed) [m/s]
    std::size_t tets = 0;
    std::size_t unknowns = 0;
    double seconds = 0;                   // CPU time of the solution [s]
    std::string program;                  // that solved it, with its version
    std::string body;                     // key without the press, see referenceKey(); "" in files of before November 2026
    std::optional<ReferencePress> press;  // none in files of before November 2026
};

/// Displacements are kept to a 32,000th of the largest one of each state. Written beside and renamed. Throws
/// std::runtime_error ("FILE: what is wrong"), one line.
void saveReference(const std::filesystem::path& file, const Reference& reference, const ReferenceInfo& info);
std::pair<Reference, ReferenceInfo> loadReference(const std::filesystem::path& file);

/// Content hash of everything that the solution depends on: voxels (tissues, affine), tissue table, path, speed, law,
/// referenceVersion, and the bound of Poisson's ratio. 16 hexadecimal digits.
/// @param withPress  false: what presses which body, without ReferencePress. A scene's entry lies on the surface that is
///                   read from the voxels, and moves by hundredths of a millimetre when that is read otherwise
std::string referenceKey(const volume::Tissue& tissue, const TrialPath& path, double speed, const std::string& law,
                         double poissonCap = 0.49, bool withPress = true);

ReferencePress pressOf(const TrialPath& path);
/// The path with another press. Its ties stay where they are.
TrialPath pressedBy(TrialPath path, const ReferencePress& press);

}  // namespace palpate::studies
