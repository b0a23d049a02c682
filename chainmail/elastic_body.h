#pragma once

#include <chainmail/fragments.h>
#include <volume/scalar_field.h>
#include <volume/tissue.h>

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::chainmail {

/// A thin layer in a cell: a membrane beside the cell's own material, which is as soft as the tissues are across it.
struct CellLayer {
    Index3 cell{0};
    float mu = 0;        // what its shear modulus has over the cell's, times its share of the cell [Pa]
    Vec3f normal{0.0F};  // unit vector across it
    Vec3f middle{0.0F};  // of it, -1 to 1 along each edge of the cell
    Vec3f half{0.0F};    // from there to the two places that stand for its thickness, in the same measure; 0: one place
};

/// A cell that its tissue fills in part.
struct CutCell {
    Index3 cell{0};
    Cut cut;
};

/// The whole body at one spacing: cubic cells, each of one material, between nodes.
struct CellLevel {
    volume::NodeGrid nodes;           // cell (i, j, k) lies between nodes (i, j, k) and (i + 1, j + 1, k + 1)
    std::vector<float> mu;            // Lame's second parameter of each cell, by its lowest node [Pa]  (count x 1)
    std::vector<float> lambda;        // Lame's first parameter                                    [Pa] (count x 1)
    std::vector<float> stiffening;    // with finite strain, see TissueRow                        [-]    (count x 1)
    std::vector<std::uint8_t> fixed;  // not 0 for nodes that are held in space                         (count x 1)
    std::array<std::vector<float>, volume::relaxationTerms> relaxing;  // weights of each cell [-]; none: does not relax
    std::vector<CellLayer> layers;                                     // by z, then y, then x
    std::vector<CutCell> cuts;                                         // by z, then y, then x
    std::vector<std::uint32_t> layerRows, cutRows;                     // of both, see rowsOf()
    std::vector<float> diagonal;  // of the operator at each node, 0 where there is no tissue [N/m]  (count x 1)
    Fragments fragments;          // of cells that gaps run through
    double radius = 1;            // largest eigenvalue of D^-1 A, D the diagonal of the operator A: no window has a larger
};

/// A piece of the body's surface at rest.
struct SurfacePoint {
    Vec3f position{0.0F};  // [m]
    Vec3f anchor{0.0F};    // the nearest point in a cell that has tissue: what it moves with [m]
    Vec3f normal{0.0F};    // unit vector out of the body
    float area = 0;        // [m^2]
    float mu = 0;          // of the tissue under it [Pa]
    float sliver = 0;      // compliance that its cell lacks because it is nearly empty, see addSurface() [h / E per area]
};

/// The points in one cell of the finest level: head of a run in ElasticBody::points.
struct SurfaceCell {
    Index3 cell{0};
    std::uint32_t first = 0;
    std::uint32_t count = 0;
};

/// A node of the finest level inside the tissue, close under its surface.
struct SubsurfaceNode {
    Index3 node{0};
    float mu = 0;  // of the softest cell around it [Pa]
};

constexpr double softPoisson = 0.45;  // of soft tissue

/// Young's modulus of soft tissue with this shear modulus [Pa]: E = 2 mu (1 + nu).
inline double youngsModulusOf(float mu) noexcept
{
    return 2.0 * (1.0 + softPoisson) * static_cast<double>(mu);
}

/// How the tissue lies in a cell.
inline Cut cutOf(const CellLevel& level, Index3 cell) noexcept
{
    const auto row = static_cast<std::size_t>(cell.y + cell.z * level.nodes.size.y);
    const auto found = inRow(level.cuts, level.cutRows, row, cell.x, cell.x, &CutCell::cell);
    return found.empty() ? Cut{} : found.front().cut;
}

/// What a cell's modes give to the operator's diagonal at its node `side`, -1 or 1 along each axis, on the mean of the
/// three directions [N/m]. Of a full cell, at each node: h / 32 (2 mu (46 / 9 + 4 / 3 (1 + s)) + 2 lambda), with s = lambda
/// / (lambda + 2 mu) of bending. A cut one counts as if its tissue bent as a whole cell's: D^-1 A has larger eigenvalues
/// with its own diagonal (13 in place of 10), and a smoother takes smaller steps.
/// @param mu  over 0
inline float diagonalOf(float mu, float lambda, double spacing, const Cut& cut, Vec3f side) noexcept
{
    const Vec3f w = 1.0F + side * cut.middle;
    const Vec3f slope(w.y * w.z, w.z * w.x, w.x * w.y);
    const float bending = 4.0F / 3.0F * mu * (1.5F + lambda / (lambda + 2.0F * mu));
    return static_cast<float>(spacing / 32.0) *
           ((8.0F * mu + 2.0F * lambda) * glm::dot(slope, slope) + 2.0F * bending * glm::dot(w, w) + 8.0F / 3.0F * mu) /
           3.0F;
}

/// Whether no gap divides two cells of the finest level that lie beside each other: they share one of the nodes between
/// them.
bool shareNode(const CellLevel& level, Index3 a, Index3 b) noexcept;

/// Shear modulus of the level's cell that a place lies in; 0 where it is empty, and outside of the grid [Pa].
inline float muAt(const CellLevel& level, Vec3 at) noexcept
{
    const Index3 cell = level.nodes.cellAt(at);
    if (!level.nodes.contains(cell)) {
        return 0.0F;
    }
    float sum = level.mu[level.nodes.offset(cell)];
    for (const CellFragment& f : level.fragments.in(cell, level.nodes.size.y)) {
        sum += f.mu;
    }
    return sum;
}

/// Poisson's ratio of the level's cell that a place lies in; that of soft tissue where it is empty or divided.
inline double poissonAt(const CellLevel& level, Vec3 at) noexcept
{
    const Index3 cell = level.nodes.cellAt(at);
    const std::size_t i = level.nodes.contains(cell) ? level.nodes.offset(cell) : 0;
    const auto lambda = static_cast<double>(level.lambda[i]), mu = static_cast<double>(level.mu[i]);
    return level.nodes.contains(cell) && mu > 0.0 ? 0.5 * lambda / (lambda + mu) : softPoisson;
}

/// Where bone lies in a cell of the finest level that it does not fill.
struct BoneCell {
    Index3 cell{0};
    std::array<std::uint8_t, volume::HeldParts::edgeCount> edges{};  // HeldParts::edges
    bool isPlate = false;  // through the cell, without a cell of bone alone beside it
};

/// An elastic body: const while a session runs. Every level covers the whole body; each is twice as coarse as the one
/// before, and its nodes are every second node of it.
struct ElasticBody {
    std::vector<CellLevel> levels;    // finest first; the last has few nodes
    std::vector<SurfaceCell> cells;   // that the surface runs through, by z, then y, then x
    std::vector<std::uint32_t> rows;  // first of `cells` in row (y, z) of the finest level, at y + z * its nodes along y
    std::vector<SurfacePoint> points;
    std::vector<SubsurfaceNode> subsurface;     // by z, then y, then x
    std::vector<std::uint32_t> subsurfaceRows;  // see rowsOf()
    double pieceEdge = 0;                       // of the sub-cells of which each of them stands for the surface [m]
    std::vector<float> held;              // of each cell of the finest level, what share of its tissue is held in space
    std::vector<BoneCell> bone;           // by z, then y, then x; empty where there is no plate of thin bone
    std::vector<std::uint32_t> boneRows;  // see rowsOf()
    bool relaxes = false;                 // its moduli are those right after a step
};

/// @param cells        centres of the finest level's cells; two layers of cells at its border must be empty: a surface that
///                     lies on the border of the last has half of its points
/// @param surface      signed distance to the body's surface at rest [m]
/// @param poissonCap   Poisson's ratios above are lowered to this [-], under 0.5
/// @param toolRadius   of the smallest tool that will press: the surface has points closer than that; 0: of any that is
///                     larger than a cell [m]
/// @param relaxes      the moduli become those right after a step, and cells keep the weights of their Prony series
/// @param support      what holds a body in which no tissue is fixed, see volume::Tissue::support()
///
/// Cells of fixed tissue fix their nodes, and so does tissue of which half around a node is fixed. A support holds, at
/// every spacing, the nodes on it or behind it where the body meets it. Something must be held.
///
/// A coarse cell has the moduli that store as much energy as its eight cells: see upscaled() in the source.
ElasticBody elasticBody(const volume::NodeGrid& cells, std::vector<volume::CellMaterial> materials,
                        const volume::DistanceField& surface, double poissonCap, double toolRadius = 0.0,
                        bool relaxes = false, const std::optional<volume::Support>& support = {});

}  // namespace palpate::chainmail
