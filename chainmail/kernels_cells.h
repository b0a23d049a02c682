// The operator: sweeps over cells. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

#include <type_traits>

namespace palpate::chainmail {

namespace {

// Small strain: the law of kernels.h.
template <typename Layer>
struct Linear {
    static constexpr bool stiffens = false;

    Layer layers;
    Cuts cuts;

    template <typename Filled>
    [[gnu::always_inline]] void operator()(const Filled& filled, Lanes mu, Lanes lambda, std::size_t cell,
                                           const Modes (&m)[3], Modes (&g)[3]) noexcept
    {
        const Lanes two = 2.0F * mu;
        const Lanes four = 4.0F * mu;
        const Lanes d = 2.0F * lambda * (m[0].x + m[1].y + m[2].z);
        g[0].x = four * m[0].x + d;
        g[1].y = four * m[1].y + d;
        g[2].z = four * m[2].z + d;
        g[0].y = g[1].x = two * (m[0].y + m[1].x);
        g[0].z = g[2].x = two * (m[0].z + m[2].x);
        g[1].z = g[2].y = two * (m[1].z + m[2].y);
        hourglass(filled, mu, lambda, m, g);
        layers.small(cell, lambda / (lambda + two + tiny), m, g);
    }
};

// Finite strain: the neo-Hookean energy and what the law has beyond it, on the mean deformation gradient. With modes eight
// times their size F = I + m / (4 h), and the gradient by a mode is h^2 / 4 times the first Piola-Kirchhoff stress: 8 h
// times the scaled stiffness.
template <typename Law, typename Layer, typename Bending>
struct Finite {
    static constexpr bool stiffens = true;

    float inverse;            // 1 / h
    const float* stiffening;  // of each cell, or none
    Layer layers;
    Cuts cuts;
    Bending bending;
    Lanes energy[Layout::lanes / W] = {};  // sixteen partial sums at any width

    // With G = F - I:  J - 1 = tr G + (tr^2 - G : G^T) / 2 + det G, so that no small difference of large numbers is taken.
    template <typename Filled>
    [[gnu::always_inline]] void operator()(const Filled& filled, Lanes mu, Lanes lambda, std::size_t cell,
                                           const Modes (&m)[3], Modes (&g)[3]) noexcept
    {
        const float q = 0.25F * inverse;
        const float h8 = 8.0F / inverse;
        const Lanes f[3][3] = {{q * m[0].x, q * m[0].y, q * m[0].z},
                               {q * m[1].x, q * m[1].y, q * m[1].z},
                               {q * m[2].x, q * m[2].y, q * m[2].z}};
        Lanes c[3][3];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
                c[i][j] = f[i1][j1] * f[i2][j2] - f[i1][j2] * f[i2][j1];
            }
        }
        const Lanes trace = f[0][0] + f[1][1] + f[2][2];
        const Lanes minors = c[0][0] + c[1][1] + c[2][2];
        const Lanes determinant = f[0][0] * c[0][0] + f[0][1] * c[0][1] + f[0][2] * c[0][2];
        const Lanes volume = trace + minors + determinant;
        Lanes column[3];
#pragma GCC unroll 3
        for (int j = 0; j < 3; ++j) {
            column[j] = f[0][j] * f[0][j] + f[1][j] * f[1][j] + f[2][j] * f[2][j];
        }
        const Lanes square = column[0] + column[1] + column[2];
        const volume::Invariant<Lanes> stretch = volume::isochoric(square - 2.0F * (minors + determinant), volume);
        const Lanes pressure = (lambda + (2.0F / 3.0F) * mu) * volume;
        Lanes modulus = mu, density = 0.5F * (mu * stretch.i + pressure * volume);
        if constexpr (!std::is_same_v<Filled, Constant>) {
            const volume::Stiffening<Lanes> beyond =
                Law::beyond(mu, stiffening != nullptr ? load(stiffening + cell) : Lanes{}, stretch.i);
            modulus += beyond.slope;
            density += beyond.energy;
        }
        const Lanes shear = modulus * stretch.byShape;
        const Lanes pushed = pressure + 0.5F * modulus * stretch.byVolume;
        // shear (G - C) + pushed (I + C), C = tr G I - G^T + cof G the cofactor of F, less I. What a turn has in G and C
        // alike cancels before it is multiplied.
        const Lanes byShear = h8 * shear, byPushed = h8 * pushed;
        const Lanes onDiagonal = byPushed + (byPushed - byShear) * trace;
        Lanes p[3][3];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                const Lanes strain = f[i][j] + f[j][i];
                const Lanes one = byShear * (strain - c[i][j]) + byPushed * (c[i][j] - f[j][i]);
                p[i][j] = i == j ? one + onDiagonal : one;
            }
        }
        g[0].x = p[0][0];
        g[0].y = p[0][1];
        g[0].z = p[0][2];
        g[1].x = p[1][0];
        g[1].y = p[1][1];
        g[1].z = p[1][2];
        g[2].x = p[2][0];
        g[2].y = p[2][1];
        g[2].z = p[2][2];
        const Lanes bend = hourglassTurned(filled, mu, lambda, q, bending, f, column, m, g);
        if constexpr (std::is_same_v<Layer, Layers>) {
            density += layers.finite(cell, lambda / (lambda + 2.0F * mu + tiny), q, h8, m, g);
        }
        // h^3 W is 32 h^2 times W of the scaled stiffness.
        const float h2 = 32.0F / (inverse * inverse);
        energy[cell / W % (Layout::lanes / W)] += h2 * density + 0.5F * bend;
    }
};

