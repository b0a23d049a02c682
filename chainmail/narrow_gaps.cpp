#include <chainmail/narrow_gaps.h>

#include <chainmail/cell_bits.h>

#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <optional>
#include <unordered_map>
#include <utility>

namespace palpate::chainmail {

namespace {

// Of the 64 parts of cells around a corner of eighths, 4 x 4 x 4 quarters of an edge, a bit for each, x fastest.
using Quarters = std::uint64_t;

constexpr Quarters firstEighth = 0x00330033;

// How far from the first one the bits of an eighth lie.
int shiftOf(Index3 eighth) noexcept
{
    return 2 * eighth.x + 8 * eighth.y + 32 * eighth.z;
}

Quarters lowestOf(Quarters all) noexcept
{
    return all & (~all + 1);
}

// Adds what shares a face with a quarter of `part`, until there is nothing more.
Quarters grown(Quarters part, Quarters tissue) noexcept
{
    constexpr Quarters firstX = 0x1111111111111111, firstY = 0x000F000F000F000F;
    for (Quarters before = 0; before != part;) {
        before = part;
        part |= (part << 1 & ~firstX) | (part >> 1 & ~(firstX << 3)) | (part << 4 & ~firstY) |
                (part >> 4 & ~(firstY << 12)) | part << 16 | part >> 16;
        part &= tissue;
    }
    return part;
}

// What most quarters of an eighth hang together with.
Quarters partOf(Quarters eighth, Quarters tissue) noexcept
{
    Quarters most = 0;
    for (Quarters left = eighth; left != 0;) {
        const Quarters part = grown(lowestOf(left), tissue);
        most = std::popcount(part & eighth) > std::popcount(most & eighth) ? part : most;
        left &= ~part;
    }
    return most;
}

// The quarters of the four cells around a corner along each axis, 16 x 16 x 16: a bit for each in rows along x.
class Surroundings {
public:
    static constexpr int side = 16;
    static constexpr int inner = 6;  // the first of the Quarters

    std::uint16_t& row(int y, int z) noexcept { return rows_[static_cast<std::size_t>(y + side * z)]; }

    void add(Quarters some) noexcept
    {
        for (int i = 0; i < 16; ++i) {
            row(inner + i % 4, inner + i / 4) |= static_cast<std::uint16_t>((some >> (4 * i) & 0xF) << inner);
        }
    }
    bool hasSome(Quarters some) noexcept
    {
        bool has = false;
        for (int i = 0; i < 16; ++i) {
            has = has || ((row(inner + i % 4, inner + i / 4) >> inner) & (some >> (4 * i) & 0xF)) != 0;
        }
        return has;
    }
    // Whether no cube as large as a cell is in it: a layer of voxels of three quarters of a cell is three thick.
    bool isThin() const noexcept
    {
        constexpr std::size_t cube = 4;
        bool is = true;
        for (std::size_t i = 0; i + (cube - 1) * (side + 1) < rows_.size() && is; ++i) {
            unsigned common = i % side + cube > side ? 0U : ~0U;
            for (std::size_t k = 0; k < cube * cube && common != 0; ++k) {
                common &= rows_[i + k % cube + side * (k / cube)];
            }
            is = (common & common >> 1 & common >> 2 & common >> 3) == 0;
        }
        return is;
    }

    // Adds what shares a face with one that it has, until there is nothing more.
    void grow(const Surroundings& tissue) noexcept
    {
        for (bool any = true; any;) {
            any = growOnce(tissue);
        }
    }

private:
    bool growOnce(const Surroundings& tissue) noexcept
    {
        bool any = false;
        const auto at = [&](bool is, std::size_t i) { return is ? rows_[i] : std::uint16_t{0}; };
        for (std::size_t i = 0; i < rows_.size(); ++i) {
            const std::size_t y = i % side, z = i / side;
            const unsigned own = rows_[i];
            const unsigned wide = own | own << 1 | own >> 1 | at(y > 0, i - 1) | at(y + 1 < side, i + 1) |
                                  at(z > 0, i - side) | at(z + 1 < side, i + side);
            const auto next = static_cast<std::uint16_t>(own | (wide & tissue.rows_[i]));
            any = any || next != own;
            rows_[i] = next;
        }
        return any;
    }

