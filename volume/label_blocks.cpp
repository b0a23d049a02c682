#include <volume/label_blocks.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/vector_relational.hpp>

namespace palpate::volume {

namespace {

constexpr int side = 4;  // of a block [voxels]; leaves have 8

using Leaf = openvdb::Int32Grid::TreeType::LeafNodeType;
static_assert(Leaf::DIM % side == 0);

// The label of the block with this lowest corner.
std::int32_t labelOfBlock(const openvdb::Int32Grid::ConstUnsafeAccessor& labels, openvdb::Coord low)
{
    const std::int32_t label = labels.getValue(low);
    const Leaf* leaf = labels.probeConstLeaf(low);
    if (leaf == nullptr) {
        return label;
    }
    for (int i = 0; i < side * side * side; ++i) {
        if (leaf->getValue(low.offsetBy(i / side / side, i / side % side, i % side)) != label) {
            return LabelBlocks::several;
        }
    }
    return label;
}

}  // namespace

LabelBlocks::LabelBlocks(const TissueData& tissue, const IndexBox& box)
    : box_(box), first_(box.low / side), blocks_{box.high / side - first_ + 1, Vec3(0.0), 1.0}, labels_(blocks_.count())
{
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, labels_.size()), [&](const tbb::blocked_range<std::size_t>& some) {
        const auto labels = tissue.label->getConstUnsafeAccessor();
        for (std::size_t i = some.begin(); i != some.end(); ++i) {
            const Index3 low = side * (first_ + blocks_.node(i));
            labels_[i] = labelOfBlock(labels, {low.x, low.y, low.z});
        }
    });
}

int LabelBlocks::labelOf(const IndexBox& box) const noexcept
{
    if (glm::any(glm::lessThan(box.low, box_.low)) || glm::any(glm::greaterThan(box.high, box_.high)) || box.empty()) {
        return several;
    }
    const Index3 low = box.low / side - first_;
    const NodeGrid around{box.high / side - first_ - low + 1, Vec3(0.0), 1.0};
    const std::int32_t label = labels_[blocks_.offset(low)];
    for (std::size_t i = 1; i < around.count(); ++i) {
        if (labels_[blocks_.offset(low + around.node(i))] != label) {
            return several;
        }
    }
    return label;
}

}  // namespace palpate::volume
