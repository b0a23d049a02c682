#include <base/error.h>
#include <volume/image_check.h>
#include <volume/runs.h>
#include <volume/table_check.h>
#include <volume/tissue.h>
#include <volume/tissue_impl.h>

#include <openvdb/tools/Prune.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <glm/common.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace palpate::volume {

namespace {

constexpr int leafSide = 8;  // voxels along the side of an OpenVDB leaf

// Voxels and extent of every label value of some slices.
struct Census {
    std::vector<std::uint64_t> voxels = std::vector<std::uint64_t>(65536, 0);
    std::vector<IndexBox> extent =
        std::vector<IndexBox>(65536, {Index3(std::numeric_limits<int>::max()), Index3(std::numeric_limits<int>::min())});

    void add(std::uint16_t value, Index3 from, Index3 to, std::uint64_t count)
    {
        voxels[value] += count;
        extent[value].low = glm::min(extent[value].low, from);
        extent[value].high = glm::max(extent[value].high, to);
    }
    void join(const Census& other)
    {
        for (std::size_t v = 0; v < voxels.size(); ++v) {
            if (other.voxels[v] > 0) {
                add(static_cast<std::uint16_t>(v), other.extent[v].low, other.extent[v].high, other.voxels[v]);
            }
        }
    }
};

Census takeCensus(const LabelImage& image)
{
    const tbb::blocked_range<int> slices(0, image.size.z, 16);
    return tbb::parallel_reduce(
        slices, Census{},
        [&](const tbb::blocked_range<int>& range, Census census) {
            for (int z = range.begin(); z != range.end(); ++z) {
                forEachRunIn(image, z, [&](std::uint16_t value, int first, int last, int y, int) {
                    census.add(value, {first, y, z}, {last, y, z}, static_cast<std::uint64_t>(last - first + 1));
                });
            }
            return census;
        },
        [](Census a, const Census& b) {
            a.join(b);
            return a;
        });
}

// One leaf-sized block of a tree under construction: a leaf, or a tile when all of it has one value.
template <typename Leaf>
struct Block {
    std::unique_ptr<Leaf> leaf;
    typename Leaf::ValueType tile{};
};

template <typename Leaf, typename ValueAt>
Block<Leaf> makeBlock(const LabelImage& image, const ValueAt& valueAt, typename Leaf::ValueType background, Index3 low)
{
    using Value = typename Leaf::ValueType;
    const Index3 high = glm::min(low + leafSide, image.size);
    const Value first = valueAt(image.offset(low));
    bool uniform = high == low + leafSide || first == background;
    auto leaf = std::make_unique<Leaf>(openvdb::Coord(low.x, low.y, low.z), background, false);
    const std::size_t slice = image.offset({0, 0, 1});
    const auto fillColumn = [&](int x, int y) {
        const openvdb::Index at = Leaf::coordToOffset(openvdb::Coord(x, y, low.z));
        const std::size_t from = image.offset({x, y, low.z});
        for (int z = 0; z < high.z - low.z; ++z) {
            const Value value = valueAt(from + static_cast<std::size_t>(z) * slice);
            uniform = uniform && value == first;
            if (value != background) {
                leaf->setValueOn(at + static_cast<openvdb::Index>(z), value);
            }
        }
    };
    for (int x = low.x; x < high.x; ++x) {
        for (int y = low.y; y < high.y; ++y) {
            fillColumn(x, y);
        }
    }
    if (uniform) {
        leaf.reset();
    }
    return {std::move(leaf), uniform ? first : background};
}

// A grid of valueAt(offset of a voxel), active where it differs from the background; uniform regions become tiles.
// One layer of blocks at a time, so that no dense array of the grid's own type is needed.
template <typename Grid, typename ValueAt>
typename Grid::Ptr gridOf(const LabelImage& image, const ValueAt& valueAt, typename Grid::ValueType background = {})
{
    using Leaf = typename Grid::TreeType::LeafNodeType;
    typename Grid::Ptr grid = Grid::create(background);
    auto& tree = grid->tree();
    const Index3 blocks = (image.size + leafSide - 1) / leafSide;
    std::vector<Block<Leaf>> layer(static_cast<std::size_t>(blocks.x) * static_cast<std::size_t>(blocks.y));
    for (int bz = 0; bz < blocks.z; ++bz) {
        const auto blockOf = [&](std::size_t i) {
            const int n = static_cast<int>(i);
            return Index3(n % blocks.x, n / blocks.x, bz) * leafSide;
        };
        tbb::parallel_for(std::size_t{0}, layer.size(),
                          [&](std::size_t i) { layer[i] = makeBlock<Leaf>(image, valueAt, background, blockOf(i)); });
        for (std::size_t i = 0; i < layer.size(); ++i) {
            if (layer[i].leaf) {
                tree.addLeaf(layer[i].leaf.release());
            } else if (layer[i].tile != background) {
                const Index3 low = blockOf(i);
                tree.addTile(1, openvdb::Coord(low.x, low.y, low.z), layer[i].tile, true);
            }
        }
    }
    openvdb::tools::pruneTiles(tree);
    grid->setTransform(transformOf(image.affine));
    return grid;
}

std::uint8_t rowOf(const TissueTable& table, const LabelName& label)
{
    base::failIf(label.tissue.empty(), "label {} '{}' has no tissue: map it to one", label.value, label.name);
    const auto row = table.find(label.tissue);
    base::failIf(!row, "label {} '{}': no tissue '{}' in the tissue table '{}'", label.value, label.name, label.tissue,
                 table.name);
    return *row;
}

void addStructures(TissueData& tissue, const Census& census, std::span<const LabelName> names)
{
    std::map<std::uint16_t, const LabelName*> named;
    for (const LabelName& n : names) {
        named.emplace(n.value, &n);
    }
    for (std::size_t v = 0; v < census.voxels.size(); ++v) {
        if (census.voxels[v] == 0) {
            continue;
        }
        const auto value = static_cast<std::uint16_t>(v);
        const auto found = named.find(value);
        Structure s{value, "outside", 0, census.voxels[v],
                    static_cast<double>(census.voxels[v]) * tissue.affine.voxelVolume()};
        if (found != named.end()) {
            s.name = found->second->name;
            s.tissue = rowOf(tissue.table, *found->second);
            s.colour = found->second->colour;
            s.terminology = found->second->terminology;
        } else if (value != 0) {
            throw base::error("label {} ({} voxels) has no name: map it to a tissue", value, s.voxels);
        }
        tissue.structures.push_back(std::move(s));
        tissue.extents.push_back(census.extent[v]);
    }
}

// By label, whether the image scales its stiffness (65536 x 1).
std::vector<bool> scaledLabels(const TissueData& tissue)
{
    const StiffnessMap& map = tissue.stiffnessMap;
    std::vector<bool> scaled(65536, false);
    for (const Structure& s : tissue.structures) {
        const std::string& name = tissue.table.rows[s.tissue].name;
        const bool meant =
            map.tissues.empty() || std::find(map.tissues.begin(), map.tissues.end(), name) != map.tissues.end();
        scaled[s.value] = !map.points.empty() && meant && std::ranges::find(map.notOf, s.value) == map.notOf.end();
    }
    return scaled;
}

// The image, and the stiffness that it scales.
void addImage(TissueData& tissue, const LabelImage& labels, const CompanionImage& companion,
              const std::vector<float>& stiffnessOf)
{
    base::failIf(companion.values.size() != labels.values.size(),
                 "an image of {} values does not fit a label map of {} voxels", companion.values.size(),
                 labels.values.size());
    const auto background = static_cast<float>(valueOfAir(companion.unit));
    tissue.imageUnit = companion.unit;
    tissue.stiffnessMap = companion.stiffness;
    tissue.image = gridOf<openvdb::FloatGrid>(
        labels, [&](std::size_t at) { return companion.values[at]; }, background);
    tissue.image->setName("image");
    if (companion.stiffness.points.empty()) {
        return;
    }
    const std::vector<bool> scaled = scaledLabels(tissue);
    tissue.stiffness = gridOf<openvdb::FloatGrid>(labels, [&](std::size_t at) {
        const std::uint16_t label = labels.values[at];
        const auto value = static_cast<double>(companion.values[at]);
        return scaled[label] ? stiffnessOf[label] * static_cast<float>(companion.stiffness.factor(value))
                             : stiffnessOf[label];
    });
}

}  // namespace