    std::array<std::uint16_t, 256> rows_{};
};

// Leaves out eighths of one side of each gap.
class GapCutter {
public:
    GapCutter(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials, const CellLevel& level,
              std::vector<std::uint8_t>& octants)
        : nodes_(level.nodes), quarters_(level.nodes.count(), 0), octants_(octants)
    {
        volume::forEachIndex(Index3(0), cells.size - 1, [&](Index3 c) {
            const std::size_t at = nodes_.offset(c);
            quarters_[at] = level.mu[at] > 0.0F ? materials[cells.offset(c)].quarters : Quarters{0};
        });
    }

    // First in cells, then between them. Each cell has the corners of eighths at its lowest corner and half a cell on.
    void run()
    {
        std::vector<std::uint8_t> owns(nodes_.count(), 0);
        volume::forEachIndex(Index3(1), nodes_.size - 3, [&](Index3 c) {
            const Quarters q = quarters_[nodes_.offset(c)];
            if (q != 0 && ~q != 0) {
                cutAt(2 * c + 1);
                volume::forEachIndex(c, c + 1, [&](Index3 owner) { owns[nodes_.offset(owner)] = 1; });
            }
        });
        volume::forEachIndex(Index3(1), nodes_.size - 2, [&](Index3 c) {
            for (int i = 0; i < 7 && owns[nodes_.offset(c)] != 0; ++i) {
                cutAt(2 * c + octant(i));
            }
        });
    }

private:
    struct Eighth {
        std::size_t cell = 0;
        std::uint8_t bit = 0;  // of it
    };
    // Eighths around a corner that hang together, a bit for each; of each side of the gaps there.
    struct Sides {
        std::array<std::uint8_t, 8> eighths{};
        std::size_t count = 0;
    };

    Quarters quartersOf(Index3 cell) const { return nodes_.contains(cell) ? quarters_[nodes_.offset(cell)] : Quarters{0}; }

    Quarters quartersAround(Index3 corner) const
    {
        Quarters found = 0;
        for (int i = 0; i < 8; ++i) {
            const Index3 at = corner - 1 + octant(i);
            found |= (quarters_[nodes_.offset(at / 2)] >> shiftOf(at % 2) & firstEighth) << shiftOf(octant(i));
        }
        return found;
    }

    // Of a row along x, in bits from the lowest.
    std::uint16_t row(Index3 first) const
    {
        const int shift = 4 * (first.y & 3) + 16 * (first.z & 3);
        unsigned found = 0;
        for (int x = first.x & ~3; x < first.x + Surroundings::side; x += 4) {
            const auto four = static_cast<unsigned>(quartersOf({x >> 2, first.y >> 2, first.z >> 2}) >> shift & 0xF);
            found |= x < first.x ? four >> (first.x - x) : four << (x - first.x);
        }
        return static_cast<std::uint16_t>(found);
    }

    Surroundings surroundingsOf(Index3 corner) const
    {
        constexpr int side = Surroundings::side;
        Surroundings all;
        volume::forEachIndex(Index3(0), {0, side - 1, side - 1},
                             [&](Index3 at) { all.row(at.y, at.z) = row(2 * corner - side / 2 + at); });
        return all;
    }

    Eighth eighthAt(Index3 corner, int i) const
    {
        const Index3 at = corner - 1 + octant(i);
        return {nodes_.offset(at / 2), static_cast<std::uint8_t>(1U << octantOf(at % 2))};
    }

    void cutAt(Index3 corner)
    {
        const Quarters tissue = quartersAround(corner);
        if (grown(lowestOf(tissue), tissue) == tissue) {
            return;
        }
        for (Sides sides = sidesAt(corner, tissue); sides.count > 1;) {
            std::size_t richest = 0;
            for (std::size_t i = 1; i < sides.count; ++i) {
                richest = leftOf(corner, sides.eighths[i]) > leftOf(corner, sides.eighths[richest]) ? i : richest;
            }
            for (int i = 0; i < 8; ++i) {
                if ((sides.eighths[richest] >> i & 1) != 0) {
                    const Eighth e = eighthAt(corner, i);
                    octants_[e.cell] &= static_cast<std::uint8_t>(~e.bit);
                }
            }
            sides.eighths[richest] = sides.eighths[--sides.count];
        }
    }

