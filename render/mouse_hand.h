#pragma once

#include <render/follower.h>
#include <ultrasound/placement.h>

#include <glm/vec3.hpp>

#include <optional>

namespace palpate::render {

/// The mouse as the hand of a session: holds the session's hand for this viewer while it can be had, and turns what the
/// user does into what is asked of the simulation.
class MouseHand {
public:
    /// Takes the hand or leaves it, as sessions come and go, and tells the simulation. To be called often: it is the hand's
    /// heartbeat.
    void keep(const Follower& follower);
    /// This viewer is the session's hand.
    bool is() const noexcept { return hand_.has_value() && holds_; }
    /// This viewer may pause the session and end it: it is the hand, or a haptic device is.
    bool commands() const noexcept { return hand_.has_value(); }

    /// The dead-man switch. The hand begins where the tool is.
    void press(const channel::State& state);
    void release() noexcept { input_.held = 0; }
    bool held() const noexcept { return is() && input_.held != 0; }
    /// Where the hand is [m].
    glm::dvec3 target() const noexcept { return vec(input_.target); }
    /// Of the tool, from its shaft to its tip; a unit vector.
    glm::dvec3 axis() const noexcept { return vec(input_.axis); }
    /// While the switch is held, and only then: moves the hand [m].
    void move(glm::dvec3 by) noexcept;
    /// ... turns the tool by `angle` [rad] about the unit vector `about`.
    void turn(glm::dvec3 about, double angle) noexcept;
    /// ... fires the gun.
    void fire() noexcept { input_.fires += input_.held; }
    /// Moves the other hand, which holds the scene's ultrasound probe. It needs no switch, and any viewer that commands has
    /// it.
    void moveProbe(const ultrasound::ProbeMove& by) noexcept;
    void storePicture() noexcept { input_.pictures += paused() ? 0 : 1; }
    void mark() noexcept { input_.marks += paused() ? 0 : 1; }
    /// Takes the last mark back.
    void unmark() noexcept { input_.unmarks += paused() ? 0 : 1; }
    void end() noexcept { input_.ended = 1; }
    /// Lets the tool go and makes the session stand still, or go on.
    void togglePause() noexcept;
    /// The simulation takes the tool anew where it is, after so long without a beat [s]: as in haptics/mouse.h.
    static constexpr double longestSilence = 0.5;
    bool paused() const noexcept { return commands() && input_.paused != 0; }
    /// Of a session that is paused, and only then: ends it, to begin anew.
    void beginAnew() noexcept;

private:
    void take(const Follower& follower);

    std::optional<channel::ViewersHand> hand_;
    channel::Input input_;
    bool holds_ = false;
    std::uint64_t attached_ = 0;
    Clock::time_point tried_{}, told_{};  // the simulation, last
};

}  // namespace palpate::render
