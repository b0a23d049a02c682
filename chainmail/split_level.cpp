#include <chainmail/split_level.h>

#include <chainmail/cell_bits.h>

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <unordered_map>
#include <unordered_set>
#include <utility>

namespace palpate::chainmail {

namespace {

// A part of a coarse cell's tissue that hangs together in it.
struct Piece {
    Index3 cell{0};
    std::uint8_t children = 0;             // cells of the fine level without their fragments, a bit for each
    std::vector<std::uint32_t> fragments;  // of the fine level
    std::array<std::uint32_t, 8> nodes{};
};

// Which pieces around a node are one.
class Groups {
public:
    std::size_t add()
    {
        lead_.push_back(lead_.size());
        return lead_.size() - 1;
    }
    std::size_t of(std::size_t i) const
    {
        while (lead_[i] != i) {
            i = lead_[i];
        }
        return i;
    }
    bool areOne() const
    {
        std::size_t i = 0;
        return std::ranges::all_of(lead_, [&](std::size_t) { return of(i++) == 0; });
    }
    void join(std::size_t a, std::size_t b)
    {
        a = of(a);
        b = of(b);
        lead_[std::max(a, b)] = std::min(a, b);
    }

private:
    std::vector<std::size_t> lead_;
};

// The cells of a level, as the next coarser one has them: of each coarse cell, a bit for each of its eight.
struct FineCells {
    volume::NodeGrid nodes;
    const Fragments& fragments;
    std::vector<std::uint8_t> tissue;  // cells that are not fragments
    std::vector<std::uint8_t> loose;   // of these, what hangs together with nothing held
};

class Splitter {
public:
    // `joinsAround`: see joinAround(), for a fine level without fragments.
    Splitter(FineCells fine, const volume::NodeGrid& coarse, bool joinsAround)
        : fine_(std::move(fine)), coarse_(coarse), joinsAround_(joinsAround), isDivided_(coarse.count(), 0)
    {
        for (const CellFragment& f : fine_.fragments.cells) {
            isDivided_[coarse.offset(f.cell / 2)] = 1;
        }
        out_.loose.resize(coarse.count());
        for (std::size_t i = 0; i < out_.loose.size(); ++i) {
            out_.loose[i] = fine_.loose[i] != 0 && fine_.loose[i] == fine_.tissue[i] && isDivided_[i] == 0 ? 1 : 0;
        }
    }

    Split run()
    {
        volume::forEachIndex(Index3(0), coarse_.size - 1, [&](Index3 n) {
            if (!meetsInOne(n)) {
                divide(n);
            }
        });
        out_.parents.assign(fine_.fragments.cells.size(), noFragment);
        keepFragments();
        linkNodes();
        return std::move(out_);
    }

private:
    struct Pieces {
        std::size_t first = 0, count = 0;
    };
    // A piece beside the node that is looked at.
    struct Beside {
        std::size_t piece = 0;
        int corner = 0;  // of it, that is the node
    };

    // Whether all tissue around a node shares the fine level's node there.
    bool meetsInOne(Index3 n) const
    {
        bool is = true;
        volume::forEachIndex(glm::max(n - 1, Index3(0)), glm::min(n, coarse_.size - 2), [&](Index3 c) {
            const std::size_t at = coarse_.offset(c);
            is = is && isDivided_[at] == 0 && (fine_.tissue[at] == 0 || (fine_.tissue[at] >> octantOf(n - c) & 1) != 0);
        });
        return is;
    }

    std::span<const CellFragment> fragmentsIn(Index3 fineCell) const
    {
        return fine_.fragments.in(fineCell, fine_.nodes.size.y);
    }
    std::uint32_t indexOf(const CellFragment& f) const
    {
        return static_cast<std::uint32_t>(&f - fine_.fragments.cells.data());
    }
    bool isVirtual(std::uint32_t fineNode) const { return fineNode >= fine_.nodes.count(); }
    Index3 placeOf(std::uint32_t fineNode) const
    {
        return isVirtual(fineNode) ? fine_.fragments.nodes[fineNode - fine_.nodes.count()].at : fine_.nodes.node(fineNode);
    }

    Pieces piecesOf(Index3 cell)
    {
        const auto [known, isNew] = pieces_.try_emplace(coarse_.offset(cell));
        if (!isNew) {
            return known->second;
        }
        std::vector<Piece> found;
        if (const std::uint8_t children = fine_.tissue[coarse_.offset(cell)]; children != 0) {
            found.push_back({cell, children, {}, {}});
        }
        for (int i = 0; i < 8; ++i) {
            for (const CellFragment& f : fragmentsIn(2 * cell + octant(i))) {
                addFragment(f, found);
            }
        }
        known->second = {all_.size(), found.size()};
        for (Piece& p : found) {
            for (int c = 0; c < 8; ++c) {
                p.nodes[static_cast<std::size_t>(c)] = static_cast<std::uint32_t>(coarse_.offset(cell + octant(c)));
            }
            all_.push_back(std::move(p));
        }
        return known->second;
    }

