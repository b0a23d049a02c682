#include <chainmail/window_fragments.h>

#include <glm/common.hpp>

#include <algorithm>

namespace palpate::chainmail {

namespace {

// Bricks of eight nodes between two planes of nodes.
std::size_t bricksPerPair(Index3 box) noexcept
{
    return static_cast<std::size_t>(box.x / 2) * static_cast<std::size_t>(box.y / 2);
}

// Fragments that a window holds at most: those of a wide foam would cost more than twice the window's own cells.
std::size_t mostIn(const CellLevel& level, Index3 box) noexcept
{
    constexpr std::size_t few = 256;
    const std::size_t nodes = Layout::of(box.x, box.y, box.z).count;
    return std::min(level.fragments.cells.size(), std::max(few, nodes / 4));
}

}  // namespace

int WindowFragments::planes(const CellLevel& level, Index3 box) noexcept
{
    const std::size_t perPair = bricksPerPair(box);
    return box.z + 2 * static_cast<int>((mostIn(level, box) + perPair - 1) / perPair);
}

WindowFragments::WindowFragments(const CellLevel& level, Index3 box)
    : box_(box),
      layout_(Layout::of(box.x, box.y, planes(level, box))),
      perPair_(bricksPerPair(box)),
      begin_(layout_.at(0, 0, box.z)),
      planes_(box.z)
{
    const std::size_t fragments = level.fragments.cells.size(), behind = layout_.count - begin_;
    const std::size_t most = mostIn(level, box);
    placed_.reserve(most);
    left_.reserve(fragments);
    virtuals_.reserve(std::min(8 * most, level.fragments.nodes.size()));
    copies_.reserve(8 * most);
    originals_.assign(behind, 0);
    nodeOf_.assign(fragments, noFragment);
    at_.assign(level.fragments.nodes.size(), noFragment);
    wasAt_ = at_;
    const std::size_t links = std::min(level.fragments.links.size(), layout_.count);
    links_.reserve(links);
    linkOf_.assign(links > 0 ? layout_.count : 0, 0);
}

std::size_t WindowFragments::brickAt(std::size_t index) const noexcept
{
    const std::size_t inPair = index % perPair_, perRow = static_cast<std::size_t>(box_.x / 2);
    return begin_ + 2 * (index / perPair_ * layout_.plane + inPair / perRow * layout_.row + inPair % perRow);
}

void WindowFragments::place(const CellLevel& level, Index3 low) noexcept
{
    const Fragments& all = level.fragments;
    if (all.cells.empty()) {
        return;
    }
    std::swap(at_, wasAt_);
    std::ranges::fill(at_, noFragment);
    for (const Placed& p : placed_) {
        nodeOf_[p.fragment] = noFragment;
    }
    placed_.clear();
    left_.clear();
    virtuals_.clear();
    copies_.clear();
    for (std::size_t i = 0; i < originals_.size(); ++i) {
        originals_[i] = static_cast<std::uint32_t>(begin_ + i);
    }
    for (int r = 0; r < (box_.y - 1) * (box_.z - 1); ++r) {
        const Index3 first = low + Index3(0, r % (box_.y - 1), r / (box_.y - 1));
        for (const CellFragment& f : all.cellsOf(first, low.x + box_.x - 2, level.nodes.size.y)) {
            add(level, static_cast<std::uint32_t>(&f - all.cells.data()), low);
        }
    }
    planes_ = box_.z + 2 * static_cast<int>((placed_.size() + perPair_ - 1) / perPair_);
}

void WindowFragments::add(const CellLevel& level, std::uint32_t fragment, Index3 low) noexcept
{
    if (placed_.size() == mostIn(level, box_)) {
        left_.push_back(fragment);
        return;
    }
    const std::size_t node = brickAt(placed_.size());
    const CellFragment& f = level.fragments.cells[fragment];
    const auto count = static_cast<std::uint32_t>(level.nodes.count());
    placed_.push_back({fragment, static_cast<std::uint32_t>(node), f.cell});
    nodeOf_[fragment] = static_cast<std::uint32_t>(node);
    for (int c = 0; c < 8; ++c) {
        const auto corner = static_cast<std::uint32_t>(layout_.corner(node, c));
        const std::uint32_t id = f.nodes[static_cast<std::size_t>(c)];
        std::uint32_t original = corner;
        if (id < count) {
            const Index3 n = f.cell + octant(c) - low;
            original = static_cast<std::uint32_t>(layout_.at(n.x, n.y, n.z));
        } else if (std::uint32_t& known = at_[id - count]; known != noFragment) {
            original = known;
        } else {
            known = corner;
            virtuals_.push_back({id - count, corner});
        }
        if (original != corner) {
            originals_[corner - begin_] = original;
            copies_.push_back({corner, original});
        }
    }
}

void WindowFragments::link(const CellLevel& level, Index3 low, const Layout& coarse, Index3 coarseLow,
                           const CellLevel& coarseLevel, const WindowFragments& coarser) noexcept
{
    for (const Link& l : links_) {
        linkOf_[l.node] = 0;
    }
    links_.clear();
    const int rows = level.fragments.links.empty() ? 0 : box_.y * box_.z;
    for (int r = 0; r < rows; ++r) {
        const Index3 first = low + Index3(0, r % box_.y, r / box_.y);
        for (const NodeLink& l : level.fragments.linksOf(first, low.x + box_.x - 1, level.nodes.size.y)) {
            const Index3 n = l.at - low;
            const std::size_t node =
                l.node < level.nodes.count() ? layout_.at(n.x, n.y, n.z) : at_[l.node - level.nodes.count()];
            if (node == noFragment) {
                continue;
            }
            Link found{static_cast<std::uint32_t>(node), l.count, {}};
            std::size_t i = 0;
            volume::forEachIndex(l.at / 2, l.at / 2 + l.at % 2, [&](Index3 parent) {
                const Index3 p = parent - coarseLow;
                const std::uint32_t id = l.parents[i];
                const std::uint32_t known = id < coarseLevel.nodes.count()
                                                ? noFragment
                                                : coarser.at(id - static_cast<std::uint32_t>(coarseLevel.nodes.count()));
                found.parents[i++] = known != noFragment ? known : static_cast<std::uint32_t>(coarse.at(p.x, p.y, p.z));
            });
            links_.push_back(found);
            linkOf_[node] = static_cast<std::uint32_t>(links_.size());
        }
    }
}

void WindowFragments::share(float* field, std::size_t count) const noexcept
{
    for (std::size_t c = 0; c < 3; ++c, field += count) {
        for (const Copy& copy : copies_) {
            field[copy.at] = field[copy.original];
        }
    }
}

void WindowFragments::collect(float* field, std::size_t count) const noexcept
{
    for (std::size_t c = 0; c < 3; ++c, field += count) {
        for (const Copy& copy : copies_) {
            field[copy.original] += field[copy.at];
            field[copy.at] = 0.0F;
        }
    }
}

std::uint32_t fragmentAt(const ElasticBody& body, std::size_t level, Index3 finestCell) noexcept
{
    const Fragments& finest = body.levels.front().fragments;
    const auto divided = finest.in(finestCell, body.levels.front().nodes.size.y);
    std::uint32_t fragment = noFragment;
    if (!divided.empty()) {
        fragment = static_cast<std::uint32_t>(divided.data() - finest.cells.data());
    }
    Index3 cell = finestCell;
    for (std::size_t l = 1; l <= level; ++l) {
        if (fragment != noFragment) {
            fragment = body.levels[l - 1].fragments.cells[fragment].parent;
        } else {
            fragment = body.levels[l].fragments.holding(cell, body.levels[l].nodes.size.y);
        }
        cell /= 2;
    }
    return fragment;
}

}  // namespace palpate::chainmail