    // How many eighths each of the cells with some of `eighths` keeps without them, at least.
    int leftOf(Index3 corner, std::uint8_t eighths) const
    {
        int least = 8;
        for (int i = 0; i < 8; ++i) {
            if ((eighths >> i & 1) == 0) {
                continue;
            }
            const std::size_t cell = eighthAt(corner, i).cell;
            unsigned left = octants_[cell];
            for (int k = 0; k < 8; ++k) {
                const Eighth other = eighthAt(corner, k);
                left &= (eighths >> k & 1) != 0 && other.cell == cell ? ~unsigned{other.bit} : ~0U;
            }
            least = std::min(least, std::popcount(left));
        }
        return least;
    }

    Sides sidesAt(Index3 corner, Quarters tissue) const
    {
        std::array<Quarters, 8> parts{};  // that the eighths belong to
        std::optional<Quarters> other;
        bool areSeveral = false;
        for (int i = 0; i < 8; ++i) {
            const Eighth e = eighthAt(corner, i);
            const Quarters eighth =
                (octants_[e.cell] & e.bit) != 0 ? firstEighth << shiftOf(octant(i)) & tissue : Quarters{0};
            if (eighth != 0) {
                const Quarters part = partOf(eighth, tissue);
                parts[static_cast<std::size_t>(i)] = part;
                areSeveral = areSeveral || other.value_or(part) != part;
                other = part;
            }
        }
        return areSeveral ? sidesOf(parts, surroundingsOf(corner)) : Sides{};
    }

    // Those that hang together in the surroundings are one side; so are all that are thin.
    static Sides sidesOf(const std::array<Quarters, 8>& parts, const Surroundings& tissue)
    {
        Sides sides;
        std::optional<std::size_t> thinOne;
        unsigned done = 0;
        for (std::size_t i = 0; i < parts.size(); ++i) {
            if (parts[i] == 0 || (done >> i & 1U) != 0) {
                continue;
            }
            Surroundings side;
            side.add(parts[i]);
            side.grow(tissue);
            const bool isThin = side.isThin();
            const std::size_t at = isThin && thinOne ? *thinOne : sides.count++;
            thinOne = isThin ? std::optional(at) : thinOne;
            for (std::size_t k = i; k < parts.size(); ++k) {
                if (side.hasSome(parts[k])) {
                    sides.eighths[at] |= static_cast<std::uint8_t>(1U << k);
                }
            }
            done |= sides.eighths[at];
        }
        return sides;
    }

    const volume::NodeGrid& nodes_;
    std::vector<Quarters> quarters_;  // of each cell
    std::vector<std::uint8_t>& octants_;
};

// Gives eighths to cells that have none.
class SliverPlacer {
public:
    SliverPlacer(const CellLevel& level, std::vector<std::uint8_t>& octants)
        : level_(level), octants_(octants), filled_(octants)
    {
    }

    void run()
    {
        volume::forEachIndex(Index3(1), level_.nodes.size - 3, [&](Index3 c) {
            const std::size_t at = level_.nodes.offset(c);
            if (filled_[at] == 0 && level_.mu[at] > 0.0F) {
                octants_[at] = place(c);
            }
        });
    }

private:
    // Filled eighths that hang together, in a box around a cell. Those of two sides do not, since the sides share no
    // corner.
    struct Side {
        CellBits eighths;
        std::optional<Index3> one;  // of them
    };

    bool has(const std::vector<std::uint8_t>& octants, Index3 eighth) const
    {
        return (octants[level_.nodes.offset(eighth / 2)] >> octantOf(eighth % 2) & 1) != 0;
    }

    // Those that touch most filled ones, of those that touch one side alone; the whole cell where there are none.
    std::uint8_t place(Index3 cell)
    {
        std::array<int, 8> touched{};
        for (int i = 0; i < 8; ++i) {
            forEachAround(2 * cell + octant(i),
                          [&](Index3 other) { touched[static_cast<std::size_t>(i)] += has(filled_, other) ? 1 : 0; });
        }
        const CellBits filled = filledAround(cell);
        for (const bool othersYield : {false, true}) {
            for (int most = *std::ranges::max_element(touched); most > 0; --most) {
                Side side;
                std::uint8_t found = 0;
                for (int i = 0; i < 8; ++i) {
                    const bool is = touched[static_cast<std::size_t>(i)] == most;
                    if (is && join(cell, octant(i), filled, othersYield, side)) {
                        found |= static_cast<std::uint8_t>(1U << i);
                    }
                }
                if (found != 0) {
                    beside_[level_.nodes.offset(cell)] = *side.one;
                    return found;
                }
            }
        }
        return 0xFF;
    }

