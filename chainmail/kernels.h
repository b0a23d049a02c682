#pragma once

#include <volume/law.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate::chainmail {

/// Layout of one window's arrays: nodes (i, j, k), x fastest, rows padded with zeros to whole vectors.
///
///     node (i, j, k) is at  i + row * j + plane * k;   cell (i, j, k) lies between nodes i .. i + 1 and has the same index
///
/// A field has three components, one behind the other, `count` floats each, and room for one vector behind the last.
struct Layout {
    int nx = 0, ny = 0, nz = 0;  // nodes
    std::size_t row = 0;         // floats, a multiple of `lanes`
    std::size_t plane = 0;       // floats
    std::size_t count = 0;       // floats

    static constexpr std::size_t lanes = 16;  // of the widest vector unit
    static Layout of(int nx, int ny, int nz) noexcept;
    std::size_t at(int i, int j, int k) const noexcept
    {
        return static_cast<std::size_t>(i) + row * static_cast<std::size_t>(j) + plane * static_cast<std::size_t>(k);
    }
    /// Corner `c` (x fastest) of the cell whose lowest node is at `node`.
    std::size_t corner(std::size_t node, int c) const noexcept { return node + at(c & 1, (c >> 1) & 1, c >> 2); }
    /// Floats that a field of three components takes.
    std::size_t fieldSize() const noexcept { return 3 * count + lanes; }
    /// Floats of working memory that apply() and restrictAdd() need.
    std::size_t scratchSize() const noexcept { return 6 * plane + 3 * lanes * static_cast<std::size_t>(ny) + lanes; }
};

/// Thin layers of cells (count x 1 each), see CellLayer: its shear modulus times h / 32, 0 where a cell has none; its
/// middle from that of the cell's tissue, see CutCells.
struct CellLayers {
    const float* mu = nullptr;
    std::array<const float*, 3> normal{};
    std::array<const float*, 3> middle{};
    std::array<const float*, 3> half{};
    /// The most places that stand for the thickness of a layer in Layout::lanes cells of a row, 0 to 2 (count / lanes x 1).
    const std::uint8_t* places = nullptr;
};

/// Where the tissue of cells lies that it fills in part (count x 1 each), see Cut.
struct CutCells {
    std::array<const float*, 3> middle{};
    std::array<const float*, 3> spread{};
};

/// What is in Layout::lanes cells in a row: whole cells, of which some may be empty; at least one that is cut; no tissue;
/// whole cells of which none stiffens.
enum class Filling : std::uint8_t { whole, cut, empty, constant };

/// Stiffness of each cell (count x 1), both moduli scaled by spacing / 32, zero where there is no tissue; and the law that
/// they belong to.
struct CellStiffness {
    const float* mu = nullptr;          // Lame's second parameter, times h / 32 [N/m]
    const float* lambda = nullptr;      // Lame's first parameter, times h / 32 [N/m]
    const float* stiffening = nullptr;  // b of finite strain [-]; none: 0
    CellLayers layers{};                // without mu: no cell has one
    CutCells cuts{};
    const Filling* filling = nullptr;  // (count / lanes x 1); none: whole cells, constant without `stiffening`
    /// How much less bending modes count in cells that are stretched, 0 to 1, by up to a third; see Kernels::applyFinite().
    float relief = 0;
    std::size_t law = volume::lawIndex<volume::NeoHookean>;  // of applyFinite(), in volume::laws
};

/// The fields that a step of the solver moves.
struct StepFields {
    float* u = nullptr;
    float* a = nullptr;
    float* d = nullptr;
    float* e = nullptr;
    float* p = nullptr;
    float* q = nullptr;
    float* r = nullptr;
};

/// How a step ends: u may have gone along p already, and f is the force there; or, where the force is linear, f is that of
/// p.
struct KeptStep {
    float fraction = 1;  // of the change of the force that is kept
    float base = 1;      // the change is f - base a: 1, or 0 where f is the force of p
    float further = 0;   // how much further u goes along p
    float length = 1;    // of the step in all
    float keep = 1;      // of d and e as they were
};

/// A damped Jacobi step: weight, reciprocal diagonal and right side.
struct Smoother {
    float weight = 1;
    const float* diagonal = nullptr;
    const float* r = nullptr;
};

/// What a step of the smoother works off: diagonal (r - q), for each of three components of `count` floats.
struct Defect {
    const float* diagonal = nullptr;
    const float* r = nullptr;
    const float* q = nullptr;
    std::size_t count = 0;
};

/// The arithmetic of the elastic level, compiled once per instruction set. All sets do the same operations in the same
/// order, without fused multiply-add, so that their results agree to the bit.
///
/// The element is a trilinear brick with selective reduced integration, in modal form: for each component the eight nodal
/// values become modes m (x, y, z, xy, yz, zx, xyz: eighths of sums with signs), and with D = u_x + v_y + w_z its energy is
///
///     E = 2 h (mu Q + lambda D^2)
///     Q = 2 (u_x^2 + v_y^2 + w_z^2) + (u_y + v_x)^2 + (u_z + w_x)^2 + (v_z + w_y)^2
///       + 2/3 (u_xy^2 + w_yz^2 + s (u_xy + w_yz)^2 + u_zx^2 + v_yz^2 + s (u_zx + v_yz)^2 + v_xy^2 + w_zx^2 + s (v_xy +
///       w_zx)^2)
///       + 2/3 (u_yz^2 + v_zx^2 + w_xy^2 + u_yz v_zx + v_zx w_xy + w_xy u_yz) + 4/9 (u_xyz^2 + v_xyz^2 + w_xyz^2)
///
/// with s = lambda / (lambda + 2 mu). The mean divergence alone carries lambda: no locking towards nu = 0.5, and no
/// hourglass mode without energy. Bending is exact (assumed strain): no parasitic shear, and the strain across the bent
/// fibres is the one without stress across them. Sources: D. P. Flanagan, T. Belytschko, "A uniform strain hexahedron and
/// quadrilateral with orthogonal hourglass control", Int. J. Numer. Methods Eng. 17, 1981 (modes); T. Belytschko, L. P.
/// Bindeman, "Assumed strain stabilization of the eight node hexahedral element", Comput. Methods Appl. Mech. Eng. 105,
/// 1993 (bending).
struct Kernels {
    const char* name;
    int width;  // floats per vector

