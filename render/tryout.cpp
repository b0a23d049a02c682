#include <render/tryout.h>

#include <base/said.h>
#include <render/deformation.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::render {
using base::marked;

const char* Tryout::heading()
{
    return base::tr("Trying the tool");
}

constexpr int steps = 6;
constexpr double across = 5e-3, along = 8e-3;  // of the tip, that were meant [m]

constexpr std::array<const char*, steps> byMouse{
    marked("Hold the mouse button of your index finger, or press Enter: you hold the tool"),
    marked("Move the mouse, or press the arrows: the tip goes along in the plane of the picture"),
    marked("Turn the wheel forward, or press Page down: the tool goes along itself. With Shift finer"),
    marked("Go on until it touches the skin: your hand goes on, the tissue holds the tool back"),
    marked("Let go (Enter, where you took it by Enter): the force fades, the tool stays"),
    marked("Space or the other mouse button fires, S pauses, E ends, ? lists all keys. Try what you like")};
constexpr std::array<const char*, steps> byDevice{
    marked("Press the centre button of the grip: forces are on"),
    marked("Move the grip sideways: the tip goes along"),
    marked("Push the grip away from you: the tool goes along itself"),
    marked("Go on until it touches the skin: you feel the tissue"),
    marked("Draw back until the tool is free"),
    marked("The forward button fires, S pauses, the left button held for a second ends. Try what you like")};

bool Tryout::done(const channel::Scenery& scenery, const channel::State& state, bool held)
{
    const bool device = scenery.viewersHand == channel::handIsDevices;
    const glm::dvec3 axis = vec(state.axis), way = vec(state.tip) - *from_;
    switch (step_) {
        case 0:
            return device ? glm::length(way) > across : held;
        case 1:
            return glm::length(way - glm::dot(way, axis) * axis) > across;
        case 2:
            return glm::dot(way, axis) > along;
        case 3:
            return state.phase != channel::Phase::free;
        case 4:
            return device ? state.phase == channel::Phase::free : !held;
        default:
            return false;
    }
}

Coaching Tryout::see(const channel::Scenery& scenery, const channel::State& state, bool held)
{
    if (!from_)
        from_ = vec(state.tip);
    if (done(scenery, state, held)) {
        ++step_;
        from_ = vec(state.tip);
    }
    const auto& words = scenery.viewersHand == channel::handIsDevices ? byDevice : byMouse;
    const double left = std::max(0.0, std::ceil(seconds_ - state.time));
    return {step_ + 1, steps,
            base::said(base::tr("{}  ({:.0f} s left)"), base::tr(words[static_cast<std::size_t>(step_)]), left), "", false};
}

}  // namespace palpate::render