    // Joins a fragment of the fine level and the pieces of its coarse cell that share a node with it.
    void addFragment(const CellFragment& f, std::vector<Piece>& found) const
    {
        Piece one{f.cell / 2, 0, {}, {}};
        std::erase_if(found, [&](const Piece& other) {
            const bool isPart = shareNode(other, f);
            one.children |= isPart ? other.children : std::uint8_t{0};
            one.fragments.insert(one.fragments.end(), other.fragments.begin(),
                                 isPart ? other.fragments.end() : other.fragments.begin());
            return isPart;
        });
        one.fragments.push_back(indexOf(f));
        found.push_back(std::move(one));
    }

    bool shareNode(const Piece& piece, const CellFragment& f) const
    {
        return std::ranges::any_of(f.nodes, [&](std::uint32_t node) {
            const auto has = [&](std::uint32_t other) {
                const auto& nodes = fine_.fragments.cells[other].nodes;
                return std::ranges::find(nodes, node) != nodes.end();
            };
            return (!isVirtual(node) && isCorner(piece, fine_.nodes.node(node))) ||
                   std::ranges::any_of(piece.fragments, has);
        });
    }

    // Whether a node of the fine level is one of the piece's whole cells.
    static bool isCorner(const Piece& piece, Index3 node)
    {
        for (int i = 0; i < 8; ++i) {
            const Index3 off = node - (2 * piece.cell + octant(i));
            if ((piece.children >> i & 1) != 0 && off == glm::clamp(off, Index3(0), Index3(1))) {
                return true;
            }
        }
        return false;
    }

    // Gives the pieces around a node nodes of their own, where they do not hang together there.
    void divide(Index3 n)
    {
        beside_.clear();
        Groups groups;
        for (int i = 0; i < 8; ++i) {
            const Index3 cell = n - 1 + octant(i);
            if (cell != glm::clamp(cell, Index3(0), coarse_.size - 2)) {
                continue;
            }
            const Pieces found = piecesOf(cell);
            for (std::size_t k = 0; k < found.count; ++k) {
                beside_.push_back({found.first + k, 7 - i});
                groups.add();
            }
        }
        if (beside_.size() < 2) {
            return;
        }
        joinSharers(n, groups);
        if (joinsAround_ && !groups.areOne()) {
            joinAround(n, groups);
        }
        std::vector<std::size_t> cells(beside_.size(), 0);  // by group, without those that are loose
        for (std::size_t i = 0; i < beside_.size(); ++i) {
            cells[groups.of(i)] += heldCells(all_[beside_[i].piece]);
        }
        const auto keeps = static_cast<std::size_t>(std::ranges::max_element(cells) - cells.begin());
        std::vector<std::uint32_t> nodes(beside_.size(), noFragment);
        for (std::size_t i = 0; i < beside_.size(); ++i) {
            const std::size_t group = groups.of(i);
            if (group != keeps && cells[group] > 0) {
                if (nodes[group] == noFragment) {
                    nodes[group] = static_cast<std::uint32_t>(coarse_.count() + out_.coarse.nodes.size());
                    out_.coarse.nodes.push_back({n, 0.0F, false});
                }
                all_[beside_[i].piece].nodes[static_cast<std::size_t>(beside_[i].corner)] = nodes[group];
            }
        }
    }

    std::size_t heldCells(const Piece& piece) const
    {
        const unsigned loose = fine_.loose[coarse_.offset(piece.cell)];
        return piece.fragments.size() + static_cast<std::size_t>(std::popcount(piece.children & ~loose));
    }

    // Joins the pieces that hang together within a further cell around the node: the steps of voxels on a surface are no
    // gaps.
    void joinAround(Index3 n, Groups& groups)
    {
        const CellBits tissue = tissueAround(n);
        std::vector<CellBits> parts(beside_.size());
        for (std::size_t i = 0; i < beside_.size(); ++i) {
            const Piece& piece = all_[beside_[i].piece];
            const Index3 at = 2 * (piece.cell - n + 2) + octant(std::countr_zero(piece.children));
            CellBits& part = parts[i];
            part.set(at);
            const auto before = std::find_if(parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(i),
                                             [&](const CellBits& other) { return other.has(at); });
            groups.join(static_cast<std::size_t>(before - parts.begin()), i);
            for (bool grows = &*before == &part; grows;) {
                grows = part.growIn(tissue);
            }
        }
    }

