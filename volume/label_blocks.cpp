#include <volume/label_blocks.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>

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
    : box_(box), first_(box.low / side), size_(box.high / side - first_ + 1)
{
    const auto row = static_cast<std::size_t>(size_.x);
    const std::size_t rows = static_cast<std::size_t>(size_.y) * static_cast<std::size_t>(size_.z);
    labels_.resize(row * rows);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows), [&](const tbb::blocked_range<std::size_t>& some) {
        const auto labels = tissue.label->getConstUnsafeAccessor();
        for (std::size_t i = some.begin(); i != some.end(); ++i) {
            const int y = static_cast<int>(i) % size_.y;
            const int z = static_cast<int>(i) / size_.y;
            for (int x = 0; x < size_.x; ++x) {
                const Index3 low = side * (first_ + Index3(x, y, z));
                labels_[row * i + static_cast<std::size_t>(x)] = labelOfBlock(labels, {low.x, low.y, low.z});
            }
        }
    });
}

int LabelBlocks::labelOf(const IndexBox& box) const noexcept
{
    if (glm::any(glm::lessThan(box.low, box_.low)) || glm::any(glm::greaterThan(box.high, box_.high)) || box.empty()) {
        return several;
    }
    const Index3 low = box.low / side - first_;
    const Index3 high = box.high / side - first_;
    const auto at = [this](int x, int y, int z) {
        return labels_[(static_cast<std::size_t>(z) * static_cast<std::size_t>(size_.y) + static_cast<std::size_t>(y)) *
                           static_cast<std::size_t>(size_.x) +
                       static_cast<std::size_t>(x)];
    };
    const Index3 count = high - low + 1;
    const std::int32_t label = at(low.x, low.y, low.z);
    for (int i = 1; i < count.x * count.y * count.z; ++i) {
        if (at(low.x + i % count.x, low.y + i / count.x % count.y, low.z + i / count.x / count.y) != label) {
            return several;
        }
    }
    return label;
}

}  // namespace palpate::volume
