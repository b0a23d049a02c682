#pragma once

#include <volume/label_blocks.h>
#include <volume/tissue_impl.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

// Inside volume/ only.
namespace palpate::volume {

// What has weight, each once: at most `most` keys.
template <typename Key, std::size_t most>
struct Weights {
    std::array<Key, most> keys;  // the first `count`
    std::array<double, most> weights;
    std::size_t count = 0;

    void add(Key key, double weight)
    {
        std::size_t i = 0;
        while (i < count && keys[i] != key) {
            ++i;
        }
        if (i == count) {
            keys[i] = key;
            weights[i] = 0.0;
            ++count;
        }
        weights[i] += weight;
    }
};

// Reads the voxels that fill a node's cell, by s^3 samples of the cell, and interpolates between them: the nearest voxel
// alone would shift everything by up to half a voxel where samples fall on the faces between voxels.
class CellSampler {
public:
    // `blocks` must outlive it. `forMaterial`: for visitMaterial(), which samples cells far smaller than the voxels more
    // finely.
    CellSampler(const TissueData& tissue, const NodeGrid& grid, const LabelBlocks& blocks, bool forMaterial)
        : size_(tissue.size),
          blocks_(blocks),
          label_(tissue.label->getConstUnsafeAccessor()),
          stiffness_(tissue.stiffness->getConstUnsafeAccessor()),
          scaledBy_(tissue.stiffnessMap.points.empty() ? nullptr : &tissue)
    {
        const Mat3 toIndex = glm::inverse(tissue.affine.linear);
        const Vec3 voxel = tissue.affine.spacing();
        const double finest = std::min({voxel.x, voxel.y, voxel.z});
        isCoarse_ = forMaterial && std::max({voxel.x, voxel.y, voxel.z}) > coarseVoxel * grid.spacing;
        const int s = std::clamp(static_cast<int>(std::ceil(grid.spacing / finest - 1e-6)), isCoarse_ ? 3 : 1, mostSamples);
        for (int i = 0; i < s * s * s; ++i) {
            const Vec3 at = (Vec3(i % s, i / s % s, i / s / s) + 0.5) / static_cast<double>(s) - 0.5;
            places_.push_back(2.0 * at);
            offsets_.push_back(toIndex * (at * grid.spacing));
            reach_ = glm::max(reach_, glm::abs(offsets_.back()));
        }
        const int half = std::clamp(static_cast<int>(std::ceil(0.5 * grid.spacing / finest - 1e-6)), 1, 4);
        for (int i = 0; i < half * half * half; ++i) {
            const Vec3 at = (Vec3(i % half, i / half % half, i / half / half) + 0.5) / static_cast<double>(half) - 0.5;
            inOctant_.push_back(toIndex * (0.5 * at * grid.spacing));
        }
        farthest_ = std::sqrt(3.0) * (0.5 * grid.spacing + std::max({voxel.x, voxel.y, voxel.z}));
        step_ = toIndex * grid.spacing;
        start_ = toIndex * (grid.origin - tissue.affine.origin);
        samples_ = s;
        findEdges();
    }

    // Variance of the place in which visit() reads a node's cell, along each patient axis: of the samples, and of the hats
    // between voxels [m^2].
    Vec3 variance(const NodeGrid& grid, const Affine& affine) const noexcept
    {
        Vec3 sum(0.0);
        for (const Vec3& place : places_) {
            sum += place * place / static_cast<double>(places_.size());
        }
        sum *= 0.25 * grid.spacing * grid.spacing;
        for (int k = 0; k < 3; ++k) {
            sum += affine.linear[k] * affine.linear[k] / 6.0;
        }
        return sum;
    }

    // The label of all voxels that visit() reads at node n; LabelBlocks::several where they have several, or some are
    // outside.
    int onlyLabel(Index3 n) const noexcept
    {
        const Vec3 centre = start_ + step_ * Vec3(n);
        return blocks_.labelOf({Index3(glm::floor(centre - reach_)), Index3(glm::floor(centre + reach_)) + 1});
    }

    // No voxel that visit() reads has its centre farther from the node [m].
    double farthest() const noexcept { return farthest_; }

    // Whether factor() may be other than 1.
    bool isScaled() const noexcept { return scaledBy_ != nullptr; }

    // As visit(), in one call where a single label fills the cell.
    template <typename Visit>
    void visitLabels(Index3 n, const Visit& visit) const
    {
        if (const int label = onlyLabel(n); label != LabelBlocks::several) {
            visit(static_cast<std::uint16_t>(label), 1.0);
        } else {
            this->visit(n, visit);
        }
    }

