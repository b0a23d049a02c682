#pragma once

#include <channel/layout.h>
#include <haptics/session_model.h>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::haptics {

/// What viewers are told of a session once: what there is to see, and grids of it.
struct Showing {
    channel::Scenery scenery;
    std::vector<std::uint8_t> labels;  // per node of scenery.labels: tissue row and channel::shellBit
    std::vector<std::uint16_t> image;  // per node of scenery.labels, or empty
    std::vector<std::uint8_t> fine;    // per node of scenery.fine: tissue row; or empty
};

/// As viewers have it.
inline channel::Triple triple(Vec3 v) noexcept
{
    return {v.x, v.y, v.z};
}

/// The first 31 bytes of a text, of UTF-8 whole characters.
channel::Name nameOf(const std::string& text) noexcept;
/// The same, with an ellipsis at the end of what is not whole: for names that nobody looks up.
channel::Name shownNameOf(const std::string& text) noexcept;

/// The grid that a viewer's labels are on where nobody asks for another.
volume::NodeGrid displayGrid(const volume::Tissue& tissue);

/// What a tissue does to ultrasound, as viewers are told; see datasets::acousticsOf().
channel::TissueSound soundOf(const volume::TissueRow& row);

/// @param viewersHand  who holds the tool, see channel::handIsViewers
Showing showingOf(const SessionModel& model, std::uint32_t viewersHand, const volume::NodeGrid& display);

}  // namespace palpate::haptics