Tissue Tissue::fromLabels(const LabelImage& image, TissueTable table, std::span<const LabelName> names,
                          Provenance provenance, const CompanionImage* companion)
{
    checkImage(image);
    checkTable(table);
    auto impl = std::make_unique<Impl>();
    impl->size = image.size;
    impl->affine = image.affine;
    impl->table = std::move(table);
    impl->provenance = std::move(provenance);
    addStructures(*impl, takeCensus(image), names);
    impl->derive();

    std::vector<std::int32_t> labelOf(65536, 0);
    std::vector<float> stiffnessOf(65536, 0.0F);
    for (const Structure& s : impl->structures) {
        labelOf[s.value] = s.value;
        if (impl->lookup.solid[s.value] != 0) {
            stiffnessOf[s.value] = static_cast<float>(impl->table.rows[s.tissue].youngsModulus * 1e-3);
        }
    }
    std::vector<bool> solidOf(impl->lookup.solid.begin(), impl->lookup.solid.end());
    const auto by = [&](const auto& valueOf) {
        return [&image, &valueOf](std::size_t at) { return valueOf[image.values[at]]; };
    };
    impl->label = gridOf<openvdb::Int32Grid>(image, by(labelOf));
    impl->stiffness = gridOf<openvdb::FloatGrid>(image, by(stiffnessOf));
    impl->occupancy = gridOf<openvdb::BoolGrid>(image, by(solidOf));
    if (companion != nullptr) {
        addImage(*impl, image, *companion, stiffnessOf);
    }
    impl->label->setName("label");
    impl->stiffness->setName("stiffness");
    impl->occupancy->setName("occupancy");
    return Tissue(std::move(impl));
}

}  // namespace palpate::volume
