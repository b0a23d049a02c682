#include <ultrasound/medium.h>

#include <channel/deformation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::ultrasound {

namespace {

constexpr double fineEnough = 0.35e-3;          // [m]: labels that need not be refined
constexpr std::size_t affordable = 24'000'000;  // voxels: 3 bytes each
constexpr int border = 3;                       // voxels at the sides that are not looked at

// Blood and air after a core: dark, between the bright cut walls.
constexpr channel::TissueSound blood{1578, 1050, 0.21F, 1.16F, -20, 0, 0};

glm::vec3 vec3(const std::array<float, 3>& v) noexcept
{
    return {v[0], v[1], v[2]};
}

}  // namespace

Medium::Medium(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint8_t> fine)
{
    for (std::size_t row = 0; row <= channel::rowBits; ++row) {
        sound_[row] = scenery.sound[row];
        sound_[row | holeBit] = blood;
    }
    for (std::size_t label = 0; label < code_.size(); ++label)
        code_[label] =
            static_cast<std::int16_t>(std::lround(codes * std::log(impedance(static_cast<std::uint8_t>(label)))));
    if (!fine.empty()) {
        origin_ = channel::vec(scenery.fine.origin);
        spacing_ = scenery.fine.spacing;
        size_ = channel::sizeOf(scenery.fine);
        labels_.assign(fine.begin(), fine.end());
        for (std::uint8_t& label : labels_)
            label &= channel::rowBits;
    } else {
        refine(scenery, labels);
    }
    lnZ_.resize(labels_.size());
    finish(glm::ivec3(0), size_);
}

void Medium::refine(const channel::Scenery& scenery, std::span<const std::uint8_t> labels)
{
    const channel::Grid& grid = scenery.labels;
    int factor = 1;
    while (factor < 3 && grid.spacing / factor > fineEnough &&
           base::countOf((factor + 1) * channel::sizeOf(grid)) <= affordable)
        ++factor;
    // As many to each voxel as to the next: between two voxels a node would always belong to the upper one.
    spacing_ = grid.spacing / factor;
    origin_ = channel::vec(grid.origin) - 0.5 * (factor - 1) * spacing_;
    size_ = factor * channel::sizeOf(grid);
    labels_.resize(base::countOf(size_));
    channel::Scenery still = scenery;
    still.lattice = {{1, 1, 1}, 0, grid.origin, grid.spacing};  // nothing of it is asked for
    const channel::Deformation rest(still, labels);
    std::size_t at = 0;
    for (int z = 0; z < size_.z; ++z)
        for (int y = 0; y < size_.y; ++y)
            for (int x = 0; x < size_.x; ++x)
                labels_[at++] = rest.restLabel(origin_ + spacing_ * glm::dvec3(x, y, z)) & channel::rowBits;
}

float Medium::impedance(std::uint8_t label) const noexcept
{
    constexpr float gel = 1.54F;
    const channel::TissueSound& s = sound(label);
    const bool air = (label & compared) == 0;
    return air || !(s.soundSpeed > 0) || !(s.density > 0) ? gel : 1e-6F * s.soundSpeed * s.density;
}

// In the box low <= n < high: ln Z smoothed by (1 2 1) / 4 along each axis, and which voxels are pure, two voxels far.
void Medium::finish(glm::ivec3 low, glm::ivec3 high)
{
    // What is written back lies a border inside what is looked at, so that no voxel is judged by another row's end.
    const glm::ivec3 from = glm::max(low - border, glm::ivec3(0)), to = glm::min(high + border, size_);
    low = glm::max(low - 2 * border, glm::ivec3(0));
    high = glm::min(high + 2 * border, size_);
    const glm::ivec3 n = high - low;
    if (to.x <= from.x || to.y <= from.y || to.z <= from.z)
        return;
    std::vector<std::int16_t> z(base::countOf(n)), before;
    std::vector<std::uint8_t> same(base::countOf(n)), was;  // the label, or 0xff where not pure
    std::size_t at = 0;
    for (int k = low.z; k < high.z; ++k)
        for (int j = low.y; j < high.y; ++j)
            for (int i = low.x; i < high.x; ++i, ++at) {
                same[at] = labels_[offset({i, j, k})] & compared;
                z[at] = code_[same[at]];
            }
    constexpr std::uint8_t mixed = 0xff;
    std::size_t step = 1;
    for (int axis = 0; axis < 3; ++axis) {
        before = z;
        was = same;
        for (std::size_t i = step; i + step < z.size(); ++i) {
            z[i] = static_cast<std::int16_t>((before[i - step] + 2 * before[i] + before[i + step] + 2) / 4);
            const bool near = was[i - step] == was[i] && was[i + step] == was[i];
            const bool far =
                i < 2 * step || i + 2 * step >= z.size() || (was[i - 2 * step] == was[i] && was[i + 2 * step] == was[i]);
            if (!near || !far)
                same[i] = mixed;
        }
        step *= static_cast<std::size_t>(n[axis]);
    }
    at = 0;
    for (int k = low.z; k < high.z; ++k)
        for (int j = low.y; j < high.y; ++j)
            for (int i = low.x; i < high.x; ++i, ++at) {
                if (i < from.x || j < from.y || k < from.z || i >= to.x || j >= to.y || k >= to.z)
                    continue;
                const std::size_t voxel = offset({i, j, k});
                lnZ_[voxel] = z[at];
                labels_[voxel] = static_cast<std::uint8_t>((labels_[voxel] & compared) | (same[at] != mixed ? pureBit : 0));
            }
}

