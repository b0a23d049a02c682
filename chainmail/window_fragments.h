#pragma once

#include <chainmail/elastic_body.h>
#include <chainmail/kernels.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::chainmail {

/// The cell fragments of a window, and which of its nodes do not follow the next coarser window as their places have it.
///
/// A fragment is a cell between eight nodes of its own, in planes behind those of the window's box, so that every pass over
/// the window's arrays takes it along. Of these nodes the first one of a virtual node is that; the others are copies, of
/// nodes of the box or of virtual ones. A copy holds the same value, and what an operator gives to it goes to its original.
/// What finds no place is part of the cell itself.
class WindowFragments {
public:
    /// Planes that a window of `box` nodes has at most, with the fragments of a level.
    static int planes(const CellLevel& level, Index3 box) noexcept;

    WindowFragments(const CellLevel& level, Index3 box);

    struct Placed {
        std::uint32_t fragment = 0;  // of the level
        std::uint32_t node = 0;      // lowest of its eight nodes
        Index3 cell{0};              // of the level
    };
    struct VirtualAt {
        std::uint32_t node = 0;  // virtual node of the level
        std::uint32_t at = 0;
    };
    struct Copy {
        std::uint32_t at = 0, original = 0;
    };
    /// As NodeLink, with nodes of this window and of the coarser one.
    struct Link {
        std::uint32_t node = 0, count = 0;
        std::array<std::uint32_t, 8> parents{};
    };

    /// Takes the fragments of the cells from `low` on.
    void place(const CellLevel& level, Index3 low) noexcept;
    /// Takes the links to the coarser window, after both were placed.
    void link(const CellLevel& level, Index3 low, const Layout& coarse, Index3 coarseLow, const CellLevel& coarseLevel,
              const WindowFragments& coarser) noexcept;

    std::span<const Placed> placed() const noexcept { return placed_; }
    /// Fragments of the level that found no place.
    std::span<const std::uint32_t> left() const noexcept { return left_; }
    std::span<const VirtualAt> virtuals() const noexcept { return virtuals_; }
    std::span<const Copy> copies() const noexcept { return copies_; }
    std::span<const Link> links() const noexcept { return links_; }
    /// First node that is not of the box.
    std::size_t begin() const noexcept { return begin_; }
    /// Planes of the box, and of those behind it those in use.
    int planes() const noexcept { return planes_; }

    /// The node that a node is a copy of, or itself.
    std::size_t original(std::size_t node) const noexcept { return node < begin_ ? node : originals_[node - begin_]; }
    /// Of a node its link; none: it follows the coarser window as its place has it.
    const Link* linkOf(std::size_t node) const noexcept
    {
        return linkOf_.empty() || linkOf_[node] == 0 ? nullptr : &links_[linkOf_[node] - 1];
    }
    /// The lowest node of a fragment of the level, noFragment where the window has it not.
    std::uint32_t nodeOf(std::uint32_t fragment) const noexcept { return nodeOf_[fragment]; }
    /// Where a virtual node of the level is; and where it was before place(). noFragment: nowhere.
    std::uint32_t at(std::uint32_t virtualNode) const noexcept { return at_[virtualNode]; }
    std::uint32_t wasAt(std::uint32_t virtualNode) const noexcept { return wasAt_[virtualNode]; }

    /// Gives copies what their originals have. @param field  three components of `count` floats
    void share(float* field, std::size_t count) const noexcept;
    /// Adds what copies have to their originals, and leaves nothing to them.
    void collect(float* field, std::size_t count) const noexcept;

private:
    void add(const CellLevel& level, std::uint32_t fragment, Index3 low) noexcept;
    std::size_t brickAt(std::size_t index) const noexcept;

    Index3 box_{0};
    Layout layout_;
    std::size_t perPair_ = 0;  // bricks between two planes of nodes
    std::size_t begin_ = ~std::size_t{0};
    int planes_ = 0;
    std::vector<Placed> placed_;
    std::vector<std::uint32_t> left_;
    std::vector<VirtualAt> virtuals_;
    std::vector<Copy> copies_;
    std::vector<std::uint32_t> originals_;  // of the nodes behind the box
    std::vector<std::uint32_t> nodeOf_;
    std::vector<std::uint32_t> at_, wasAt_;
    std::vector<Link> links_;
    std::vector<std::uint32_t> linkOf_;  // index in links_ + 1, by node; empty: there are none
};

/// The fragment of level `level` in which a cell of the finest level lies; noFragment: it lies in the level's cell itself.
std::uint32_t fragmentAt(const ElasticBody& body, std::size_t level, Index3 finestCell) noexcept;

}  // namespace palpate::chainmail
