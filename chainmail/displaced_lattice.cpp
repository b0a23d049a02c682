#include <chainmail/displaced_lattice.h>

namespace palpate::chainmail {

DisplacedLattice::DisplacedLattice(const Lattice& lattice)
    : lattice_(lattice),
      u_(lattice.tissue.size(), Vec3f(0.0F)),
      slot_(lattice.tissue.size(), 0),
      map_(lattice.grid, lattice.tissue)
{
    moved_.reserve(lattice.tissue.size());
}

void DisplacedLattice::place(Node n) noexcept
{
    map_.displace(n, u_[n]);
    const bool displaced = u_[n] != Vec3f(0.0F);
    std::uint32_t& slot = slot_[n];
    if (displaced && slot == 0) {
        moved_.push_back(n);
        slot = static_cast<std::uint32_t>(moved_.size());
    } else if (!displaced && slot != 0) {
        moved_[slot - 1] = moved_.back();
        slot_[moved_.back()] = slot;
        moved_.pop_back();
        slot = 0;
    }
}

}  // namespace palpate::chainmail