// The gradient g of the energy of W cells by their modes m.
template <typename Law>
[[gnu::always_inline]] inline void energyOf(Law& law, Filling filling, Lanes mu, Lanes lambda, std::size_t cell,
                                            const Modes (&m)[3], Modes (&g)[3]) noexcept
{
    if (filling == Filling::cut) [[unlikely]] {
        Modes within[3] = {m[0], m[1], m[2]};
        law.cuts.toMiddle(cell, within);
        law(law.cuts.spread(cell), mu, lambda, cell, within, g);
        law.cuts.fromMiddle(cell, g);
    } else if (Law::stiffens && filling == Filling::whole) {
        law(Whole{}, mu, lambda, cell, m, g);
    } else {
        law(Constant{}, mu, lambda, cell, m, g);
    }
}

// What becomes of A u at a node: it is stored,
struct Keep {
    float* out;
    std::size_t count;

    void operator()(std::size_t c, std::size_t at, Lanes v) const noexcept { store(out + c * count + at, v); }
};

// or it makes the residual, out = open (r - A u),
struct KeepResidual {
    const float* open;
    const float* r;
    float* out;
    std::size_t count;

    void operator()(std::size_t c, std::size_t at, Lanes v) const noexcept
    {
        store(out + c * count + at, load(open + at) * (load(r + c * count + at) - v));
    }
};

// or it is stored and smooths u, u += weight * diagonal (r - A u). The sweep has read a node for the last time before it
// gets here, but for the cells behind the end of a row, which have no stiffness.
struct KeepSmooth {
    float weight;
    const float* diagonal;
    const float* r;
    float* u;
    float* out;
    std::size_t count;

    void operator()(std::size_t c, std::size_t at, Lanes v) const noexcept
    {
        const std::size_t i = c * count + at;
        store(out + i, v);
        store(u + i, load(u + i) + weight * load(diagonal + at) * (load(r + i) - v));
    }
};

// Goes through the cells of one layer after the other, W of a row at a time along x and there from row to row along y. What
// two cells share that follow each other is kept in registers. Along z a layer gives to two planes of nodes: the lower one
// is complete with what the layer below has left in `carry`. Along x a node takes from the cell on its right and from the
// one on its left.
// @tparam Wide  rows have more than W nodes
template <typename Keeper, bool Wide>
struct Sweep {
    const Layout& layout;
    const float* u;
    const Keeper& keep;
    float* carry;   // sums and differences along x of what a layer gives to the next (6 x plane)
    float* before;  // what cells on the left give (3 x W x rows)

