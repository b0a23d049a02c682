#include <studies/kernel/plain_operator.h>

#include <cstring>

namespace palpate::studies {

using namespace chainmail;

namespace {

// Modes of one component in a row of cells, as in kernels_body.h: x, y, z, xy, yz, zx, xyz.
constexpr std::size_t modes = 7;

__attribute__((target("avx2"))) void modesOf(const float* __restrict a, std::size_t row, std::size_t plane, std::size_t n,
                                             float* __restrict m) noexcept
{
#pragma GCC ivdep
    for (std::size_t i = 0; i < n; ++i) {
        const float c0 = a[i], c1 = a[i + 1], c2 = a[i + row], c3 = a[i + row + 1];
        const float c4 = a[i + plane], c5 = a[i + plane + 1], c6 = a[i + plane + row], c7 = a[i + plane + row + 1];
        m[i] = c1 + c3 + c5 + c7 - c0 - c2 - c4 - c6;
        m[row + i] = c2 + c3 + c6 + c7 - c0 - c1 - c4 - c5;
        m[2 * row + i] = c4 + c5 + c6 + c7 - c0 - c1 - c2 - c3;
        m[3 * row + i] = c0 + c3 + c4 + c7 - c1 - c2 - c5 - c6;
        m[4 * row + i] = c0 + c1 + c6 + c7 - c2 - c3 - c4 - c5;
        m[5 * row + i] = c0 + c2 + c5 + c7 - c1 - c3 - c4 - c6;
        m[6 * row + i] = c1 + c2 + c4 + c7 - c0 - c3 - c5 - c6;
    }
}

// The gradient of the energy by the modes, in their place: rows of u, v and w one behind the other.
__attribute__((target("avx2"))) void lawOf(const float* __restrict mu, const float* __restrict lambda, std::size_t row,
                                           std::size_t n, float* __restrict m) noexcept
{
    float* __restrict u = m;
    float* __restrict v = m + modes * row;
    float* __restrict w = m + 2 * modes * row;
#pragma GCC ivdep
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t y = row + i, z = 2 * row + i, xy = 3 * row + i, yz = 4 * row + i, zx = 5 * row + i;
        const float d = 2.0F * lambda[i] * (u[i] + v[y] + w[z]);
        const float shear[3] = {2.0F * mu[i] * (u[y] + v[i]), 2.0F * mu[i] * (u[z] + w[i]), 2.0F * mu[i] * (v[z] + w[y])};
        const float third = 2.0F / 3.0F * mu[i];
        const float twist = third * (u[yz] + v[zx] + w[xy]);
        u[i] = 4.0F * mu[i] * u[i] + d;
        v[y] = 4.0F * mu[i] * v[y] + d;
        w[z] = 4.0F * mu[i] * w[z] + d;
        u[y] = v[i] = shear[0];
        u[z] = w[i] = shear[1];
        v[z] = w[y] = shear[2];
        u[yz] = third * u[yz] + twist;
        v[zx] = third * v[zx] + twist;
        w[xy] = third * w[xy] + twist;
        const float bend = 4.0F / 3.0F * mu[i];
        const float both = mu[i] > 0.0F ? bend * lambda[i] / (lambda[i] + 2.0F * mu[i]) : 0.0F;
        const float along[3] = {both * (v[xy] + w[zx]), both * (u[xy] + w[yz]), both * (u[zx] + v[yz])};
        u[xy] = bend * u[xy] + along[1];
        w[yz] = bend * w[yz] + along[1];
        u[zx] = bend * u[zx] + along[2];
        v[yz] = bend * v[yz] + along[2];
        v[xy] = bend * v[xy] + along[0];
        w[zx] = bend * w[zx] + along[0];
        const std::size_t xyz = 6 * row + i;
        u[xyz] *= 8.0F / 9.0F * mu[i];
        v[xyz] *= 8.0F / 9.0F * mu[i];
        w[xyz] *= 8.0F / 9.0F * mu[i];
    }
}

// Gives a row of cells' gradients to one of their corners; s holds the corner's signs along x, y and z.
__attribute__((target("avx2"))) void giveTo(const float* __restrict g, const float (&s)[3], std::size_t row, std::size_t n,
                                            float* __restrict out) noexcept
{
    const float xy = s[0] * s[1], yz = s[1] * s[2], zx = s[2] * s[0], xyz = xy * s[2];
#pragma GCC ivdep
    for (std::size_t i = 0; i < n; ++i) {
        out[i] += s[0] * g[i] + s[1] * g[row + i] + s[2] * g[2 * row + i] + xy * g[3 * row + i] + yz * g[4 * row + i] +
                  zx * g[5 * row + i] + xyz * g[6 * row + i];
    }
}

}  // namespace

std::size_t plainScratch(const Layout& layout) noexcept
{
    return 3 * modes * layout.row;
}

void plainApply(const Layout& layout, CellStiffness stiffness, const float* u, float* out, float* scratch) noexcept
{
    const std::size_t row = layout.row, plane = layout.plane;
    const std::size_t n = row;  // the padding too: empty cells, and no remainder for the compiler to peel off
    std::memset(out, 0, 3 * layout.count * sizeof(float));
    for (int k = 0; k + 1 < layout.nz; ++k) {
        for (int j = 0; j + 1 < layout.ny; ++j) {
            const std::size_t at = layout.at(0, j, k);
            for (std::size_t c = 0; c < 3; ++c) {
                modesOf(u + c * layout.count + at, row, plane, n, scratch + c * modes * row);
            }
            lawOf(stiffness.mu + at, stiffness.lambda + at, row, n, scratch);
            for (std::size_t c = 0; c < 24; ++c) {
                const std::size_t x = c % 2, y = c / 2 % 2, z = c / 4 % 2;
                const float signs[3] = {x == 0 ? -1.0F : 1.0F, y == 0 ? -1.0F : 1.0F, z == 0 ? -1.0F : 1.0F};
                giveTo(scratch + c / 8 * modes * row, signs, row, n,
                       out + c / 8 * layout.count + at + x + y * row + z * plane);
            }
        }
    }
}

}  // namespace palpate::studies
