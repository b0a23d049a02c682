// Cells that their tissue fills in part, see Cut. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

namespace palpate::chainmail {

namespace {

// The modes of a cell around the middle c of its tissue: with u the sum of modes by x, y, z, x y and so on, its derivatives
// there. Their gradient goes back the same way.
class Cuts {
public:
    explicit Cuts(const CutCells& cuts) noexcept : cuts_(cuts) {}

    Spread spread(std::size_t cell) const noexcept
    {
        return {load(cuts_.spread[0] + cell), load(cuts_.spread[1] + cell), load(cuts_.spread[2] + cell)};
    }

    [[gnu::always_inline]] void toMiddle(std::size_t cell, Modes (&m)[3]) const noexcept
    {
        const Lanes c[3] = {load(cuts_.middle[0] + cell), load(cuts_.middle[1] + cell), load(cuts_.middle[2] + cell)};
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            const Lanes xy = m[i].xy + c[2] * m[i].xyz;
            const Lanes zx = m[i].zx + c[1] * m[i].xyz;
            m[i].x += c[1] * m[i].xy + c[2] * zx;
            m[i].y += c[0] * m[i].xy + c[2] * (m[i].yz + c[0] * m[i].xyz);
            m[i].z += c[1] * m[i].yz + c[0] * zx;
            m[i].yz += c[0] * m[i].xyz;
            m[i].xy = xy;
            m[i].zx = zx;
        }
    }

    [[gnu::always_inline]] void fromMiddle(std::size_t cell, Modes (&g)[3]) const noexcept
    {
        const Lanes c[3] = {load(cuts_.middle[0] + cell), load(cuts_.middle[1] + cell), load(cuts_.middle[2] + cell)};
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            const Lanes xyz = c[1] * c[2] * g[i].x + c[0] * c[2] * g[i].y + c[0] * c[1] * g[i].z;
            g[i].xyz += xyz + c[2] * g[i].xy + c[0] * g[i].yz + c[1] * g[i].zx;
            g[i].xy += c[1] * g[i].x + c[0] * g[i].y;
            g[i].yz += c[2] * g[i].y + c[1] * g[i].z;
            g[i].zx += c[2] * g[i].x + c[0] * g[i].z;
        }
    }

private:
    const CutCells& cuts_;
};

}  // namespace

}  // namespace palpate::chainmail
