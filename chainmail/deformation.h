#pragma once

#include <chainmail/displaced_lattice.h>
#include <chainmail/propagate.h>

#include <span>
#include <vector>

namespace palpate::chainmail {

/// The deformed body of level 1: ChainMail from rest in every tick, so that the shape depends on where the tool is and not
/// on how it came there, and is exactly at rest when nothing touches it. Keeps the occupancy map in step: only nodes that
/// moved are rewritten.
class Deformation {
public:
    /// @param maxMoves  node moves per tick; what is left over is reported as residual
    /// @param maxSeeds  nodes that may be held at a time
    Deformation(const Lattice& lattice, std::uint32_t maxMoves, std::size_t maxSeeds);

    /// The shape with these nodes held, free to yield along `yield` (see propagate()). Cost O(nodes moved
    /// now and last time); allocates nothing.
    PropagateResult deform(std::span<const Seed> seeds, Yield yield = Yield(0.0F)) noexcept;

    /// Nodes that are not at rest.
    std::span<const Node> moved() const noexcept { return shape_.moved(); }
    std::span<const Vec3f> u() const noexcept { return shape_.u(); }
    DisplacedLattice& shape() noexcept { return shape_; }
    const DisplacedLattice& shape() const noexcept { return shape_; }

private:
    DisplacedLattice shape_;
    PropagateScratch scratch_;
    std::vector<Node> before_;  // moved last time
};

/// The nodes that a ball pushes ahead of itself on its way from `from`, where it first touched, to `to` [m]: those in the
/// way, pushed along it onto the far side of the ball. A ball smaller than the lattice can see is widened to one spacing
/// with the same foremost point. Hold them with Yield along the way.
/// @returns  how many seeds were written to `out`
std::size_t pressSeeds(const Lattice& lattice, Vec3 from, Vec3 to, double radius, std::span<Seed> out) noexcept;

/// No press of a ball of this radius [m] has more seeds than this.
std::size_t maxPressSeeds(const Lattice& lattice, double radius) noexcept;

/// The nodes within one spacing of `rest` [m], all displaced by `u` [m]: material that sticks to a needle's tip.
std::size_t dragSeeds(const Lattice& lattice, Vec3 rest, Vec3 u, std::span<Seed> out) noexcept;

}  // namespace palpate::chainmail
