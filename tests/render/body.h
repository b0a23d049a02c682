#pragma once

#include <channel/channel.h>

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::render {

/// As viewers are told names.
channel::Name named(const std::string& words);

/// A made-up session for tests of the viewer: a ball of skin, fat and gland with a tumour and an artery, and a needle that
/// presses a dimple, breaks through, reaches the tumour and fires.
channel::Scenery bodyScenery(int voxels = 104, double spacing = 1e-3);
std::vector<std::uint8_t> bodyLabels(const channel::Scenery& scenery);

/// An image of it that rises along x from 0 to 1000, black to white, and says so in the scenery.
std::vector<std::uint16_t> bodyImage(channel::Scenery& scenery);

/// What is published at time `t` [s] of the story; it lasts storySeconds.
inline constexpr double storySeconds = 5.0;
inline constexpr double contactAt = 0.8, punctureAt = 2.0, arrivalAt = 3.5, fireAt = 3.8;
channel::State storyState(const channel::Scenery& scenery, double t);
void storyDisplaced(const channel::Scenery& scenery, double t, channel::Displaced& out);

/// Every node moves by up to `amplitude` [m], for the cost of a picture that changes everywhere.
void waveDisplaced(const channel::Scenery& scenery, double t, double amplitude, channel::Displaced& out);

}  // namespace palpate::render
