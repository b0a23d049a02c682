#pragma once

#include <occupancy/body.h>

#include <array>

namespace palpate::haptics {

/// How far other tools have displaced the tissue along a needle's way: an ultrasound probe that lies beside it. Looked at
/// when the needle touches the skin, before it displaces tissue itself; from then on in proportion to the others' force,
/// as it would be in a linear body. A needle's laws are about its way in the tissue, and so without this one.
///
/// Not in it: others that touch the body only later, and that another place of the skin is pressed later.
class PushedWay {
public:
    /// @param body    as the others have displaced it
    /// @param entry   on the skin, at rest [m]
    /// @param axis    of the needle, unit vector into the body
    /// @param others  size of the others' force [N]; 0: nothing is displaced by them
    void look(const occupancy::Body& body, Vec3 entry, Vec3 axis, double others) noexcept;
    /// Time goes on by `dt` [s]. The others' force as it is now [N].
    void follow(double others, double dt) noexcept;
    /// At a length of the way, at rest [m]; linear between samples, the last one from 128 mm on.
    Vec3 at(double length) const noexcept;

private:
    std::array<Vec3f, 33> displaced_{};  // at every 4 mm [m]
    double others_ = 0;                  // force when it was looked at [N]
    double share_ = 0;                   // of what was displaced then
};

}  // namespace palpate::haptics
