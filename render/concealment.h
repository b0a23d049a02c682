#pragma once

#include <channel/layout.h>
#include <render/history.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace palpate::render {

/// What a trainee who is tested does not get to see.
struct Concealment {
    bool plan = false;                 // planned line, and how far the target is
    std::vector<std::string> tissues;  // by name: shown as what lies around them

    bool any() const noexcept { return plan || !tissues.empty(); }
};

/// Refuses a tissue that the scenery does not have: it would be shown in spite of the option. Throws std::runtime_error
/// with those that `labels` have.
void checkTissues(const Concealment& what, const channel::Scenery& scenery, std::span<const std::uint8_t> labels);
/// Takes the planned line out of a scenery; always out of one whose target is to be found.
void conceal(const Concealment& what, channel::Scenery& scenery);
/// Takes distances to the target, and what lies ahead, out of a state.
void conceal(const Concealment& what, channel::State& state);
void conceal(const Concealment& what, History::Moment& moment);
/// Gives voxels of the tissues `what` names the label of what lies around them, from outside inwards. `labels` are on
/// `grid`, x fastest. Voxels with nothing else around (a body of that tissue alone) stay as they are.
void conceal(const Concealment& what, const channel::Scenery& scenery, const channel::Grid& grid,
             std::span<std::uint8_t> labels);

}  // namespace palpate::render
