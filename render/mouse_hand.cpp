#include <render/mouse_hand.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace palpate::render {
namespace {

channel::Triple triple(glm::dvec3 v) noexcept
{
    return {v.x, v.y, v.z};
}

}  // namespace

// Goes on counting where a viewer before this one has stopped.
void MouseHand::take(const Follower& follower)
{
    tried_ = Clock::now();
    attached_ = follower.attached();
    hand_.reset();
    if (follower.session() == nullptr)
        return;
    hand_ = channel::ViewersHand::take(*follower.session());
    holds_ = follower.session()->scenery().viewersHand == channel::handIsViewers;
    input_ = follower.session()->input().value_or(channel::Input{});
    input_.held = input_.ended = 0;
    input_.axis = follower.state().axis;
    input_.target = follower.state().tip;
}

void MouseHand::keep(const Follower& follower)
{
    constexpr auto again = std::chrono::milliseconds(200);  // the viewer that is the hand may end
    if (follower.session() == nullptr)
        hand_.reset();
    else if (follower.known() && (attached_ != follower.attached() || (!hand_ && Clock::now() - tried_ > again)))
        take(follower);
    if (!hand_)
        return;
    // After a slow picture.
    const bool silent = Clock::now() - told_ > std::chrono::duration<double>(longestSilence);
    if (silent && held())
        press(follower.state());
    hand_->set(input_);
    told_ = Clock::now();
}

void MouseHand::press(const channel::State& state)
{
    if (paused())
        return;
    input_.held = 1;
    input_.target = state.tip;
}

void MouseHand::togglePause() noexcept
{
    release();
    input_.paused = 1 - input_.paused;
}

void MouseHand::beginAnew() noexcept
{
    if (paused())
        input_.ended = 2;
}

void MouseHand::moveProbe(const ultrasound::ProbeMove& by) noexcept
{
    constexpr double furthest = 0.3;  // [m], [rad]: from where the scene has it
    const std::array<double, 6> ways{by.press, by.slide, by.sweep, by.rock, by.tilt, by.turn};
    for (std::size_t i = 0; i < ways.size(); ++i)
        input_.probe[i] = std::clamp(input_.probe[i] + (paused() ? 0.0 : ways[i]), -furthest, furthest);
}

void MouseHand::move(glm::dvec3 by) noexcept
{
    if (input_.held != 0)
        input_.target = triple(target() + by);
}

// Rodrigues' formula; the length is kept at 1 against rounding.
void MouseHand::turn(glm::dvec3 about, double angle) noexcept
{
    if (input_.held == 0)
        return;
    const glm::dvec3 axis = vec(input_.axis);
    const glm::dvec3 turned = std::cos(angle) * axis + std::sin(angle) * glm::cross(about, axis) +
                              (1 - std::cos(angle)) * glm::dot(about, axis) * about;
    input_.axis = triple(glm::normalize(turned));
}

}  // namespace palpate::render
