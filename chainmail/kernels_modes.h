// The modes of a cell, and the energy of those that bend and twist it. Only kernels_body.h includes it.

#include <chainmail/kernels.h>

#include <type_traits>

namespace palpate::chainmail {

namespace {

// Modes of one component in a cell, eight times their size; the constant mode carries no energy.
struct Modes {
    Lanes x, y, z, xy, yz, zx, xyz;
};

// The same in one plane of nodes across y: sums (s) and differences (d) along x, then z.
struct Plane {
    Lanes ss, ds, sd, dd;
};

// @param up  from a node to the one above it along z
inline Plane planeOf(const float* u, std::size_t up) noexcept
{
    const Lanes a0 = load(u);
    const Lanes a1 = load(u + 1);
    const Lanes b0 = load(u + up);
    const Lanes b1 = load(u + up + 1);
    const Lanes as = a0 + a1;
    const Lanes ad = a1 - a0;
    const Lanes bs = b0 + b1;
    const Lanes bd = b1 - b0;
    return {as + bs, ad + bd, bs - as, bd - ad};
}

inline Modes modesOf(const Plane& low, const Plane& high) noexcept
{
    return {low.ds + high.ds, high.ss - low.ss, low.sd + high.sd, high.ds - low.ds,
            high.sd - low.sd, low.dd + high.dd, high.dd - low.dd};
}

// What the modes' gradient gives to the lower and to the upper plane of nodes.
inline Plane lower(const Modes& g) noexcept
{
    return {-g.y, g.x - g.xy, g.z - g.yz, g.zx - g.xyz};
}

inline Plane upper(const Modes& g) noexcept
{
    return {g.y, g.x + g.xy, g.z + g.yz, g.zx + g.xyz};
}

inline Plane operator+(const Plane& a, const Plane& b) noexcept
{
    return {a.ss + b.ss, a.ds + b.ds, a.sd + b.sd, a.dd + b.dd};
}

constexpr float tiny = 1e-30F;  // so that an empty cell divides by something

// Second moments of a cell's tissue along each axis, over those of a full cell.
struct Spread {
    Lanes x, y, z;
};

// A cell that is full,
struct Whole {};
// and of tissue that does not stiffen.
struct Constant : Whole {};

// Modes that bend and twist a cell. Bending: with s = lambda / (lambda + 2 mu), the strain across it as free of stress.
inline void hourglass(Whole, Lanes mu, Lanes lambda, const Modes (&m)[3], Modes (&g)[3]) noexcept
{
    const Lanes bend = (4.0F / 3.0F) * mu;
    const Lanes both = bend * lambda / (lambda + 2.0F * mu + tiny);
    const Lanes twist = (2.0F / 3.0F) * mu;
    const Lanes ninth = (8.0F / 9.0F) * mu;
    const Lanes alongX = both * (m[1].xy + m[2].zx);
    const Lanes alongY = both * (m[0].xy + m[2].yz);
    const Lanes alongZ = both * (m[0].zx + m[1].yz);
    const Lanes sum = m[0].yz + m[1].zx + m[2].xy;
    g[0].xy = bend * m[0].xy + alongY;
    g[0].zx = bend * m[0].zx + alongZ;
    g[0].yz = twist * (m[0].yz + sum);
    g[1].xy = bend * m[1].xy + alongX;
    g[1].yz = bend * m[1].yz + alongZ;
    g[1].zx = twist * (m[1].zx + sum);
    g[2].yz = bend * m[2].yz + alongY;
    g[2].zx = bend * m[2].zx + alongX;
    g[2].xy = twist * (m[2].xy + sum);
#pragma GCC unroll 3
    for (int q = 0; q < 3; ++q) {
        g[q].xyz = ninth * m[q].xyz;
    }
}

// The same where strain varies over the tissue alone: what varies along an axis counts by the spread along it.
inline void hourglass(const Spread& s, Lanes mu, Lanes lambda, const Modes (&m)[3], Modes (&g)[3]) noexcept
{
    const Lanes bend = (4.0F / 3.0F) * mu;
    const Lanes both = bend * lambda / (lambda + 2.0F * mu + tiny);
    const Lanes twist = (2.0F / 3.0F) * mu;
    const Lanes ninth = (8.0F / 9.0F) * mu * s.x * s.y * s.z;
    const Lanes alongX = both * (m[1].xy + m[2].zx);
    const Lanes alongY = both * (m[0].xy + m[2].yz);
    const Lanes alongZ = both * (m[0].zx + m[1].yz);
    const Lanes shearX = twist * s.x * (m[1].zx + m[2].xy);
    const Lanes shearY = twist * s.y * (m[0].yz + m[2].xy);
    const Lanes shearZ = twist * s.z * (m[0].yz + m[1].zx);
    g[0].xy = s.y * (bend * m[0].xy + alongY);
    g[0].zx = s.z * (bend * m[0].zx + alongZ);
    g[0].yz = shearY + shearZ;
    g[1].xy = s.x * (bend * m[1].xy + alongX);
    g[1].yz = s.z * (bend * m[1].yz + alongZ);
    g[1].zx = shearX + shearZ;
    g[2].yz = s.y * (bend * m[2].yz + alongY);
    g[2].zx = s.x * (bend * m[2].zx + alongX);
    g[2].xy = shearX + shearY;
#pragma GCC unroll 3
    for (int q = 0; q < 3; ++q) {
        g[q].xyz = ninth * m[q].xyz;
    }
}

// How bending modes count in axes that stretch: with all of F,
struct ByStretch {};

// or less, see CellStiffness::relief.
struct Relieved {
    float relief;
};

// Each column of F = I + f times its factor, which is 1 - 4/3 relief (q y / (q^2 + y^2))^2 with y = n - 1 > 0, n the square
// of the column's length: a third less than 1 at most, where y = q.
struct RelievedColumns {
    Lanes by[3][3];             // factor F, less I
    Lanes factor[3], slope[3];  // and twice its slope by n

