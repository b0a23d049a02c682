#pragma once

#include <datasets/crossing.h>
#include <datasets/scene.h>
#include <volume/tissue.h>

#include <cstddef>
#include <optional>
#include <vector>

namespace palpate::datasets {

inline constexpr double comfort = 7e-3;  // clearance beyond which more is no better, and is not looked for [m]

/// A way to the target, and what speaks for it.
struct Proposal {
    Approach approach;
    double length = 0;     // from the skin to the aim [m]
    double clearance = 0;  // between needle and the nearest voxel of a vital structure, bone or fixed tissue, `comfort` at
                           // most [m]
    double angle = 0;      // between needle and the skin's normal [rad]
    WayVerdict verdict;
    double offCentre = 0;  // of the fired notch's middle beyond the aim: the line is too short for the throw [m]
};

/// As planApproach(), but several ways that differ, at most `most`; the first is that of planApproach(). The line is
/// searched from all around, entries in the scene are not looked at.
/// @param margin  clearance that each must have [m]; nothing: as much as possible of 4, 2.5 and 1.5 mm
/// Ways that a WayJudge refuses are none. Throws std::runtime_error when there is none, and says why.
std::vector<Proposal> proposeApproaches(const Scene& scene, const volume::Tissue& tissue, std::size_t most,
                                        std::optional<double> margin = std::nullopt);

}  // namespace palpate::datasets
