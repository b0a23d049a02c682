#pragma once

#include <channel/layout.h>
#include <volume/geometry.h>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::haptics {

/// The intensity image of a body as viewers get it: a code per display voxel, and in the scenery what codes stand for and
/// the windows to look at them through.
///
/// In HU the windows are soft tissue, lung and bone, and the first of them comes first that shows at least half of the
/// tissue within 30 mm of scenery.aim (without a planned line, of all). In any other unit they are the 1st to 99th
/// percentile of the whole body, and of that tissue. Beside the body the image goes on by a voxel, so that interpolation
/// between codes does not darken its surface.
/// @param grid     scenery.labels
/// @param values   image per node, not a number where there is none (count x 1)
/// @param beyond   image per node where `values` has none, beside and outside the body; may be empty (count x 1)
/// @param scenery  gets the windows; with none of them there is nothing to show, no value was a number
/// @returns        as channel::Subscriber::image()
std::vector<std::uint16_t> displayImage(const volume::NodeGrid& grid, const std::vector<float>& values,
                                        const std::string& unit, channel::Scenery& scenery,
                                        const std::vector<float>& beyond = {});

}  // namespace palpate::haptics