    // Of the cells of the fine level in the four coarse ones around a node along each axis.
    CellBits tissueAround(Index3 n) const
    {
        CellBits tissue;
        volume::forEachIndex(glm::max(n - 2, Index3(0)), glm::min(n + 1, coarse_.size - 1), [&](Index3 c) {
            const unsigned children = fine_.tissue[coarse_.offset(c)];
            for (int i = 0; i < 8; ++i) {
                if ((children >> i & 1) != 0) {
                    tissue.set(2 * (c - n + 2) + octant(i));
                }
            }
        });
        return tissue;
    }

    // Calls visit(node, its place) for the nodes of the fine level that a piece has, some more than once.
    template <typename Visit>
    void forEachNode(const Piece& piece, const Visit& visit) const
    {
        for (int c = 0; c < 64; ++c) {
            if ((piece.children >> (c / 8) & 1) != 0) {
                const Index3 place = 2 * piece.cell + octant(c / 8) + octant(c % 8);
                visit(static_cast<std::uint32_t>(fine_.nodes.offset(place)), place);
            }
        }
        for (const std::uint32_t f : piece.fragments) {
            for (const std::uint32_t node : fine_.fragments.cells[f].nodes) {
                visit(node, placeOf(node));
            }
        }
    }

    // Joins the pieces that share a node of the fine level at the node or beside it.
    void joinSharers(Index3 n, Groups& groups)
    {
        std::array<std::size_t, 27> first;  // piece that has a node of the level there
        first.fill(beside_.size());
        sharers_.clear();
        for (std::size_t i = 0; i < beside_.size(); ++i) {
            forEachNode(all_[beside_[i].piece], [&](std::uint32_t node, Index3 place) {
                const Index3 off = place - 2 * n;
                if (off != glm::clamp(off, Index3(-1), Index3(1))) {
                    return;
                }
                if (isVirtual(node)) {
                    sharers_.emplace_back(node, i);
                    return;
                }
                std::size_t& one = first[static_cast<std::size_t>(13 + off.x + 3 * off.y + 9 * off.z)];
                one = std::min(one, i);
                groups.join(one, i);
            });
        }
        std::ranges::sort(sharers_);
        for (std::size_t i = 1; i < sharers_.size(); ++i) {
            if (sharers_[i].first == sharers_[i - 1].first) {
                groups.join(sharers_[i].second, sharers_[i - 1].second);
            }
        }
    }

    // Pieces with virtual nodes become fragments of the coarse level.
    void keepFragments()
    {
        for (std::size_t i = 0; i < all_.size(); ++i) {
            if (std::ranges::any_of(all_[i].nodes, [&](std::uint32_t n) { return n >= coarse_.count(); })) {
                kept_.push_back(i);
            }
        }
        std::ranges::stable_sort(kept_, {}, [&](std::size_t i) { return coarse_.offset(all_[i].cell); });
        for (const std::size_t i : kept_) {
            const Piece& piece = all_[i];
            const auto index = static_cast<std::uint32_t>(out_.coarse.cells.size());
            out_.coarse.cells.push_back({.cell = piece.cell, .nodes = piece.nodes, .children = piece.children});
            for (const std::uint32_t f : piece.fragments) {
                out_.parents[f] = index;
            }
        }
        out_.coarse.rows = rowsOf(out_.coarse.cells, coarse_.size, &CellFragment::cell);
    }

    void linkNodes()
    {
        for (const std::size_t i : kept_) {
            const Piece& piece = all_[i];
            forEachNode(piece, [&](std::uint32_t node, Index3) { link(node, piece.cell, piece.nodes); });
        }
        for (std::size_t f = 0; f < out_.parents.size(); ++f) {
            if (out_.parents[f] == noFragment) {
                linkToCell(fine_.fragments.cells[f]);
            }
        }
        std::ranges::sort(out_.links, {}, [&](const NodeLink& l) { return std::pair(fine_.nodes.offset(l.at), l.node); });
        out_.linkRows = rowsOf(out_.links, fine_.nodes.size, &NodeLink::at);
    }

    void linkToCell(const CellFragment& f)
    {
        const Index3 cell = f.cell / 2;
        std::array<std::uint32_t, 8> corners{};
        for (int c = 0; c < 8; ++c) {
            corners[static_cast<std::size_t>(c)] = static_cast<std::uint32_t>(coarse_.offset(cell + octant(c)));
        }
        for (const std::uint32_t node : f.nodes) {
            link(node, cell, corners);
        }
    }

    // A node in a coarse cell with these corners.
    void link(std::uint32_t node, Index3 cell, const std::array<std::uint32_t, 8>& corners)
    {
        const Index3 at = placeOf(node);
        NodeLink one{at, node, 0, {}};
        bool any = isVirtual(node);
        volume::forEachIndex(at / 2, at / 2 + at % 2, [&](Index3 parent) {
            const std::uint32_t p = corners[static_cast<std::size_t>(octantOf(parent - cell))];
            any = any || p >= coarse_.count();
            one.parents[one.count++] = p;
        });
        if (any && linked_.insert(node).second) {
            out_.links.push_back(one);
        }
    }

