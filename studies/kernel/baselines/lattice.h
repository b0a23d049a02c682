#pragma once

#include <chainmail/lattice.h>
#include <chainmail/propagate.h>
#include <studies/kernel/baselines/baseline.h>

#include <cstdint>
#include <span>
#include <vector>

namespace palpate::studies {

/// Working memory of propagateFifo(). Build once, reuse every tick.
struct FifoScratch {
    explicit FifoScratch(const chainmail::Lattice& lattice);

    std::vector<chainmail::Node> queue;  // nodes that pull, in the order moved
    std::vector<chainmail::Node> moved;  // nodes of the last call, seeds included, in the order first moved
    std::vector<std::uint32_t> seen;     // last call that listed the node in `moved`  (count x 1)
    std::vector<std::uint32_t> held;     // last call that held the node as a seed     (count x 1)
    std::vector<std::uint8_t> waits;     // not 0 while the node is in the queue       (count x 1)
    std::uint32_t pass = 0;
};

/// Plain ChainMail: nodes pull their neighbours in the order in which they moved, first in, first out.
///
/// @param u      displacement of every node [m] (count x 3); updated in place
/// @param seeds  nodes that stay where they are put
/// @returns      how many times a node was moved; at most four times the lattice's nodes
///
/// Cost O(moves); allocates only until the scratch has seen its largest call. Source: S. F. F. Gibson, "3D ChainMail: a
/// Fast Algorithm for Deforming Volumetric Objects", Symposium on Interactive 3D Graphics, 1997.
std::size_t propagateFifo(const chainmail::Lattice& lattice, std::span<Vec3f> u, FifoScratch& scratch,
                          std::span<const chainmail::Seed> seeds);

/// Plain ChainMail from rest in every tick, first in, first out; the sphere pushes the tissue in its way inward. All
/// models here throw std::runtime_error where the body would need too many nodes.
/// @param spacing     of the nodes [m]
/// @param fraction    by which the slack of all links is multiplied
TrialModel fifoMailModel(const BaselineScene& scene, double spacing, double fraction);

/// Our level 1: ChainMail in the order of violation with the table's limits, and room to finish in every tick.
TrialModel orderedMailModel(const BaselineScene& scene, double spacing);

}  // namespace palpate::studies