// Whether the voxels from `low` to `high` are there, those of the border not counted. Before a number becomes an index: a
// place may be anywhere.
bool Medium::holds(glm::vec3 low, glm::vec3 high) const noexcept
{
    const glm::vec3 end(size_ - border);
    return low.x >= border && low.y >= border && low.z >= border && high.x < end.x && high.y < end.y && high.z < end.z;
}

std::uint8_t Medium::label(glm::vec3 v) const noexcept
{
    const glm::vec3 voxel = v + 0.5F;
    return holds(v, voxel) ? labels_[offset(glm::ivec3(voxel))] : unknown;
}

// Linear along each axis.
Medium::Impedance Medium::impedanceAt(glm::vec3 v) const noexcept
{
    if (!holds(v, v))
        return {pureImpedance(unknown), glm::vec3(0)};
    const glm::ivec3 n(v);
    const glm::vec3 t = v - glm::vec3(n);
    const std::int16_t* q = &lnZ_[offset(n)];
    const auto y = static_cast<std::size_t>(size_.x), z = y * static_cast<std::size_t>(size_.y);
    const auto f = [q](std::size_t at) { return static_cast<float>(q[at]); };
    const auto mix = [](float s, float a, float b) { return a + s * (b - a); };
    const float x00 = f(1) - f(0), x10 = f(y + 1) - f(y), x01 = f(z + 1) - f(z), x11 = f(z + y + 1) - f(z + y);
    const float y00 = f(y) - f(0), y10 = f(y + 1) - f(1), y01 = f(z + y) - f(z), y11 = f(z + y + 1) - f(z + 1);
    const float z00 = f(z) - f(0), z10 = f(z + 1) - f(1), z01 = f(z + y) - f(y), z11 = f(z + y + 1) - f(y + 1);
    const float near = mix(t.y, f(0) + t.x * x00, f(y) + t.x * x10), far = mix(t.y, f(z) + t.x * x01, f(z + y) + t.x * x11);
    return {mix(t.z, near, far) / codes,
            glm::vec3(mix(t.z, mix(t.y, x00, x10), mix(t.y, x01, x11)), mix(t.z, mix(t.x, y00, y10), mix(t.x, y01, y11)),
                      mix(t.y, mix(t.x, z00, z10), mix(t.x, z01, z11))) /
                codes};
}

void Medium::dig(const channel::Hole& hole, double radius, glm::ivec3& low, glm::ivec3& high)
{
    const auto voxel = [&](const std::array<float, 3>& p) { return glm::vec3((glm::dvec3(vec3(p)) - origin_) / spacing_); };
    const glm::vec3 from = voxel(hole.from), way = voxel(hole.to) - from;
    // At least a voxel wide, or a coarse grid would lose it.
    const auto r = static_cast<float>(std::max(radius / spacing_, 0.75));
    const float square = glm::dot(way, way);
    if (!(square > 0))
        return;
    const glm::ivec3 first = glm::max(glm::ivec3(glm::floor(glm::min(from, from + way) - r)), glm::ivec3(0));
    const glm::ivec3 last = glm::min(glm::ivec3(glm::ceil(glm::max(from, from + way) + r)), size_ - 1);
    for (int k = first.z; k <= last.z; ++k)
        for (int j = first.y; j <= last.y; ++j)
            for (int i = first.x; i <= last.x; ++i) {
                const glm::vec3 d = glm::vec3(i, j, k) - from;
                const float along = glm::dot(d, way) / square;
                const glm::vec3 off = d - along * way;
                std::uint8_t& label = labels_[offset({i, j, k})];
                const bool tissue = (label & channel::rowBits) != 0 && (label & holeBit) == 0;
                if (!tissue || along < 0 || along > 1 || glm::dot(off, off) > r * r)
                    continue;
                saved_.push_back({offset({i, j, k}), label});
                label = static_cast<std::uint8_t>((label & channel::rowBits) | holeBit);
            }
    low = glm::min(low, first);
    high = glm::max(high, last + 1);
}

bool Medium::punch(std::span<const channel::Hole> holes, double radius)
{
    if (std::ranges::equal(holes, holes_, [](const auto& a, const auto& b) { return a.from == b.from && a.to == b.to; }))
        return false;
    glm::ivec3 low = size_, high(0);
    while (!saved_.empty()) {
        const Saved& s = saved_.back();
        labels_[s.at] = s.label;
        const glm::ivec3 n = base::cellOf(size_, s.at);
        low = glm::min(low, n);
        high = glm::max(high, n + 1);
        saved_.pop_back();
    }
    holes_.assign(holes.begin(), holes.end());
    for (const channel::Hole& hole : holes_)
        dig(hole, radius, low, high);
    finish(low, high);
    return true;
}

}  // namespace palpate::ultrasound