    template <typename Visit>
    static void forEachAround(Index3 eighth, const Visit& visit)
    {
        volume::forEachIndex(eighth - 1, eighth + 1, visit);
    }

    static Index3 lowOf(Index3 cell) { return 2 * cell - 3; }

    CellBits filledAround(Index3 cell) const
    {
        CellBits bits;
        const Index3 low = lowOf(cell);
        volume::forEachIndex(glm::max(low, Index3(0)), glm::min(low + 7, 2 * level_.nodes.size - 3), [&](Index3 e) {
            if (has(filled_, e)) {
                bits.set(e - low);
            }
        });
        return bits;
    }

    // Whether all that an eighth of the cell touches is of that side, which is its own if there is none yet. Cells that got
    // eighths of another side may yield all but one.
    bool join(Index3 cell, Index3 off, const CellBits& filled, bool othersYield, Side& side)
    {
        Side found = side;
        const Index3 low = lowOf(cell);
        const auto isOfSide = [&](Index3 eighth) {
            if (!found.one) {
                found.one = eighth;
                found.eighths.set(eighth - low);
                while (found.eighths.growIn(filled)) {
                    // goes on
                }
            }
            return found.eighths.has(eighth - low);
        };
        bool isOne = true;
        const Index3 eighth = 2 * cell + off;
        forEachAround(eighth, [&](Index3 other) { isOne = isOne && (!has(filled_, other) || isOfSide(other)); });
        std::vector<Index3> others;
        forEachAround(eighth, [&](Index3 other) {
            const auto beside = beside_.find(level_.nodes.offset(other / 2));
            if (isOne && beside != beside_.end() && has(octants_, other) && !isOfSide(beside->second)) {
                others.push_back(other);
            }
        });
        if (!isOne || !(others.empty() || (othersYield && yield(others)))) {
            return false;
        }
        side = found;
        return true;
    }

    // Takes eighths from cells that have others left; none if one has not.
    bool yield(const std::vector<Index3>& eighths)
    {
        std::vector<std::pair<std::size_t, std::uint8_t>> before;
        for (const Index3 e : eighths) {
            std::uint8_t& octants = octants_[level_.nodes.offset(e / 2)];
            const auto left = static_cast<std::uint8_t>(octants & ~(1 << octantOf(e % 2)));
            if (left == 0) {
                for (const auto& [cell, had] : before) {
                    octants_[cell] |= had;
                }
                return false;
            }
            before.emplace_back(level_.nodes.offset(e / 2), octants);
            octants = left;
        }
        return true;
    }

    const CellLevel& level_;
    std::vector<std::uint8_t>& octants_;
    const std::vector<std::uint8_t> filled_;
    std::unordered_map<std::size_t, Index3> beside_;  // by cell that got some: a filled one that they touch
};

}  // namespace

std::vector<std::uint8_t> octantsOf(const volume::NodeGrid& cells, const std::vector<volume::CellMaterial>& materials,
                                    const CellLevel& level)
{
    std::vector<std::uint8_t> octants(level.nodes.count(), 0);
    volume::forEachIndex(Index3(0), cells.size - 1, [&](Index3 c) {
        const std::size_t at = level.nodes.offset(c);
        octants[at] = level.mu[at] > 0.0F ? materials[cells.offset(c)].octants : std::uint8_t{0};
    });
    GapCutter(cells, materials, level, octants).run();
    bool isDivided = false;
    for (std::size_t i = 0; i < octants.size(); ++i) {
        isDivided = isDivided || (octants[i] != 0xFF && level.mu[i] > 0.0F);
    }
    if (!isDivided) {
        return {};
    }
    SliverPlacer(level, octants).run();
    return octants;
}

}  // namespace palpate::chainmail
