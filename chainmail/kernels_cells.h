// The operator: sweeps over cells. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

namespace palpate::chainmail {

namespace {

// Small strain: the law of kernels.h.
template <typename Layer>
struct Linear {
    Layer layers;
    Cuts cuts;

    template <typename Filled>
    void operator()(const Filled& filled, Lanes mu, Lanes lambda, std::size_t cell, const Modes (&m)[3],
                    Modes (&g)[3]) noexcept
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

// Finite strain: stable neo-Hookean and what the law has beyond it, on the mean deformation gradient. With modes eight
// times their size F = I + m / (4 h), and the gradient by a mode is h^2 / 4 times the first Piola-Kirchhoff stress: 8 h
// times the scaled stiffness.
template <typename Law, typename Layer, typename Bending>
struct Finite {
    float inverse;            // 1 / h
    const float* stiffening;  // of each cell, or none
    Layer layers;
    Cuts cuts;
    Bending bending;
    Lanes energy[Layout::lanes / W] = {};  // sixteen partial sums at any width
    std::size_t turn = 0;

    // With G = F - I:  J - 1 = tr G + (tr^2 - G : G^T) / 2 + det G, so that no small difference of large numbers is taken.
    template <typename Filled>
    void operator()(const Filled& filled, Lanes mu, Lanes lambda, std::size_t cell, const Modes (&m)[3],
                    Modes (&g)[3]) noexcept
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
        const Lanes pressure = (lambda + mu) * volume;
        Lanes square{};
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
            square += f[i][0] * f[i][0] + f[i][1] * f[i][1] + f[i][2] * f[i][2];
        }
        const volume::Invariant<Lanes> stretch = volume::isochoric(square - 2.0F * (minors + determinant), volume);
        const volume::Stiffening<Lanes> beyond =
            Law::beyond(mu, stiffening != nullptr ? load(stiffening + cell) : Lanes{}, stretch.i);
        const Lanes shear = mu + beyond.slope * stretch.byShape;
        const Lanes pushed = pressure + 0.5F * beyond.slope * stretch.byVolume;
        Lanes p[3][3];
#pragma GCC unroll 3
        for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 3
            for (int j = 0; j < 3; ++j) {
                // Cofactor of F, less I: tr G I - G^T + cof G.
                const Lanes cofactor = c[i][j] - f[j][i] + (i == j ? trace : Lanes{});
                p[i][j] = h8 * (shear * (f[i][j] - cofactor) + pushed * (i == j ? cofactor + 1.0F : cofactor));
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
        const Lanes bend = hourglassTurned(filled, mu, lambda, q, bending, f, m, g);
        const Lanes layer = layers.finite(cell, lambda / (lambda + 2.0F * mu + tiny), q, h8, m, g);
        // h^3 W is 32 h^2 times W of the scaled stiffness.
        const float h2 = 32.0F / (inverse * inverse);
        energy[turn] +=
            h2 * (mu * (0.5F * square - minors - determinant) + 0.5F * pressure * volume + beyond.energy + layer) +
            0.5F * bend;
        turn = (turn + 1) % (Layout::lanes / W);
    }
};

// The gradient g of the energy of W cells by their modes m.
template <typename Law>
[[gnu::always_inline]] inline void energyOf(Law& law, Filling filling, Lanes mu, Lanes lambda, std::size_t cell,
                                            const Modes (&m)[3], Modes (&g)[3]) noexcept
{
    if (filling == Filling::whole) [[likely]] {
        law(Whole{}, mu, lambda, cell, m, g);
        return;
    }
    Modes within[3] = {m[0], m[1], m[2]};
    law.cuts.toMiddle(cell, within);
    law(law.cuts.spread(cell), mu, lambda, cell, within, g);
    law.cuts.fromMiddle(cell, g);
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

// or it is stored and smooths u, u += weight * diagonal (r - A u). The sweep has read a plane of u before it gets here.
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

// One row of cells gives to two rows of nodes: `first` is its lower row, complete with what the row before left in `carry`.
// Along x a node takes from the cell on its right and from the one on its left.
template <typename Keeper>
class RowSum {
public:
    RowSum(float* carry, const Keeper& keep, std::size_t component, std::size_t at)
        : carry_(carry), keep_(keep), component_(component), at_(at)
    {
    }

    void add(std::size_t i, const Plane& v) noexcept
    {
        const Lanes s = v.ss - v.sd + load(carry_ + 2 * i);
        const Lanes d = v.ds - v.dd + load(carry_ + 2 * i + W);
        store(carry_ + 2 * i, v.ss + v.sd);
        store(carry_ + 2 * i + W, v.ds + v.dd);
        emit(i, s, d);
    }

    // The last row of nodes has no cells of its own.
    void finish(std::size_t i) noexcept { emit(i, load(carry_ + 2 * i), load(carry_ + 2 * i + W)); }

private:
    void emit(std::size_t i, Lanes s, Lanes d) noexcept
    {
        const Lanes right = s + d;
        keep_(component_, at_ + i, s - d + shifted(before_, right));
        before_ = right;
    }

    float* carry_;
    const Keeper& keep_;
    std::size_t component_;
    std::size_t at_;
    Lanes before_{};
};

// Gives what was gathered for one plane of nodes to its rows.
template <typename Keeper>
struct Sweep {
    const Layout& layout;
    const float* u;
    const Keeper& keep;
    float* planes;   // sums and differences of the plane below (12 x plane)
    float* pending;  // what the layer below gave to the plane (12 x plane)
    float* carry;    // what the row before gave to this row (6 x row)

    Plane planeAt(int c, std::size_t at) const noexcept
    {
        return planeOf(u + static_cast<std::size_t>(c) * layout.count + at, layout.row);
    }
    float* component(float* p, int c) const noexcept { return p + static_cast<std::size_t>(c) * 4 * layout.plane; }
    float* carryOf(int c) const noexcept { return carry + static_cast<std::size_t>(c) * 2 * layout.row; }

    void begin() noexcept
    {
        std::memset(pending, 0, 12 * layout.plane * sizeof(float));
#pragma GCC unroll 3
        for (int c = 0; c < 3; ++c) {
            for (std::size_t at = 0; at + layout.row < layout.plane; at += W) {
                storePlane(component(planes, c) + at, layout.plane, planeAt(c, at));
            }
        }
    }

    void lastRow(std::size_t at) noexcept
    {
#pragma GCC unroll 3
        for (int c = 0; c < 3; ++c) {
            RowSum<Keeper> sum(carryOf(c), keep, static_cast<std::size_t>(c), at);
            for (std::size_t i = 0; i < layout.row; i += W) {
                sum.finish(i);
            }
        }
    }

    static Filling fillingAt(const CellStiffness& stiffness, std::size_t cell) noexcept
    {
        return stiffness.filling != nullptr ? stiffness.filling[cell / Layout::lanes] : Filling::whole;
    }

    // What cells without tissue do: the plane above them becomes the one below, and nodes get what others gave.
    void passOn(std::size_t above, std::size_t inPlane, std::size_t i, RowSum<Keeper> (&sum)[3]) noexcept
    {
#pragma GCC unroll 3
        for (int c = 0; c < 3; ++c) {
            storePlane(component(planes, c) + inPlane, layout.plane, planeAt(c, above));
            float* wait = component(pending, c) + inPlane;
            sum[c].add(i, loadPlane(wait, layout.plane));
            storePlane(wait, layout.plane, Plane{});
        }
    }

    template <typename Law>
    void layer(int k, CellStiffness stiffness, Law& law) noexcept
    {
        const std::size_t above = layout.at(0, 0, k + 1);
        std::memset(carry, 0, 6 * layout.row * sizeof(float));
        for (int j = 0; j + 1 < layout.ny; ++j) {
            const std::size_t at = layout.at(0, j, k);
            const std::size_t inPlane = static_cast<std::size_t>(j) * layout.row;
            RowSum<Keeper> sum[3] = {{carryOf(0), keep, 0, at}, {carryOf(1), keep, 1, at}, {carryOf(2), keep, 2, at}};
            for (std::size_t i = 0; i < layout.row; i += W) {
                const Filling filling = fillingAt(stiffness, at + i);
                if (filling == Filling::empty) {
                    passOn(above + inPlane + i, inPlane + i, i, sum);
                    continue;
                }
                Modes m[3];
                Modes g[3];
#pragma GCC unroll 3
                for (int c = 0; c < 3; ++c) {
                    const Plane high = planeAt(c, above + inPlane + i);
                    m[c] = modesOf(loadPlane(component(planes, c) + inPlane + i, layout.plane), high);
                    storePlane(component(planes, c) + inPlane + i, layout.plane, high);
                }
                energyOf(law, filling, load(stiffness.mu + at + i), load(stiffness.lambda + at + i), at + i, m, g);
#pragma GCC unroll 3
                for (int c = 0; c < 3; ++c) {
                    float* wait = component(pending, c) + inPlane + i;
                    sum[c].add(i, lower(g[c]) + loadPlane(wait, layout.plane));
                    storePlane(wait, layout.plane, upper(g[c]));
                }
            }
        }
        lastRow(layout.at(0, layout.ny - 1, k));
    }

    void end() noexcept
    {
        std::memset(carry, 0, 6 * layout.row * sizeof(float));
        for (int j = 0; j + 1 < layout.ny; ++j) {
            const std::size_t inPlane = static_cast<std::size_t>(j) * layout.row;
#pragma GCC unroll 3
            for (int c = 0; c < 3; ++c) {
                RowSum<Keeper> sum(carryOf(c), keep, static_cast<std::size_t>(c), layout.at(0, j, layout.nz - 1));
                for (std::size_t i = 0; i < layout.row; i += W) {
                    sum.add(i, loadPlane(component(pending, c) + inPlane + i, layout.plane));
                }
            }
        }
        lastRow(layout.at(0, layout.ny - 1, layout.nz - 1));
    }
};

template <typename Law, typename Keeper>
void sweepCells(const Layout& layout, CellStiffness stiffness, const float* u, const Keeper& keep, float* scratch,
                Law& law) noexcept
{
    Sweep<Keeper> sweep{layout, u, keep, scratch, scratch + 12 * layout.plane, scratch + 24 * layout.plane};
    sweep.begin();
    for (int k = 0; k + 1 < layout.nz; ++k) {
        sweep.layer(k, stiffness, law);
    }
    sweep.end();
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