    /// out = A u: the gradient of the energy at every node [N], u in [m]. `scratch` has layout.scratchSize() floats.
    void (*apply)(const Layout& layout, CellStiffness stiffness, const float* u, float* out, float* scratch) noexcept;

    /// out = open (r - A u), in the same sweep.
    void (*residualOf)(const Layout& layout, CellStiffness stiffness, const float* open, const float* r, const float* u,
                       float* out, float* scratch) noexcept;
    /// out = A u, and u += weight * diagonal (r - out) behind the sweep.
    void (*smoothOf)(const Layout& layout, CellStiffness stiffness, const Smoother& by, float* u, float* out,
                     float* scratch) noexcept;

    /// As apply(), for a law of finite strain: the mean deformation gradient F of each cell goes through the energy
    /// W = mu/2 I + (lambda + 2/3 mu)/2 (J - 1)^2  with I of volume::isochoric(), which stays finite when a cell inverts,
    /// and what the law adds to it (volume/law.h). The other modes have the energy above
    /// in axes that turn and stretch with the cell, F^T m for a mode m, so that a turn costs nothing; with relief r its
    /// component j is multiplied by 1 - 4/3 r (q y / (q^2 + y^2))^2, y = max(|F_j|^2 - 1, 0) for column j of F, q = 1.7.
    /// `inverse` is 1 / spacing [1/m].
    /// @returns  the energy [J]
    double (*applyFinite)(const Layout& layout, CellStiffness stiffness, float inverse, const float* u, float* out,
                          float* scratch) noexcept;

    /// sums[0] = x . a, sums[1] = x . b
    void (*dots)(const float* x, const float* a, const float* b, std::size_t n, double* sums) noexcept;
    /// Sum of (r(i) + r(i + step)) / 2 (u(i + step) - u(i)) over i < n for one component, where `tissue` is 1 at both nodes
    double (*alongSlope)(const float* tissue, const float* r, const float* u, std::size_t step, std::size_t n) noexcept;
    /// out = x + a y; out may be x or y
    void (*combine)(const float* x, float a, const float* y, float* out, std::size_t n) noexcept;
    /// u += step d,  a += step e,  r = a
    void (*warmStart)(float step, const StepFields& to, std::size_t n) noexcept;
    /// p = z + beta last,  u += step p; last may be p
    void (*direct)(const float* z, float beta, const float* last, float step, const StepFields& to, std::size_t n) noexcept;
    /// q = fraction (f - base a),  a += q,  e = keep e + q,  u += further p,  d = keep d + length p; p may be d
    /// sums: a . u, a . d, e . d
    void (*keepStep)(const KeptStep& step, const float* f, const StepFields& to, std::size_t n, double* sums) noexcept;
    /// y = -mask y, for each of three components; @returns x . y
    double (*negate)(const float* mask, const float* x, float* y, std::size_t count) noexcept;
    /// z = weight * diagonal r, for each of three components
    void (*smoothFirst)(float weight, const float* diagonal, const float* r, float* z, std::size_t count) noexcept;
    /// z += weight * diagonal (r - q), for each of three components
    void (*smooth)(float weight, const float* diagonal, const float* r, const float* q, float* z,
                   std::size_t count) noexcept;
    /// f = shrink f + weight * diagonal (r - q),  z += f
    void (*chebyshev)(float shrink, float weight, const Defect& by, float* f, float* z) noexcept;
    /// y = y + border (x - y), for each of three components: takes x over at a window's border
    void (*blend)(const float* border, const float* x, float* y, std::size_t count) noexcept;
    /// y += mask x, for each of three components
    void (*addMasked)(const float* mask, const float* x, float* y, std::size_t count) noexcept;
    /// out = (a + b) / 2
    void (*average)(const float* a, const float* b, float* out, std::size_t n) noexcept;
    /// out = b + (a + c) / 2
    void (*hat)(const float* a, const float* b, const float* c, float* out, std::size_t n) noexcept;
    /// A row of the coarse window, spread to `nodes` nodes of the fine one, an odd number, and zeros up to the next whole
    /// vector; reads as far beyond the row.
    void (*spread)(const float* from, int nodes, float* to) noexcept;
    /// The transpose: `nodes` nodes of a row of the fine window, with a zero before and from there on, added to the coarse
    /// one's.
    void (*gatherAdd)(const float* from, int nodes, float* to) noexcept;
};

/// The widest that this machine can run.
const Kernels& kernels() noexcept;
/// All that this machine can run, narrowest first.
std::span<const Kernels* const> supportedKernels() noexcept;

}  // namespace palpate::chainmail
