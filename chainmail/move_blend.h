#pragma once

#include <occupancy/tool_shape.h>

namespace palpate::chainmail {

/// Takes a tool's force from windows where they were to windows where they are, over some 32 ticks.
///
/// Windows at another place have another force for the same pose, by their resolution and by what a tick leaves out of
/// balance. A hand would feel that as a tick. In the tick of the move and the few after it in which the solution follows,
/// the force is what the last ticks say: their change per way, times the tool's way. What the windows' own force is off
/// that is an offset, which then goes to nothing. It is never over a tenth of the force: what is more, is felt.
class MoveBlend {
public:
    /// Counts a tick.
    /// @param force  of the windows [N]
    /// @param at     where the tool is [m]
    /// @param moved  windows moved in this tick
    void count(Vec3 force, Vec3 at, bool moved) noexcept;
    /// What the force of this tick has to be more [N].
    Vec3 offset() const noexcept { return offset_; }
    void forget() noexcept { *this = {}; }

private:
    Vec3 force_{0.0}, at_{0.0};            // of the last tick
    Vec3 meanChange_{0.0}, meanWay_{0.0};  // of the force and the tool, in a tick
    Vec3 offset_{0.0};
    double sinceMove_ = 1e9;  // ticks at 20 mm/s
    bool isKnown_ = false;
};

}  // namespace palpate::chainmail