    // Calls visit(label, weight, factor()) as visit() does, in one call where a single label fills the cell.
    template <typename Visit>
    void visitScaled(Index3 n, const Visit& visit) const
    {
        if (!isScaled()) {
            visitLabels(n, [&](std::uint16_t label, double weight) { visit(label, weight, 1.0); });
            return;
        }
        this->visit(n, [&](std::uint16_t label, double weight, const openvdb::Coord& voxel) {
            visit(label, weight, factor(label, voxel));
        });
    }

    // Calls visit(label, weight), or visit(label, weight, voxel), for the voxels at node n; the weights add up to 1, less
    // what lies outside the volume. Or visit(label, weight, voxel, place), with the sample's place in the cell, -1 to 1.
    template <typename Visit>
    void visit(Index3 n, const Visit& visit) const
    {
        if constexpr (!takesPlace<Visit>) {
            if (isAligned_) {
                visitVoxels(n, visit);
                return;
            }
        }
        forEachSample(n, [&](Vec3 at, double fraction, Vec3 place) { visitAround(at, fraction, place, visit); });
    }

    // The same for material alone, labels of which isTissue(label) is true: between voxels far larger than a cell, a sample
    // with less than half of it is outside of the body, and any other is full. Else cells up to half a voxel outside of the
    // surface would be partly tissue.
    template <typename IsTissue, typename Visit>
    void visitMaterial(Index3 n, const IsTissue& isTissue, const Visit& visit) const
    {
        if (!isCoarse_) {
            this->visit(n, visit);
            return;
        }
        forEachSample(n, [&](Vec3 at, double fraction, Vec3 place) {
            double tissue = 0.0;
            visitAround(at, 1.0, place,
                        [&](std::uint16_t label, double weight) { tissue += isTissue(label) ? weight : 0.0; });
            if (tissue >= 0.5) {
                visitAround(at, fraction / tissue, place, visit);
            }
        });
    }

    // Which eighths of a node's cell are mostly tissue: CellMaterial::octants.
    template <typename IsTissue>
    std::uint8_t octants(Index3 n, const IsTissue& isTissue) const
    {
        unsigned found = 0;
        for (unsigned i = 0; i < 8; ++i) {
            const Vec3 middle = start_ + step_ * (Vec3(n) + 0.5 * Vec3(i & 1, i >> 1 & 1, i >> 2) - 0.25);
            double tissue = 0.0;
            for (const Vec3& offset : inOctant_) {
                visitAround(middle + offset, 1.0, Vec3(0.0),
                            [&](std::uint16_t label, double weight) { tissue += isTissue(label) ? weight : 0.0; });
            }
            found |= tissue >= 0.5 * static_cast<double>(inOctant_.size()) - 1e-9 ? 1U << i : 0U;
        }
        return static_cast<std::uint8_t>(found);
    }

    // Which of the 64 parts of a node's cell have tissue in their middle: CellMaterial::quarters.
    template <typename IsTissue>
    std::uint64_t quarters(Index3 n, const IsTissue& isTissue) const
    {
        std::uint64_t found = 0;
        const auto middleOf = [](int i) { return 0.25 * Vec3(i & 3, i >> 2 & 3, i >> 4) - 0.375; };
        forEachInside<64>(n, 0.375, middleOf, isTissue, [&](int i) { found |= std::uint64_t{1} << i; });
        return found;
    }

    // Which eighths of the edges of a node's cell have tissue in their middle: HeldParts::edges.
    template <typename IsTissue>
    std::array<std::uint8_t, HeldParts::edgeCount> onEdges(Index3 n, const IsTissue& isTissue) const
    {
        std::array<std::uint8_t, HeldParts::edgeCount> found{};
        const auto middleOf = [](int i) {
            Vec3 at = Vec3(HeldParts::startOf(i / 8)) - 0.5;
            at[i / 32] += (i % 8 + 0.5) / 8.0;
            return at;
        };
        forEachInside<8 * HeldParts::edgeCount>(n, 0.5, middleOf, isTissue, [&](int i) {
            found[static_cast<std::size_t>(i / 8)] |= static_cast<std::uint8_t>(1U << i % 8);
        });
        return found;
    }

    // Fraction of a node's cell in which more than half of what lies between voxels is tissue: what the faces of voxels
    // along the axes enclose, wherever the cell lies. 4^3 parts, each from empty to full over its edge.
    template <typename IsTissue>
    double insideFaces(Index3 n, const IsTissue& isTissue) const
    {
        constexpr int side = 4;
        const Vec3 centre = start_ + step_ * Vec3(n);
        double sum = 0.0;
        forEachIndex(Index3(0), Index3(side - 1), [&](Index3 part) {
            const Vec3 at = centre + step_ * ((Vec3(part) + 0.5) / static_cast<double>(side) - 0.5);
            double tissue = 0.0;
            Vec3 slope(0.0);
            forEachCorner(at, [&](Index3 voxel, Vec3 share, Vec3 up) {
                read(voxel, 1.0, Vec3(0.0), [&](std::uint16_t label, double) {
                    if (isTissue(label)) {
                        tissue += share.x * share.y * share.z;
                        slope += up * Vec3(share.y * share.z, share.x * share.z, share.x * share.y);
                    }
                });
            });
            const double steepness = glm::length(slope * step_) / side;  // over a part's edge
            sum += steepness > 1e-9 ? std::clamp(0.5 + (tissue - 0.5) / steepness, 0.0, 1.0) : (tissue < 0.5 ? 0.0 : 1.0);
        });
        return sum / (side * side * side);
    }

