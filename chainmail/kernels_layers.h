// Thin layers in cells, see CellLayer. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

namespace palpate::chainmail {

namespace {

// One of the places that stand for a layer's thickness: a membrane of its share of the stiffness that moves with the cell.
// The displacement's gradient there is D / (4 h), D of the modes; in the plane across the normal n, with Q = I - n n^T, the
// strain is e = Q sym(D) Q. No stress across it, as in a cell that bends: its stress is 2 mu (e + s tr(e) Q). Adds to g the
// gradient of its energy.
class Sheet {
public:
    Sheet(const CellLayers& layers, std::size_t cell, float side, float share) noexcept
        : mu_(share * load(layers.mu + cell)),
          n_{load(layers.normal[0] + cell), load(layers.normal[1] + cell), load(layers.normal[2] + cell)},
          c_{load(layers.middle[0] + cell) + side * load(layers.half[0] + cell),
             load(layers.middle[1] + cell) + side * load(layers.half[1] + cell),
             load(layers.middle[2] + cell) + side * load(layers.half[2] + cell)}
    {
    }

    // Small strain. s = lambda / (lambda + 2 mu) of the cell.
    [[gnu::always_inline]] void small(Lanes s, const Modes (&m)[3], Modes (&g)[3]) const noexcept
    {
        Lanes d[3][3];
        at(m, d);
        Lanes t[3][3];
        inPlane(d, t);
        stress(s, t);
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            const Lanes p[3] = {4.0F * mu_ * t[i][0], 4.0F * mu_ * t[i][1], 4.0F * mu_ * t[i][2]};
            give(p, g[i]);
        }
    }

    // A thin sheet of incompressible neo-Hookean rubber, W = M / 2 (I_C - 3 + 1 / D), D = det C in the plane, with the term
    // (s - 1) M / 4 (1 - 1 / D)^2 for other ratios of Poisson; where less than half of the area is left it goes on along
    // its slope in D, and stays finite. In the strain e, with d = D - 1 = 2 tr e + 2 ((tr e)^2 - e : e), so that no small
    // difference of large numbers is taken. `factor` of D in the displacement's gradient, h8: 8 h.
    [[gnu::always_inline]] Lanes finite(Lanes s, float factor, float h8, const Modes (&m)[3], Modes (&g)[3]) const noexcept
    {
        constexpr float least = 0.25F - 1.0F;
        Lanes d[3][3];
        at(m, d);
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                d[i][j] = factor * d[i][j];
            }
        }
        Lanes green[3][3];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                green[i][j] = d[i][j] + 0.5F * (d[0][i] * d[0][j] + d[1][i] * d[1][j] + d[2][i] * d[2][j]);
            }
        }
        Lanes e[3][3];
        inPlane(green, e);
        const Lanes trace = e[0][0] + e[1][1] + e[2][2];
        Lanes square{};
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            square += e[i][0] * e[i][0] + e[i][1] * e[i][1] + e[i][2] * e[i][2];
        }
        const Lanes mixed = trace * trace - square;
        const Lanes area = 2.0F * (trace + mixed);
        const Lanes kept = area > least ? area : Lanes{} + least;
        const Lanes less = area - kept;
        const Lanes r = 1.0F / (1.0F + kept);
        const Lanes lost = kept * r;                    // 1 - 1 / D
        const Lanes slope = (s - 1.0F) * lost * r * r;  // of the term in s: twice, by D
        // Q - A / D^2 with A = Q + 2 (tr e Q - e)
        const Lanes even = r * r * (kept * (kept + 2.0F) - 2.0F * trace) + slope * (1.0F + 2.0F * trace);
        const Lanes own = 2.0F * (r * r - slope);
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                e[i][j] = own * e[i][j] + even * ((i == j ? Lanes{} + 1.0F : Lanes{}) - n_[i] * n_[j]);
            }
        }
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            Lanes p[3];
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                p[j] = h8 * mu_ * (e[i][j] + d[i][0] * e[0][j] + d[i][1] * e[1][j] + d[i][2] * e[2][j]);
            }
            give(p, g[i]);
        }
        return mu_ * (r * (trace * kept - mixed + 0.5F * less) + 0.25F * (s - 1.0F) * lost * lost +
                      0.5F * (slope - r * r) * less);
    }

