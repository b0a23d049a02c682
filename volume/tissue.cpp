#include <volume/tissue.h>

#include <volume/tissue_impl.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/gtc/matrix_access.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::volume {

openvdb::math::Transform::Ptr transformOf(const Affine& affine)
{
    // OpenVDB multiplies row vectors from the left, so a row holds a step. It takes steps of 10 um, in metres, for a
    // singular matrix.
    const Mat3 m = 1e3 * affine.linear;
    const Vec3 o = 1e3 * affine.origin;
    return openvdb::math::Transform::createLinearTransform(openvdb::math::Mat4d(
        m[0].x, m[0].y, m[0].z, 0.0, m[1].x, m[1].y, m[1].z, 0.0, m[2].x, m[2].y, m[2].z, 0.0, o.x, o.y, o.z, 1.0));
}

double valueOfAir(const std::string& unit) noexcept
{
    return unit == "HU" ? -1000.0 : 0.0;
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

namespace {

constexpr double onItsBack = 0.05;  // fraction of a body's depth that is held where no tissue is fixed

Support onItsBackIn(const Affine& affine, IndexBox body)
{
    const int axis = longestAxis(glm::row(affine.linear, 1));
    const int depth = body.high[axis] - body.low[axis] + 1;
    const int layers = std::max(1, static_cast<int>(std::lround(onItsBack * depth)));
    const bool backIsHigh = affine.linear[axis].y > 0.0;
    Vec3 index = 0.5 * Vec3(body.low + body.high);
    index[axis] = backIsHigh ? body.high[axis] + 0.5 - layers : body.low[axis] - 0.5 + layers;
    const Vec3 inIndex = glm::row(glm::inverse(affine.linear), axis);  // grows along the axis alone, in whatever direction
    return {affine.toPatient(index), glm::normalize(backIsHigh ? -inIndex : inIndex)};
}

// Calls visit(offset, value) for every voxel of a grid, slices on all cores.
template <typename Grid, typename Visit>
void forEachVoxel(const Grid& grid, const LabelImage& places, const Visit& visit)
{
    tbb::parallel_for(tbb::blocked_range<int>(0, places.size.z, 8), [&](const tbb::blocked_range<int>& slab) {
        const auto accessor = grid.getConstUnsafeAccessor();
        forEachIndex(Index3(0, 0, slab.begin()), Index3(places.size.x - 1, places.size.y - 1, slab.end() - 1),
                     [&](Index3 n) { visit(places.offset(n), accessor.getValue(openvdb::Coord(n.x, n.y, n.z))); });
    });
}

}  // namespace

void TissueData::derive()
{
    for (const Structure& s : structures) {
        lookup.row[s.value] = s.tissue;
        lookup.solid[s.value] = table.rows[s.tissue].role != Role::air ? 1 : 0;
    }
    const IndexBox body = extentOf(lookup.solid);
    box = patientBox(affine, body);
    const bool held = std::ranges::any_of(structures, [this](const Structure& s) { return table.rows[s.tissue].fixed; });
    if (!held && !body.empty()) {
        support = onItsBackIn(affine, body);
    }
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

double StiffnessMap::factor(double value) const noexcept
{
    const auto after = std::upper_bound(points.begin(), points.end(), value,
                                        [](double v, const std::pair<double, double>& p) { return v < p.first; });
    if (after == points.begin() || after == points.end()) {
        return points.empty() ? 1.0 : (after == points.end() ? points.back() : points.front()).second;
    }
    const auto before = after - 1;
    const double t = (value - before->first) / (after->first - before->first);
    return before->second + t * (after->second - before->second);
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
const std::optional<Support>& Tissue::support() const noexcept
{
    return impl_->support;
}

MemoryUse Tissue::memory() const
{
    return {impl_->label->memUsage(), impl_->stiffness->memUsage(), impl_->occupancy->memUsage(),
            impl_->image ? impl_->image->memUsage() : 0};
}

bool Tissue::hasImage() const noexcept
{
    return impl_->image != nullptr;
}
const std::string& Tissue::imageUnit() const noexcept
{
    return impl_->imageUnit;
}
const StiffnessMap& Tissue::stiffnessMap() const noexcept
{
    return impl_->stiffnessMap;
}

LabelImage Tissue::labels() const
{
    LabelImage image{impl_->size, impl_->affine, {}};
    image.values.resize(image.offset({0, 0, image.size.z}));
    forEachVoxel(*impl_->label, image,
                 [&](std::size_t at, std::int32_t value) { image.values[at] = static_cast<std::uint16_t>(value); });
    return image;
}

std::optional<CompanionImage> Tissue::companion() const
{
    if (!impl_->image) {
        return std::nullopt;
    }
    const LabelImage places{impl_->size, impl_->affine, {}};
    CompanionImage image{{}, impl_->imageUnit, impl_->stiffnessMap};
    image.values.resize(places.offset({0, 0, places.size.z}));
    forEachVoxel(*impl_->image, places, [&](std::size_t at, float value) { image.values[at] = value; });
    return image;
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
    return !impl_->voxel(p, ijk) ? 0 : impl_->tissue.lookup.row[static_cast<std::uint16_t>(impl_->label.getValue(ijk))];
}

double Tissue::Reader::youngsModulus(Vec3 p) const noexcept
{
    openvdb::Coord ijk;
    return impl_->voxel(p, ijk) ? 1e3 * static_cast<double>(impl_->stiffness.getValue(ijk)) : 0.0;
}

constexpr std::array<std::string_view, 6> roleNames = {"plain", "skin", "tumour", "vital", "bone", "air"};

std::string_view name(Role role) noexcept
{
    return roleNames[static_cast<std::size_t>(role)];
}

std::optional<Role> roleNamed(std::string_view name) noexcept
{
    const auto at = std::find(roleNames.begin(), roleNames.end(), name);
    return at == roleNames.end() ? std::nullopt : std::optional(static_cast<Role>(at - roleNames.begin()));
}

std::optional<std::uint8_t> TissueTable::find(std::string_view wanted) const noexcept
{
    const auto at = std::find_if(rows.begin(), rows.end(), [&](const TissueRow& row) { return row.name == wanted; });
    return at == rows.end() ? std::nullopt : std::optional(static_cast<std::uint8_t>(at - rows.begin()));
}

}  // namespace palpate::volume