    static Filling fillingAt(const CellStiffness& stiffness, std::size_t cell) noexcept
    {
        if (stiffness.filling != nullptr) {
            return stiffness.filling[cell / Layout::lanes];
        }
        return stiffness.stiffening != nullptr ? Filling::whole : Filling::constant;
    }

    // Of W nodes in row j, from i on.
    float* carryOf(int j, std::size_t i) const noexcept
    {
        return carry + 6 * (static_cast<std::size_t>(j) * layout.row + i);
    }

    void clearBefore() const noexcept
    {
        if constexpr (Wide) {
            std::memset(before, 0, 3 * W * static_cast<std::size_t>(layout.ny) * sizeof(float));
        }
    }

    // One component of W nodes, complete: the cells on their right gave the sums s and differences d along x.
    void emit(int j, int c, std::size_t at, Lanes s, Lanes d) const noexcept
    {
        const Lanes right = s + d;
        Lanes left{};
        if constexpr (Wide) {
            float* const waits = before + (3 * j + c) * W;
            left = load(waits);
            store(waits, right);
        }
        keep(static_cast<std::size_t>(c), at, s - d + shifted(left, right));
    }

    // What the cells of two rows give to the row of nodes between them.
    void give(int j, std::size_t i, std::size_t at, const Plane (&v)[3]) const noexcept
    {
#pragma GCC unroll 3
        for (int c = 0; c < 3; ++c) {
            float* const sum = carryOf(j, i) + 2 * c * W;
            float* const difference = sum + W;
            const Lanes s = v[c].ss - v[c].sd + load(sum);
            const Lanes d = v[c].ds - v[c].dd + load(difference);
            store(sum, v[c].ss + v[c].sd);
            store(difference, v[c].ds + v[c].dd);
            emit(j, c, at, s, d);
        }
    }

    template <typename Law>
    void strip(int k, std::size_t i, CellStiffness stiffness, Law& law) const noexcept
    {
        std::size_t at = layout.at(0, 0, k) + i;
        const auto planeAt = [&](int c, std::size_t node) {
            return planeOf(u + static_cast<std::size_t>(c) * layout.count + node, layout.plane);
        };
        Plane low[3];
        Plane waits[3] = {};  // what the row of cells before gives
#pragma GCC unroll 3
        for (int c = 0; c < 3; ++c) {
            low[c] = planeAt(c, at);
        }
        for (int j = 0; j + 1 < layout.ny; ++j, at += layout.row) {
            const Filling filling = fillingAt(stiffness, at);
            if (filling == Filling::empty) {
                give(j, i, at, waits);
#pragma GCC unroll 3
                for (int c = 0; c < 3; ++c) {
                    low[c] = planeAt(c, at + layout.row);
                    waits[c] = Plane{};
                }
                continue;
            }
            Modes m[3];
            Modes g[3];
#pragma GCC unroll 3
            for (int c = 0; c < 3; ++c) {
                const Plane high = planeAt(c, at + layout.row);
                m[c] = modesOf(low[c], high);
                low[c] = high;
            }
            energyOf(law, filling, load(stiffness.mu + at), load(stiffness.lambda + at), at, m, g);
            Plane gives[3];
#pragma GCC unroll 3
            for (int c = 0; c < 3; ++c) {
                gives[c] = lower(g[c]) + waits[c];
                waits[c] = upper(g[c]);
            }
            give(j, i, at, gives);
        }
        give(layout.ny - 1, i, at, waits);
    }

    // The last plane of nodes has no cells of its own.
    void lastPlane() const noexcept
    {
        clearBefore();
        for (std::size_t i = 0; i < layout.row; i += W) {
            for (int j = 0; j < layout.ny; ++j) {
                for (int c = 0; c < 3; ++c) {
                    const float* const sum = carryOf(j, i) + 2 * c * W;
                    emit(j, c, layout.at(0, j, layout.nz - 1) + i, load(sum), load(sum + W));
                }
            }
        }
    }