    // What the image makes of the modulus of a voxel's tissue.
    double factor(std::uint16_t label, const openvdb::Coord& voxel) const
    {
        if (scaledBy_ == nullptr) {
            return 1.0;
        }
        const double own = scaledBy_->table.rows[scaledBy_->lookup.row[label]].youngsModulus;
        const double here = 1e3 * static_cast<double>(stiffness_.getValue(voxel));
        return own > 0 && here > 0 ? here / own : 1.0;
    }

private:
    template <typename Visit>
    static constexpr bool takesPlace = std::is_invocable_v<Visit, std::uint16_t, double, const openvdb::Coord&, Vec3>;
    static constexpr int mostSamples = 4;  // along an edge of a cell

    // The voxels along one of their axes that the samples of a cell read, each once, with their share.
    using Line = Weights<int, 2 * mostSamples>;

    // Where each axis of the voxels is parallel to one of the grid's, a sample's place along it depends on one index alone.
    void findEdges()
    {
        for (int axis = 0; axis < 3; ++axis) {
            const Vec3 steps(step_[0][axis], step_[1][axis], step_[2][axis]);
            isAligned_ = isAligned_ && (steps.x != 0.0 ? 1 : 0) + (steps.y != 0.0 ? 1 : 0) + (steps.z != 0.0 ? 1 : 0) == 1;
            edges_[axis] = glm::length(steps);
        }
    }

    Line lineOf(int axis, double centre) const
    {
        Line line;
        const double share = 1.0 / samples_;
        for (int i = 0; i < samples_; ++i) {
            const double at = centre + edges_[axis] * ((i + 0.5) / samples_ - 0.5);
            const double low = std::floor(at);
            line.add(static_cast<int>(low), (1.0 - (at - low)) * share);
            if (at > low) {
                line.add(static_cast<int>(low) + 1, (at - low) * share);
            }
        }
        return line;
    }

    // visit() where the axes are parallel: every voxel once.
    template <typename Visit>
    void visitVoxels(Index3 n, const Visit& visit) const
    {
        const Vec3 centre = start_ + step_ * Vec3(n);
        const std::array<Line, 3> lines{lineOf(0, centre.x), lineOf(1, centre.y), lineOf(2, centre.z)};
        for (std::size_t k = 0; k < lines[2].count; ++k) {
            for (std::size_t j = 0; j < lines[1].count; ++j) {
                const double weight = lines[2].weights[k] * lines[1].weights[j];
                for (std::size_t i = 0; i < lines[0].count; ++i) {
                    read({lines[0].keys[i], lines[1].keys[j], lines[2].keys[k]}, weight * lines[0].weights[i], Vec3(0.0),
                         visit);
                }
            }
        }
    }

    // Calls visit(voxel coordinates, fraction of the cell, place in the cell) for each sample of node n's cell.
    template <typename Visit>
    void forEachSample(Index3 n, const Visit& visit) const
    {
        const Vec3 centre = start_ + step_ * Vec3(n);
        const double fraction = 1.0 / static_cast<double>(offsets_.size());
        for (std::size_t i = 0; i < offsets_.size(); ++i) {
            visit(centre + offsets_[i], fraction, places_[i]);
        }
    }

    // Calls found(i) for those of `count` places that lie in tissue, halfway between voxels. Where a cell is wider than
    // some eight voxels, in the nearest one. placeOf(i): from the node, up to `reach` along each axis [cells].
    template <int count, typename PlaceOf, typename IsTissue, typename Found>
    void forEachInside(Index3 n, double reach, const PlaceOf& placeOf, const IsTissue& isTissue, const Found& found) const
    {
        constexpr std::size_t most = 512;
        const Vec3 centre = start_ + step_ * Vec3(n);
        const Vec3 wide = reach * (glm::abs(step_[0]) + glm::abs(step_[1]) + glm::abs(step_[2])) + 1e-6;
        const Index3 low(glm::floor(centre - wide)), size = Index3(glm::floor(centre + wide)) + 2 - low;
        std::array<double, most> near;
        const auto tissueAt = [&](Index3 voxel) {
            bool is = false;
            read(voxel, 1.0, Vec3(0.0), [&](std::uint16_t label, double) { is = isTissue(label); });
            return is ? 1.0 : 0.0;
        };
        const bool isNear = base::countOf(size) <= most;
        if (isNear) {
            forEachIndex(Index3(0), size - 1, [&](Index3 at) { near[base::offsetOf(size, at)] = tissueAt(low + at); });
        }
        for (int i = 0; i < count; ++i) {
            const Vec3 at = centre + step_ * placeOf(i);
            double tissue = 0.0;
            if (isNear) {
                forEachCorner(at, [&](Index3 voxel, Vec3 share, Vec3) {
                    tissue += share.x * share.y * share.z * near[base::offsetOf(size, voxel - low)];
                });
            } else {
                tissue = tissueAt(Index3(glm::round(at)));
            }
            if (tissue >= 0.5 - 1e-9) {
                found(i);
            }
        }
    }