    // @param square  of the length of each column of f
    RelievedColumns(const Lanes (&f)[3][3], const Lanes (&square)[3], float relief) noexcept
    {
        constexpr float q2 = 1.7F * 1.7F;
        const float most = 4.0F / 3.0F * q2 * relief;
#pragma GCC unroll 3
        for (int j = 0; j < 3; ++j) {
            // n - 1 without the difference of large numbers
            const Lanes over = 2.0F * f[j][j] + square[j];
            const Lanes y = over > 0.0F ? over : Lanes{};
            const Lanes part = 1.0F / (q2 + y * y);
            const Lanes t = y * part;
            const Lanes less = most * t * t;
            factor[j] = 1.0F - less;
            slope[j] = (4.0F * most) * t * part * (1.0F - (2.0F * q2) * part);
#pragma GCC unroll 3
            for (int i = 0; i < 3; ++i) {
                const Lanes one = factor[j] * f[i][j];
                by[i][j] = i == j ? one - less : one;
            }
        }
    }

    // From the gradient by the columns times their factors to that by F.
    void pull(const Lanes (&f)[3][3], Lanes (&g)[3][3]) const noexcept
    {
#pragma GCC unroll 3
        for (int j = 0; j < 3; ++j) {
            const Lanes along = g[j][j] + f[0][j] * g[0][j] + f[1][j] * g[1][j] + f[2][j] * g[2][j];
            const Lanes turned = slope[j] * along;
#pragma GCC unroll 3
            for (int i = 0; i < 3; ++i) {
                const Lanes one = factor[j] * g[i][j] + turned * f[i][j];
                g[i][j] = i == j ? one + turned : one;
            }
        }
    }
};

// The same in axes that turn and stretch with the cell: with F = I + f its mean deformation gradient, a mode m becomes
// F^T m. Adds to g the gradient of that energy by the modes, and sets that by F; returns twice the energy.
template <typename Filled>
[[gnu::always_inline]] inline Lanes hourglassBy(const Filled& filled, Lanes mu, Lanes lambda, const Lanes (&f)[3][3],
                                                const Modes (&m)[3], Modes (&g)[3], Lanes (&byF)[3][3]) noexcept
{
    Modes b[3];
    Modes w[3];
#pragma GCC unroll 3
    for (int j = 0; j < 3; ++j) {
        b[j].xy = m[j].xy + f[0][j] * m[0].xy + f[1][j] * m[1].xy + f[2][j] * m[2].xy;
        b[j].yz = m[j].yz + f[0][j] * m[0].yz + f[1][j] * m[1].yz + f[2][j] * m[2].yz;
        b[j].zx = m[j].zx + f[0][j] * m[0].zx + f[1][j] * m[1].zx + f[2][j] * m[2].zx;
        b[j].xyz = m[j].xyz + f[0][j] * m[0].xyz + f[1][j] * m[1].xyz + f[2][j] * m[2].xyz;
    }
    hourglass(filled, mu, lambda, b, w);
    Lanes twice;
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
        g[i].xy = w[i].xy + f[i][0] * w[0].xy + f[i][1] * w[1].xy + f[i][2] * w[2].xy;
        g[i].yz = w[i].yz + f[i][0] * w[0].yz + f[i][1] * w[1].yz + f[i][2] * w[2].yz;
        g[i].zx = w[i].zx + f[i][0] * w[0].zx + f[i][1] * w[1].zx + f[i][2] * w[2].zx;
        g[i].xyz = w[i].xyz + f[i][0] * w[0].xyz + f[i][1] * w[1].xyz + f[i][2] * w[2].xyz;
#pragma GCC unroll 3
        for (int j = 0; j < 3; ++j) {
            byF[i][j] = m[i].xy * w[j].xy + m[i].yz * w[j].yz + m[i].zx * w[j].zx + m[i].xyz * w[j].xyz;
        }
        const Lanes own = w[i].xy * b[i].xy + w[i].yz * b[i].yz + w[i].zx * b[i].zx + w[i].xyz * b[i].xyz;
        twice = i == 0 ? own : twice + own;
    }
    return twice;
}

// The same; adds to g the gradient by the modes of F besides. @param quarter  1 / 4 h: F less I by those modes
// @param square  of the length of each column of f
template <typename Filled, typename Bending>
[[gnu::always_inline]] inline Lanes hourglassTurned(const Filled& filled, Lanes mu, Lanes lambda, float quarter,
                                                    Bending bending, const Lanes (&f)[3][3], const Lanes (&square)[3],
                                                    const Modes (&m)[3], Modes (&g)[3]) noexcept
{
    Lanes byF[3][3];
    Lanes twice;
    if constexpr (std::is_same_v<Bending, Relieved>) {
        const RelievedColumns columns(f, square, bending.relief);
        twice = hourglassBy(filled, mu, lambda, columns.by, m, g, byF);
        columns.pull(f, byF);
    } else {
        twice = hourglassBy(filled, mu, lambda, f, m, g, byF);
    }
#pragma GCC unroll 3
    for (int i = 0; i < 3; ++i) {
        g[i].x += quarter * byF[i][0];
        g[i].y += quarter * byF[i][1];
        g[i].z += quarter * byF[i][2];
    }
    return twice;
}

}  // namespace

}  // namespace palpate::chainmail