    const FineCells fine_;
    const volume::NodeGrid& coarse_;
    bool joinsAround_;
    std::vector<std::uint8_t> isDivided_;  // coarse cells with fragments of the fine level
    std::vector<Piece> all_;
    std::unordered_map<std::size_t, Pieces> pieces_;  // by coarse cell
    std::vector<std::size_t> kept_;                   // pieces that are fragments
    std::unordered_set<std::uint32_t> linked_;
    std::vector<Beside> beside_;
    std::vector<std::pair<std::uint32_t, std::size_t>> sharers_;  // virtual nodes, with the pieces that have them
    Split out_;
};

// Whether an eighth of one cell shares a corner with one of the cell at `off` from it. A cell's own eighths meet in its
// middle.
bool meet(std::uint8_t one, std::uint8_t other, Index3 off) noexcept
{
    if (one == 0xFF && other == 0xFF) {
        return true;
    }
    bool any = false;
    for (int i = 0; i < 64 && !any; ++i) {
        const Index3 between = glm::abs(2 * off + octant(i / 8) - octant(i % 8));
        const bool both = (one >> (i % 8) & 1) != 0 && (other >> (i / 8) & 1) != 0;
        any = both && between == glm::min(between, Index3(1));
    }
    return any;
}

}  // namespace

std::vector<std::uint8_t> looseCells(const CellLevel& finest, const std::vector<float>& held,
                                     const std::vector<std::uint8_t>& octants)
{
    const volume::NodeGrid& g = finest.nodes;
    std::vector<std::uint8_t> loose(g.count(), 0);
    std::vector<std::uint32_t> open;
    const auto reach = [&](std::size_t cell) {
        loose[cell] = 0;
        open.push_back(static_cast<std::uint32_t>(cell));
    };
    for (std::size_t i = 0; i < g.count(); ++i) {
        loose[i] = finest.mu[i] > 0.0F ? 1 : 0;
    }
    volume::forEachIndex(Index3(0), g.size - 2, [&](Index3 c) {
        const std::size_t cell = g.offset(c);
        bool isHeld = held[cell] > 0.0F;
        for (int i = 0; i < 8 && loose[cell] != 0 && !isHeld; ++i) {
            isHeld = finest.fixed[g.offset(c + octant(i))] != 0;
        }
        // What lies behind a support is held, and is no cell.
        if (isHeld) {
            reach(cell);
        }
    });
    const auto whole = [&](std::size_t cell) { return octants.empty() ? std::uint8_t{0xFF} : octants[cell]; };
    while (!open.empty()) {
        const std::size_t from = open.back();
        const Index3 c = g.node(from);
        open.pop_back();
        volume::forEachIndex(glm::max(c - 1, Index3(0)), glm::min(c + 1, g.size - 2), [&](Index3 other) {
            const std::size_t to = g.offset(other);
            if (loose[to] != 0 && meet(whole(from), whole(to), other - c)) {
                reach(to);
            }
        });
    }
    return loose;
}

Split splitFinest(const CellLevel& finest, const std::vector<std::uint8_t>& loose, const std::vector<std::uint8_t>& octants)
{
    const volume::NodeGrid& g = finest.nodes;
    const Fragments none;
    FineCells eighths{{2 * g.size - 1, g.origin, 0.5 * g.spacing}, none, octants, octants};
    for (std::size_t i = 0; i < g.count(); ++i) {
        // What lies behind a support is tissue, and no cell.
        eighths.tissue[i] = finest.mu[i] > 0.0F ? octants[i] : std::uint8_t{0};
        eighths.loose[i] = loose[i] != 0 ? eighths.tissue[i] : std::uint8_t{0};
    }
    return Splitter(std::move(eighths), g, true).run();
}

Split splitLevel(const CellLevel& fine, const std::vector<std::uint8_t>& loose, const volume::NodeGrid& coarse)
{
    FineCells cells{fine.nodes, fine.fragments, std::vector<std::uint8_t>(coarse.count(), 0), {}};
    cells.loose = cells.tissue;
    volume::forEachIndex(Index3(0), coarse.size - 2, [&](Index3 c) {
        unsigned tissue = 0, apart = 0;
        for (int i = 0; i < 8; ++i) {
            const std::size_t at = fine.nodes.offset(2 * c + octant(i));
            tissue |= fine.mu[at] > 0.0F ? 1U << i : 0U;
            apart |= loose[at] != 0 ? 1U << i : 0U;
        }
        cells.tissue[coarse.offset(c)] = static_cast<std::uint8_t>(tissue);
        cells.loose[coarse.offset(c)] = static_cast<std::uint8_t>(apart);
    });
    return Splitter(std::move(cells), coarse, false).run();
}

}  // namespace palpate::chainmail
