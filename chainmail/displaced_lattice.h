#pragma once

#include <chainmail/lattice.h>
#include <occupancy/body.h>

#include <span>
#include <vector>

namespace palpate::chainmail {

/// Where the nodes of a lattice are now, with the occupancy map in step: what every level of the model ladder leaves behind
/// for collision, distances and the viewer. Only nodes that moved are rewritten; allocates nothing after construction.
class DisplacedLattice {
public:
    explicit DisplacedLattice(const Lattice& lattice);

    /// Displaces node `n` by `u` [m].
    void set(Node n, Vec3f u) noexcept
    {
        u_[n] = u;
        place(n);
    }
    /// For those who write displacements by themselves: place() every node that was written.
    std::span<Vec3f> raw() noexcept { return u_; }
    void place(Node n) noexcept;

    /// Nodes that are not at rest.
    std::span<const Node> moved() const noexcept { return moved_; }
    std::span<const Vec3f> u() const noexcept { return u_; }
    const Lattice& lattice() const noexcept { return lattice_; }
    /// What the queries of occupancy/ see. `surface` must outlive it.
    occupancy::Body body(const volume::DistanceField& surface) const noexcept
    {
        return {lattice_.grid, lattice_.tissue, u_, map_, surface};
    }

private:
    const Lattice& lattice_;
    std::vector<Vec3f> u_;  // displacement [m] (count x 3)
    std::vector<Node> moved_;
    std::vector<std::uint32_t> slot_;  // of each node in moved_, + 1; 0 = at rest (count x 1)
    occupancy::OccupancyMap map_;
};

}  // namespace palpate::chainmail