    // Calls visit(voxel, share, up) for the eight around a place between them: share is its weight along each axis, up 1 on
    // the far side and -1 on the near one.
    template <typename Visit>
    static void forEachCorner(Vec3 at, const Visit& visit)
    {
        const Vec3 low = glm::floor(at);
        const Vec3 t = at - low;
        const std::array<Vec3, 2> w{1.0 - t, t};
        for (std::size_t corner = 0; corner < 8; ++corner) {
            const std::array<std::size_t, 3> far{corner & 1, (corner >> 1) & 1, (corner >> 2) & 1};
            visit(Index3(low) + Index3(far[0], far[1], far[2]), Vec3(w[far[0]].x, w[far[1]].y, w[far[2]].z),
                  2.0 * Vec3(far[0], far[1], far[2]) - 1.0);
        }
    }

    template <typename Visit>
    void visitAround(Vec3 at, double fraction, Vec3 place, const Visit& visit) const
    {
        forEachCorner(at, [&](Index3 voxel, Vec3 share, Vec3) {
            const double weight = share.x * share.y * share.z;
            if (weight > 0) {
                read(voxel, fraction * weight, place, visit);
            }
        });
    }

    template <typename Visit>
    void read(Index3 n, double weight, Vec3 place, const Visit& visit) const
    {
        if (base::holds(size_, n)) {
            const openvdb::Coord ijk(n.x, n.y, n.z);
            const std::uint16_t label = labelAt(ijk);
            if constexpr (takesPlace<Visit>) {
                visit(label, weight, ijk, place);
            } else if constexpr (std::is_invocable_v<Visit, std::uint16_t, double, const openvdb::Coord&>) {
                visit(label, weight, ijk);
            } else {
                visit(label, weight);
            }
        }
    }

    std::uint16_t labelAt(const openvdb::Coord& ijk) const
    {
        constexpr openvdb::Int32 inLeaf = Leaf::DIM - 1;
        if (const openvdb::Coord corner = ijk & ~inLeaf; corner != leafCorner_) {
            leafCorner_ = corner;
            const Leaf* leaf = label_.probeConstLeaf(ijk);
            leaf_ = leaf != nullptr ? leaf->buffer().data() : nullptr;
            tile_ = leaf == nullptr ? label_.getValue(ijk) : 0;
        }
        return static_cast<std::uint16_t>(leaf_ != nullptr ? leaf_[Leaf::coordToOffset(ijk)] : tile_);
    }

    using Leaf = openvdb::Int32Grid::TreeType::LeafNodeType;
    static constexpr double coarseVoxel = 2.0;  // edge of a voxel, in cells, from which on samples are tissue or not

    Index3 size_;
    const LabelBlocks& blocks_;
    openvdb::Int32Grid::ConstUnsafeAccessor label_;
    mutable openvdb::Coord leafCorner_ = openvdb::Coord::max();  // labelAt()'s last leaf, or tile
    mutable const openvdb::Int32* leaf_ = nullptr;
    mutable openvdb::Int32 tile_ = 0;
    openvdb::FloatGrid::ConstUnsafeAccessor stiffness_;
    const TissueData* scaledBy_;  // null where no image scales the stiffness
    Vec3 reach_{0.0};             // of the samples along each axis [voxels]
    std::vector<Vec3> offsets_;   // samples of a cell, in voxels from the node
    std::vector<Vec3> places_;    // the same, -1 to 1 along each edge of the cell
    int samples_ = 1;             // along an edge of a cell
    Vec3 edges_{0.0};             // of a cell along each axis of voxels [voxels], if isAligned_
    bool isAligned_ = true;       // the axes of voxels with those of the grid
    std::vector<Vec3> inOctant_;  // samples of an eighth of a cell, in voxels from its middle
    double farthest_ = 0.0;
    Mat3 step_{1.0};         // node steps in voxels
    Vec3 start_{0.0};        // node (0, 0, 0) in voxels
    bool isCoarse_ = false;  // voxels, beside the cells
};

}  // namespace palpate::volume