private:
    [[gnu::always_inline]] void at(const Modes (&m)[3], Lanes (&d)[3][3]) const noexcept
    {
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            d[i][0] = m[i].x + c_[1] * m[i].xy + c_[2] * m[i].zx + c_[1] * c_[2] * m[i].xyz;
            d[i][1] = m[i].y + c_[0] * m[i].xy + c_[2] * m[i].yz + c_[0] * c_[2] * m[i].xyz;
            d[i][2] = m[i].z + c_[1] * m[i].yz + c_[0] * m[i].zx + c_[0] * c_[1] * m[i].xyz;
        }
    }

    [[gnu::always_inline]] void give(const Lanes (&p)[3], Modes& g) const noexcept
    {
        g.x += p[0];
        g.y += p[1];
        g.z += p[2];
        g.xy += c_[1] * p[0] + c_[0] * p[1];
        g.yz += c_[2] * p[1] + c_[1] * p[2];
        g.zx += c_[2] * p[0] + c_[0] * p[2];
        g.xyz += c_[1] * c_[2] * p[0] + c_[0] * c_[2] * p[1] + c_[0] * c_[1] * p[2];
    }

    // Q sym(d) Q.
    [[gnu::always_inline]] void inPlane(const Lanes (&d)[3][3], Lanes (&t)[3][3]) const noexcept
    {
        Lanes e[3][3];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                e[i][j] = 0.5F * (d[i][j] + d[j][i]);
            }
        }
        Lanes v[3];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            v[i] = e[i][0] * n_[0] + e[i][1] * n_[1] + e[i][2] * n_[2];
        }
        const Lanes across = v[0] * n_[0] + v[1] * n_[1] + v[2] * n_[2];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                t[i][j] = e[i][j] - n_[i] * v[j] - v[i] * n_[j] + across * n_[i] * n_[j];
            }
        }
    }

    // t + s tr(t) Q
    [[gnu::always_inline]] void stress(Lanes s, Lanes (&t)[3][3]) const noexcept
    {
        const Lanes trace = s * (t[0][0] + t[1][1] + t[2][2]);
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                t[i][j] += (i == j ? trace : Lanes{}) - trace * n_[i] * n_[j];
            }
        }
    }

    Lanes mu_, n_[3], c_[3];
};

// Cells without layers: the code for those is not even there.
struct NoLayers {
    explicit NoLayers(const CellLayers&) noexcept {}
    void small(std::size_t, Lanes, const Modes (&)[3], Modes (&)[3]) const noexcept {}
};

// Adds what the layers of W cells have, where one of them has a layer.
class Layers {
public:
    explicit Layers(const CellLayers& layers) noexcept : layers_(layers) {}

    void small(std::size_t cell, Lanes s, const Modes (&m)[3], Modes (&g)[3]) const noexcept
    {
        forEachSheet(cell, [&](const Sheet& sheet) { sheet.small(s, m, g); });
    }

    // Returns the energy, in the scaled modulus.
    Lanes finite(std::size_t cell, Lanes s, float factor, float h8, const Modes (&m)[3], Modes (&g)[3]) const noexcept
    {
        Lanes energy{};
        forEachSheet(cell, [&](const Sheet& sheet) { energy += sheet.finite(s, factor, h8, m, g); });
        return energy;
    }

private:
    template <typename Visit>
    [[gnu::always_inline]] void forEachSheet(std::size_t cell, const Visit& visit) const noexcept
    {
        const int places = layers_.places[cell / Layout::lanes];
        for (int i = 0; i < places; ++i) {
            visit(Sheet(layers_, cell, i == 0 ? -1.0F : 1.0F, places == 1 ? 1.0F : 0.5F));
        }
    }

    const CellLayers& layers_;
};

}  // namespace

}  // namespace palpate::chainmail
