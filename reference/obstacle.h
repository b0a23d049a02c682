#pragma once

#include <volume/geometry.h>

namespace palpate::reference {

/// A RigidTool in the units of FiniteElements: all that is within `radius` of a line.
struct Obstacle {
    Vec3 centre{0.0};   // where the line begins [mm]
    double radius = 0;  // 0: none [mm]
    Vec3 shaft{0.0};    // from there to the line's end [mm]

    /// To its surface, negative inside [mm].
    double distance(Vec3 p) const noexcept;
    /// A place on the line, times this, is its fraction of the line's length; 0 where it has none [1/mm].
    Vec3 fractions() const noexcept;
};

}  // namespace palpate::reference
