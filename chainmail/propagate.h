#pragma once

#include <chainmail/lattice.h>
#include <chainmail/violation_queue.h>

#include <cstdint>
#include <span>
#include <vector>

namespace palpate::chainmail {

/// A node that is held where something else put it: by a tool, by a hand.
struct Seed {
    Node node = 0;
    Vec3f u{0.0F};  // its displacement [m]
};

/// Held nodes yield only along this unit vector: tissue under a tool may leave it, but not enter it. Zero: not at all.
using Yield = Vec3f;

/// Working memory of propagate(). Build once, reuse every servo tick.
struct PropagateScratch {
    /// @param maxMoves  node moves that one call may make
    PropagateScratch(const Lattice& lattice, std::uint32_t maxMoves, std::uint32_t maxSeeds);

    ViolationQueue queue;
    std::vector<Node> moved;          // nodes moved since clear(), in the order first moved
    std::vector<std::uint32_t> seen;  // last pass that listed the node in `moved`  (count x 1)
    std::vector<std::uint32_t> held;  // last pass that held the node as a seed     (count x 1)
    std::uint32_t pass = 1;
    std::uint32_t maxMoves;

    /// Forgets which nodes moved and which are held.
    void clear() noexcept;
};

struct PropagateResult {
    std::uint32_t moves = 0;  // times a node was moved
    double residual = 0;      // largest violation that is left: work ran out, or held nodes disagree [m]
};

/// Holds the seeds where they are put and lets the motion spread through the links until every link is legal.
///
/// A violated link pulls its far end by the smallest step that makes the link legal; that end then pulls its own
/// neighbours, and the one that pulled it is tested again. Links are taken in the order of largest violation, ties first
/// in, first out: the order in which links of many materials end up legal. Where the far end is of fixed tissue, or held
/// and may not yield that way, the near end moves instead.
///
/// @param u      displacement of every node [m] (count x 3); updated in place
/// @param seeds  at most scratch's maxSeeds
/// @param yield  how the seeds may still be pulled
/// @returns      how much was done and what is left; scratch.moved lists the nodes, seeds included
///
/// Cost O(moves), at most scratch.maxMoves moves. Allocates nothing, never throws. One call at a time per
/// scratch. Sources: S. F. F. Gibson, "3D ChainMail: a Fast Algorithm for Deforming Volumetric Objects", Symposium on
/// Interactive 3D Graphics, 1997; M. A. Schill, S. F. F. Gibson, H.-J. Bender, R. Maenner, "Biomechanical Simulation of the
/// Vitreous Humor in the Eye Using an Enhanced ChainMail Algorithm", MICCAI 1998 (order by violation).
PropagateResult propagate(const Lattice& lattice, std::span<Vec3f> u, PropagateScratch& scratch,
                          std::span<const Seed> seeds, Yield yield = Yield(0.0F)) noexcept;

}  // namespace palpate::chainmail