    template <typename Law>
    void all(CellStiffness stiffness, Law& law) const noexcept
    {
        std::memset(carry, 0, 6 * layout.plane * sizeof(float));
        for (int k = 0; k + 1 < layout.nz; ++k) {
            clearBefore();
            for (std::size_t i = 0; i < layout.row; i += W) {
                strip(k, i, stiffness, law);
            }
        }
        lastPlane();
    }
};

template <typename Law, typename Keeper>
void sweepCells(const Layout& layout, CellStiffness stiffness, const float* u, const Keeper& keep, float* scratch,
                Law& law) noexcept
{
    float* const before = scratch + 6 * layout.plane;
    if (layout.row == W) {
        Sweep<Keeper, false>{layout, u, keep, scratch, before}.all(stiffness, law);
    } else {
        Sweep<Keeper, true>{layout, u, keep, scratch, before}.all(stiffness, law);
    }
}

template <typename Keeper>
void sweepLinear(const Layout& layout, const CellStiffness& stiffness, const float* u, const Keeper& keep,
                 float* scratch) noexcept
{
    const auto sweep = [&](auto law) { sweepCells(layout, stiffness, u, keep, scratch, law); };
    if (stiffness.layers.mu != nullptr) {
        sweep(Linear<Layers>{Layers(stiffness.layers), Cuts(stiffness.cuts)});
    } else {
        sweep(Linear<NoLayers>{NoLayers(stiffness.layers), Cuts(stiffness.cuts)});
    }
}

void apply(const Layout& layout, CellStiffness stiffness, const float* u, float* out, float* scratch) noexcept
{
    sweepLinear(layout, stiffness, u, Keep{out, layout.count}, scratch);
}

void residualOf(const Layout& layout, CellStiffness stiffness, const float* open, const float* r, const float* u,
                float* out, float* scratch) noexcept
{
    sweepLinear(layout, stiffness, u, KeepResidual{open, r, out, layout.count}, scratch);
}

void smoothOf(const Layout& layout, CellStiffness stiffness, const Smoother& by, float* u, float* out,
              float* scratch) noexcept
{
    sweepLinear(layout, stiffness, u, KeepSmooth{by.weight, by.diagonal, by.r, u, out, layout.count}, scratch);
}

template <typename Law, typename Layer, typename Bending>
double sweepFinite(const Layout& layout, const CellStiffness& stiffness, Bending bending, float inverse, const float* u,
                   float* out, float* scratch) noexcept
{
    Finite<Law, Layer, Bending> law{inverse, stiffness.stiffening, Layer(stiffness.layers), Cuts(stiffness.cuts), bending};
    sweepCells(layout, stiffness, u, Keep{out, layout.count}, scratch, law);
    double sum = 0.0;
    for (const Lanes& part : law.energy) {
        addLanes(sum, part);
    }
    return sum;
}

template <typename Law>
double applyLaw(const Layout& layout, CellStiffness stiffness, float inverse, const float* u, float* out,
                float* scratch) noexcept
{
    const auto sweep = [&](auto bending) {
        return stiffness.layers.mu != nullptr
                   ? sweepFinite<Law, Layers>(layout, stiffness, bending, inverse, u, out, scratch)
                   : sweepFinite<Law, NoLayers>(layout, stiffness, bending, inverse, u, out, scratch);
    };
    return stiffness.relief > 0.0F ? sweep(Relieved{stiffness.relief}) : sweep(ByStretch{});
}

using ApplyFinite = decltype(Kernels::applyFinite);

template <typename Law>
constexpr ApplyFinite finiteOf() noexcept
{
    if constexpr (Law::finite) {
        return applyLaw<Law>;
    } else {
        return nullptr;
    }
}

// One for each law, in the order of the list.
template <typename List>
struct FiniteLaws;
template <typename... Laws>
struct FiniteLaws<std::variant<Laws...>> {
    static constexpr ApplyFinite apply[] = {finiteOf<Laws>()...};
};

double applyFinite(const Layout& layout, CellStiffness stiffness, float inverse, const float* u, float* out,
                   float* scratch) noexcept
{
    return FiniteLaws<volume::Law>::apply[stiffness.law](layout, stiffness, inverse, u, out, scratch);
}

}  // namespace

}  // namespace palpate::chainmail
