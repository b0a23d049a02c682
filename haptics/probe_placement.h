#pragma once

#include <haptics/session_model.h>

#include <span>

namespace palpate::haptics {

/// Where a probe over the target lies, and the way of a needle in its picture.
struct ProbePlan {
    Vec3 face{0.0};       // on the skin [m]
    Vec3 direction{0.0};  // into the body, towards the target; unit vector
    Vec3 lateral{0.0};    // to the side that the needle comes from; unit vector
    datasets::Approach approach;
};

/// Lays a linear or curved probe on the skin where it is nearest to the target, and looks all around for a needle's way in
/// beside it, in the picture's plane, at 10 to 50 degrees to the face: of those that a WayJudge lets pass, the one that
/// keeps farthest from vital structures, up to 4 mm; of these the shortest.
/// @param scene       its target, tool and kind of probe; with `entry` the needle comes from there, and the picture holds
/// it
/// @param surface     distance to the body at rest    @param structures  target first
/// Throws std::runtime_error when there is no such way.
ProbePlan planProbe(const datasets::Scene& scene, const volume::Tissue& tissue, const volume::DistanceField& surface,
                    std::span<const GuardedStructure> structures);

}  // namespace palpate::haptics
