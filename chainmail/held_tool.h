#pragma once

#include <chainmail/elastic_contact.h>
#include <chainmail/move_blend.h>

namespace palpate::chainmail {

/// A tool as an elastic body feels it: it presses only as deep as the cells bear. It is held back on its way,
/// ElasticTool::pushed, where
///
///     - the surface under it is stretched to six and a half times its area, less under a tool of few cells: from eight on,
///       cells there have more than one equilibrium, and the surface slips around the tool
///     - nodes under the surface bear a fifth of its load: from two fifths on it slips through the surface, onto them alone
///     - the surface sinks into it by more than a bound, and than a contact that is as stiff as may be
///     - small strain is pressed by more than a radius
///     - it would go deeper in one call than lets the body follow: so it does not jump through a thin part
///     - it would get into what is held in space: cells over bone that a tool would press flat bear next to nothing
///
/// From there its force goes on by Hertz's law: with the depth to the power of 3/2 under a ball and the ends of a rod, in
/// proportion to it under the side of a rod. What is held in space stops the real tool besides, by a spring from where that
/// begins.
struct HeldTool {
    double given = 0;     // how deep it is [m]
    double behind = 0;    // how much deeper the real one is [m]
    double inHeld = 0;    // and of that, how deep it is in what is held in space [m]
    double deeper = 1;    // the real one's depth over that, from a least one on [-]
    double depth = 0;     // to which the surface sank into it in the last call [m]
    double sunk = 0;      // the same as it would be in the finest cells, for the bound [m]
    Vec3 felt{0.0};       // force of its contacts in the last call [N]
    double load = 0;      // sum of the sizes of these [N]
    double under = 0;     // the same of those of nodes under the surface [N]
    double indented = 0;  // the same of each times E / (1 - nu^2) of its tissue, see radiusOfPatch() [N Pa]
    double onEnds = 0;    // and of those on its ends, which is all of a ball's [N]
    double loaded = 0;    // how deep it was then [m]
    double stretch = 0;   // largest area under it in the last call, over that at rest [-]
    double friction = 0;  // Coulomb [-]
    Vec3 inward{0.0};     // unit vector along its way; or zero
    MoveBlend blend;      // over moves of the windows
    Vec3 lag{0.0};        // by which the force along the surface is too large, see Elastic::findLag() [N]
    double stopped = 0;   // force by which what is held in space stops the real tool [N]

    /// Nothing is known yet of this call's contacts.
    void forgetContacts() noexcept
    {
        depth = sunk = load = under = onEnds = indented = stretch = 0.0;
        felt = lag = Vec3(0.0);
    }
    /// The tool for this call, as deep as the last one lets it go.
    /// @param holdsBack  false: as it is
    ElasticTool place(const ElasticTool& tool, const ElasticBody& body, bool isSmall, bool holdsBack) noexcept;
    /// By how much the force of the last call has to be scaled for the depth of this one, to the power of 3/2, where that
    /// has changed by more than five percent: a tool that leaves is out after a few calls. Less is left as it is, since
    /// what follows every tremor of a hand makes it larger.
    double changed() const noexcept;
    /// The force on the real tool, by that on the one which the body feels, `felt` [N]. Without friction it has no part
    /// into the body: tissue that was left on the wrong side of a tool, by a jump or a corner, does not pull it.
    Vec3 force() const noexcept { return outward(ownForce() + blend.offset()); }
    /// The same of the windows where they are.
    Vec3 ownForce() const noexcept;

private:
    Vec3 outward(Vec3 force) const noexcept;
};

}  // namespace palpate::chainmail
