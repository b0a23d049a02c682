#pragma once

#include <chainmail/lattice.h>

#include <span>
#include <vector>

namespace palpate::studies {

/// Relaxation of a ChainMail lattice as its author does it: every node moves to the mean of its neighbours.
///
/// Rows see what the rows before them became; within a row all nodes move at once, so that the loops vectorise. Fixed nodes
/// stay, places without tissue are no neighbours. Source: S. F. F. Gibson, "3D ChainMail: a Fast Algorithm for Deforming
/// Volumetric Objects", Symposium on Interactive 3D Graphics, 1997, elastic relaxation.
class MeanSweeps {
public:
    /// The lattice must outlive it.
    explicit MeanSweeps(const chainmail::Lattice& lattice);

    /// @param u      displacement of every node [m] (count x 3); zero where there is no tissue; updated in place
    /// @param moved  nodes that are not at rest; nodes further from all of them than `count` links stay at rest
    /// @param held   nodes that stay where they are
    void sweep(std::span<Vec3f> u, std::span<const chainmail::Node> moved, std::span<const chainmail::Node> held,
               int count);
    /// Nodes that the last call may have moved: a box.
    Index3 low() const noexcept { return low_; }
    Index3 high() const noexcept { return high_; }

private:
    void hold(std::span<const chainmail::Node> nodes, bool yes);

    const chainmail::Lattice& lattice_;
    std::vector<float> weight_;  // 1 / number of neighbours, three times; 0: stays (count x 3)
    std::vector<float> row_;     // of the sweep (nodes along x, x 3)
    Index3 low_{1}, high_{0};
    bool wide_;  // the machine has AVX2
};

}  // namespace palpate::studies
