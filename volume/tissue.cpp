#include <volume/tissue.h>
#include <volume/tissue_impl.h>

#include <fmt/format.h>
#include <openvdb/tools/Prune.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <glm/common.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <limits>
#include <map>
#include <stdexcept>

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

// Counts runs of equal values along x: label maps are made of long ones.
void countSlice(const LabelImage& image, int z, Census& census)
{
    for (int y = 0; y < image.size.y; ++y) {
        const std::uint16_t* row = image.values.data() + image.offset({0, y, z});
        for (int x = 0; x < image.size.x;) {
            const int start = x;
            const std::uint16_t value = row[x];
            while (x < image.size.x && row[x] == value) {
                ++x;
            }
            census.add(value, {start, y, z}, {x - 1, y, z}, static_cast<std::uint64_t>(x - start));
        }
    }
}

Census takeCensus(const LabelImage& image)
{
    const tbb::blocked_range<int> slices(0, image.size.z, 16);
    return tbb::parallel_reduce(
        slices, Census{},
        [&](const tbb::blocked_range<int>& range, Census census) {
            for (int z = range.begin(); z != range.end(); ++z) {
                countSlice(image, z, census);
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

template <typename Leaf>
Block<Leaf> makeBlock(const LabelImage& image, const std::vector<typename Leaf::ValueType>& valueOf, Index3 low)
{
    using Value = typename Leaf::ValueType;
    const Index3 high = glm::min(low + leafSide, image.size);
    const Value first = valueOf[image.values[image.offset(low)]];
    bool uniform = high == low + leafSide || first == Value{};
    auto leaf = std::make_unique<Leaf>(openvdb::Coord(low.x, low.y, low.z), Value{}, false);
    const std::size_t slice = image.offset({0, 0, 1});
    const auto fillColumn = [&](int x, int y) {
        const openvdb::Index at = Leaf::coordToOffset(openvdb::Coord(x, y, low.z));
        const std::size_t from = image.offset({x, y, low.z});
        for (int z = 0; z < high.z - low.z; ++z) {
            const Value value = valueOf[image.values[from + static_cast<std::size_t>(z) * slice]];
            uniform = uniform && value == first;
            if (value != Value{}) {
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
    return {std::move(leaf), uniform ? first : Value{}};
}

// A grid of valueOf[label], active where it differs from the background 0; uniform regions become tiles.
// One layer of blocks at a time, so that no dense array of the grid's own type is needed.
template <typename Grid>
typename Grid::Ptr gridOf(const LabelImage& image, const std::vector<typename Grid::ValueType>& valueOf)
{
    using Leaf = typename Grid::TreeType::LeafNodeType;
    typename Grid::Ptr grid = Grid::create();
    auto& tree = grid->tree();
    const Index3 blocks = (image.size + leafSide - 1) / leafSide;
    std::vector<Block<Leaf>> layer(static_cast<std::size_t>(blocks.x) * static_cast<std::size_t>(blocks.y));
    for (int bz = 0; bz < blocks.z; ++bz) {
        const auto blockOf = [&](std::size_t i) {
            const int n = static_cast<int>(i);
            return Index3(n % blocks.x, n / blocks.x, bz) * leafSide;
        };
        tbb::parallel_for(std::size_t{0}, layer.size(),
                          [&](std::size_t i) { layer[i] = makeBlock<Leaf>(image, valueOf, blockOf(i)); });
        for (std::size_t i = 0; i < layer.size(); ++i) {
            if (layer[i].leaf) {
                tree.addLeaf(layer[i].leaf.release());
            } else if (layer[i].tile != typename Grid::ValueType{}) {
                const Index3 low = blockOf(i);
                tree.addTile(1, openvdb::Coord(low.x, low.y, low.z), layer[i].tile, true);
            }
        }
    }
    openvdb::tools::pruneTiles(tree);
    grid->setTransform(transformOf(image.affine));
    return grid;
}

void checkImage(const LabelImage& image)
{
    if (image.size.x < 1 || image.size.y < 1 || image.size.z < 1) {
        throw std::runtime_error(
            fmt::format("a label map of {} x {} x {} voxels is empty", image.size.x, image.size.y, image.size.z));
    }
    if (image.values.size() != image.offset({0, 0, image.size.z})) {
        throw std::runtime_error(fmt::format("a label map of {} x {} x {} voxels has {} values", image.size.x, image.size.y,
                                             image.size.z, image.values.size()));
    }
    if (!(image.affine.voxelVolume() > 0)) {
        throw std::runtime_error("a label map's voxels have no volume: its directions are dependent or its spacing is 0");
    }
}

void checkTable(const TissueTable& table)
{
    if (table.rows.empty() || table.rows.front().role != Role::air) {
        throw std::runtime_error(fmt::format("tissue table '{}': row 0 must be air, the outside", table.name));
    }
    if (table.rows.size() > 256) {
        throw std::runtime_error(
            fmt::format("tissue table '{}' has {} rows; 256 is the most", table.name, table.rows.size()));
    }
}

std::uint8_t rowOf(const TissueTable& table, const LabelName& label)
{
    if (label.tissue.empty()) {
        throw std::runtime_error(fmt::format("label {} '{}' has no tissue: map it to one", label.value, label.name));
    }
    const auto row = table.find(label.tissue);
    if (!row) {
        throw std::runtime_error(fmt::format("label {} '{}': no tissue '{}' in the tissue table '{}'", label.value,
                                             label.name, label.tissue, table.name));
    }
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
        } else if (value != 0) {
            throw std::runtime_error(fmt::format("label {} ({} voxels) has no name: map it to a tissue", value, s.voxels));
        }
        tissue.structures.push_back(std::move(s));
        tissue.extents.push_back(census.extent[v]);
    }
}

}  // namespace

openvdb::math::Transform::Ptr transformOf(const Affine& affine)
{
    // OpenVDB multiplies row vectors from the left, so a row holds a step.
    const Mat3& m = affine.linear;
    const Vec3& o = affine.origin;
    return openvdb::math::Transform::createLinearTransform(openvdb::math::Mat4d(
        m[0].x, m[0].y, m[0].z, 0.0, m[1].x, m[1].y, m[1].z, 0.0, m[2].x, m[2].y, m[2].z, 0.0, o.x, o.y, o.z, 1.0));
}

Box patientBox(const Affine& affine, const IndexBox& extent)
{
    if (extent.empty()) {
        return {affine.origin, affine.origin};
    }
    const Vec3 low = Vec3(extent.low) - 0.5;
    const Vec3 high = Vec3(extent.high) + 0.5;
    Box box{Vec3(std::numeric_limits<double>::max()), Vec3(std::numeric_limits<double>::lowest())};
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3 index((corner & 1) != 0 ? high.x : low.x, (corner & 2) != 0 ? high.y : low.y,
                         (corner & 4) != 0 ? high.z : low.z);
        const Vec3 p = affine.toPatient(index);
        box.low = glm::min(box.low, p);
        box.high = glm::max(box.high, p);
    }
    return box;
}

void TissueData::derive()
{
    for (const Structure& s : structures) {
        lookup.row[s.value] = s.tissue;
        lookup.solid[s.value] = table.rows[s.tissue].role != Role::air ? 1 : 0;
    }
    box = patientBox(affine, extentOf(lookup.solid));
}

IndexBox TissueData::extentOf(const std::vector<std::uint8_t>& wanted) const
{
    IndexBox all{size, Index3(-1)};
    for (std::size_t i = 0; i < structures.size(); ++i) {
        if (wanted[structures[i].value] != 0) {
            all.low = glm::min(all.low, extents[i].low);
            all.high = glm::max(all.high, extents[i].high);
        }
    }
    return all;
}

Tissue Tissue::fromLabels(const LabelImage& image, TissueTable table, std::span<const LabelName> names,
                          Provenance provenance)
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
    impl->label = gridOf<openvdb::Int32Grid>(image, labelOf);
    impl->stiffness = gridOf<openvdb::FloatGrid>(image, stiffnessOf);
    impl->occupancy = gridOf<openvdb::BoolGrid>(image, solidOf);
    impl->label->setName("label");
    impl->stiffness->setName("stiffness");
    impl->occupancy->setName("occupancy");
    return Tissue(std::move(impl));
}

Tissue::Tissue(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Tissue::Tissue(Tissue&&) noexcept = default;
Tissue& Tissue::operator=(Tissue&&) noexcept = default;
Tissue::~Tissue() = default;

Index3 Tissue::size() const noexcept
{
    return impl_->size;
}
const Affine& Tissue::affine() const noexcept
{
    return impl_->affine;
}
const TissueTable& Tissue::table() const noexcept
{
    return impl_->table;
}
std::span<const Structure> Tissue::structures() const noexcept
{
    return impl_->structures;
}
const Provenance& Tissue::provenance() const noexcept
{
    return impl_->provenance;
}
Box Tissue::box() const noexcept
{
    return impl_->box;
}

MemoryUse Tissue::memory() const
{
    return {impl_->label->memUsage(), impl_->stiffness->memUsage(), impl_->occupancy->memUsage()};
}

std::vector<std::uint16_t> Tissue::labelsNamed(std::string_view wanted) const
{
    std::vector<std::uint16_t> byName;
    std::vector<std::uint16_t> byTissue;
    for (const Structure& s : impl_->structures) {
        if (s.name == wanted) {
            byName.push_back(s.value);
        }
        if (impl_->table.rows[s.tissue].name == wanted) {
            byTissue.push_back(s.value);
        }
    }
    return byName.empty() ? byTissue : byName;
}

// Accessors that do not register with the tree: nothing to lock, nothing to allocate.
struct Tissue::Reader::Impl {
    const TissueData& tissue;
    Mat3 toIndex;
    mutable openvdb::Int32Grid::ConstUnsafeAccessor label;
    mutable openvdb::FloatGrid::ConstUnsafeAccessor stiffness;

    explicit Impl(const TissueData& t)
        : tissue(t),
          toIndex(glm::inverse(t.affine.linear)),
          label(t.label->getConstUnsafeAccessor()),
          stiffness(t.stiffness->getConstUnsafeAccessor())
    {
    }

    // The voxel around `p`; false outside the volume, also for a `p` that is not finite.
    bool voxel(Vec3 p, openvdb::Coord& ijk) const noexcept
    {
        const Vec3 index = toIndex * (p - tissue.affine.origin);
        const Vec3 last = Vec3(tissue.size) - 0.5;
        const bool inside = index.x >= -0.5 && index.y >= -0.5 && index.z >= -0.5 && index.x < last.x && index.y < last.y &&
                            index.z < last.z;
        if (!inside) {
            return false;
        }
        const Index3 n(glm::floor(index + 0.5));
        ijk = openvdb::Coord(n.x, n.y, n.z);
        return true;
    }
};

Tissue::Reader::Reader(const Tissue& tissue) : impl_(std::make_unique<Impl>(*tissue.impl_)) {}
Tissue::Reader::Reader(Reader&&) noexcept = default;
Tissue::Reader::~Reader() = default;

std::uint16_t Tissue::Reader::label(Vec3 p) const noexcept
{
    openvdb::Coord ijk;
    return impl_->voxel(p, ijk) ? static_cast<std::uint16_t>(impl_->label.getValue(ijk)) : std::uint16_t{0};
}

std::uint8_t Tissue::Reader::tissue(Vec3 p) const noexcept
{
    openvdb::Coord ijk;
    if (!impl_->voxel(p, ijk)) {
        return 0;
    }
    return impl_->tissue.lookup.row[static_cast<std::uint16_t>(impl_->label.getValue(ijk))];
}

double Tissue::Reader::youngsModulus(Vec3 p) const noexcept
{
    openvdb::Coord ijk;
    return impl_->voxel(p, ijk) ? 1e3 * static_cast<double>(impl_->stiffness.getValue(ijk)) : 0.0;
}

}  // namespace palpate::volume
