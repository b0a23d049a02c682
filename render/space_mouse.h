#pragma once

#include <ultrasound/placement.h>

namespace palpate::render {

/// A six-axis mouse (3Dconnexion's and others), by the daemon spacenavd: the hand that holds the ultrasound probe. It is
/// looked for once; where there is none, nothing moves.
class SpaceMouse {
public:
    SpaceMouse();
    SpaceMouse& operator=(SpaceMouse&&) = delete;
    ~SpaceMouse();

    bool connected() const noexcept { return connected_; }
    /// What it was moved since this was last called. Cap to the right: along the face; to the front: across the picture;
    /// down: into the body; turned about these three: tilt, rock, turn. Does not wait.
    ultrasound::ProbeMove moved();

    // Of the cap held as far as it goes; assumed: a hand searches at 10 to 30 mm/s.
    static constexpr double fastest = 25e-3;    // [m/s]
    static constexpr double fastestTurn = 0.6;  // [rad/s]

private:
    bool connected_ = false;
};

}  // namespace palpate::render
