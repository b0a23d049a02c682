#pragma once

#include <channel/inverse.h>
#include <channel/layout.h>

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::channel {

inline glm::dvec3 vec(const Triple& t) noexcept
{
    return {t[0], t[1], t[2]};
}

inline glm::ivec3 sizeOf(const Grid& grid) noexcept
{
    return {grid.size[0], grid.size[1], grid.size[2]};
}

/// Voxels low <= v < high along each axis.
struct VoxelBox {
    glm::ivec3 low{0}, high{0};

    bool empty() const noexcept { return low.x >= high.x || low.y >= high.y || low.z >= high.z; }
};

/// The smallest box around both.
VoxelBox enclosing(const VoxelBox& a, const VoxelBox& b) noexcept;

/// The deformed body as a viewer sees it: rest labels and the displacement u of the lattice nodes, trilinear between them.
/// Rest point X lies at x = X + u(X).
class Deformation {
public:
    /// `labels`: tissue row per display voxel, 0 = air, with shellBit; copied.
    Deformation(const Scenery& scenery, std::span<const std::uint8_t> labels);

    Deformation& operator=(Deformation&&) = delete;

    /// Takes over the nodes of one moment. Returns the display voxels that look different from before.
    VoxelBox apply(const Displaced& displaced);
    /// The rest point X that lies at `x` [m], see Inverse.
    /// `shift`: where to start, X - x in lattice spacings, and where it ended: the next point along a row starts there.
    glm::dvec3 rest(glm::dvec3 x, glm::vec3& shift) const noexcept;
    /// The same in the lattice's own terms, for what needs many of them: takes shift(g) to X - x, both in spacings.
    /// `enough`: see Inverse::follow().
    void follow(glm::vec3 g, glm::vec3& shift, float enough = Inverse::close) const noexcept
    {
        inverse_.follow(g, shift, enough);
    }
    /// u at the rest point `g` [lattice spacings from the lattice's origin], in metres.
    glm::vec3 displacement(glm::vec3 g) const noexcept;
    /// Where the rest point `p` [m] lies now.
    glm::dvec3 seen(glm::dvec3 p) const noexcept;
    /// Tissue at the rest point `p` [m], with shellBit where a warning distance ends. Around a point the tissue with the
    /// largest quadratic spline weight wins: borders are smooth, and no label turns into another one.
    std::uint8_t restLabel(glm::dvec3 p) const noexcept;

    const Grid& grid() const noexcept { return labelGrid_; }
    const Grid& lattice() const noexcept { return lattice_; }
    /// Per display voxel at rest: tissue row (rowBits) and shellBit.
    std::span<const std::uint8_t> labels() const noexcept { return labels_; }
    /// Whether everything is at rest.
    bool still() const noexcept { return moved_.empty(); }
    /// Display voxels that do not look as they do at rest lie in here.
    const VoxelBox& touched() const noexcept { return last_; }

private:
    static constexpr std::uint8_t pureBit = 0x40;  // the 26 voxels around are of the same tissue
    static constexpr int neighbours = 27;          // of a node in its 3 x 3 x 3, itself in the middle
    static constexpr int airLayers = 16;           // that go along with the body

    std::uint8_t restTissue(glm::dvec3 p) const noexcept;
    void markPure();
    void layerAir();
    std::uint32_t neighbour(std::uint32_t node, std::size_t k) const noexcept;
    void carryAir();
    void reachAir(std::span<const std::uint32_t> from);
    glm::vec3 meanInside(std::uint32_t node) const noexcept;
    VoxelBox boxOfMoved() const;

    Grid labelGrid_, lattice_;
    std::vector<std::uint8_t> labels_;  // with pureBit
    // Per lattice node, a bit per neighbour: air one layer further out; air or body one layer further in.
    std::vector<std::uint32_t> outward_, inward_;
    std::array<std::int32_t, neighbours> around_{};  // from a node to its neighbours
    std::vector<glm::vec4> u_;                       // per lattice node [m], and 1 if it has moved
    std::vector<std::uint32_t> moved_;               // nodes with u != 0
    Inverse inverse_;                                // of u_
    std::vector<std::uint32_t> visited_;             // per lattice node: last pass that gave it a value
    std::vector<std::uint32_t> frontier_;
    std::uint32_t pass_ = 0;
    std::size_t visible_ = 0;  // of moved_: body and the air next to it; further air moves only air
    VoxelBox last_;            // what the previous moment touched
    double largest_ = 0;       // |u| of this moment [m]
};

}  // namespace palpate::channel
