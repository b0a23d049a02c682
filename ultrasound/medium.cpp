#include <ultrasound/medium.h>

#include <channel/deformation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

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
    if (fine.empty()) {
        layer_ = refined(scenery, labels, fineEnough);
    } else {
        layer_.origin = channel::vec(scenery.fine.origin);
        layer_.spacing = scenery.fine.spacing;
        layer_.size = channel::sizeOf(scenery.fine);
        layer_.labels.assign(fine.begin(), fine.end());
        for (std::uint8_t& label : layer_.labels)
            label &= channel::rowBits;
    }
    finish(layer_, glm::ivec3(0), layer_.size);
    high_ = layer_.size;
    if (!fine.empty())
        surround(scenery, labels);
}

// Takes the labels of the display for what lies beyond the fine ones.
void Medium::surround(const channel::Scenery& scenery, std::span<const std::uint8_t> labels)
{
    const channel::Grid& grid = scenery.labels;
    const glm::ivec3 size = channel::sizeOf(grid);
    glm::ivec3 first = size, last(-1);
    for (std::size_t at = 0; at < labels.size(); ++at)
        if ((labels[at] & channel::rowBits) != 0) {
            const glm::ivec3 n = base::cellOf(size, at);
            first = glm::min(first, n);
            last = glm::max(last, n);
        }
    // Nodes of the display at the body's borders may lie beside it.
    const glm::dvec3 low = channel::vec(grid.origin) + grid.spacing * (glm::dvec3(first) + 1.5);
    const glm::dvec3 high = channel::vec(grid.origin) + grid.spacing * (glm::dvec3(last) - 1.5);
    const glm::dvec3 end = layer_.origin + layer_.spacing * glm::dvec3(layer_.size - 1);
    const bool all = glm::all(glm::greaterThanEqual(low, layer_.origin)) && glm::all(glm::lessThanEqual(high, end));
    if (all || last.x < 0)
        return;
    around_ = refined(scenery, labels, std::max(fineEnough, layer_.spacing));
    finish(around_, glm::ivec3(0), around_.size);
    perVoxel_ = static_cast<float>(layer_.spacing / around_.spacing);
    toAround_ = glm::vec3((layer_.origin - around_.origin) / around_.spacing);
    const glm::vec3 from = (-0.5F - toAround_) / perVoxel_, to = (glm::vec3(around_.size) - 0.5F - toAround_) / perVoxel_;
    low_ = glm::min(low_, glm::ivec3(glm::floor(from)));
    high_ = glm::max(high_, glm::ivec3(glm::ceil(to)) + 1);
}

Medium::Layer Medium::refined(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, double enough)
{
    const channel::Grid& grid = scenery.labels;
    int factor = 1;
    while (factor < 3 && grid.spacing / factor > enough &&
           base::countOf((factor + 1) * channel::sizeOf(grid)) <= affordable)
        ++factor;
    Layer out;
    // As many to each voxel as to the next: between two voxels a node would always belong to the upper one.
    out.spacing = grid.spacing / factor;
    out.origin = channel::vec(grid.origin) - 0.5 * (factor - 1) * out.spacing;
    out.size = factor * channel::sizeOf(grid);
    out.labels.resize(base::countOf(out.size));
    channel::Scenery still = scenery;
    still.lattice = {{1, 1, 1}, 0, grid.origin, grid.spacing};  // nothing of it is asked for
    const channel::Deformation rest(still, labels);
    std::size_t at = 0;
    for (int z = 0; z < out.size.z; ++z)
        for (int y = 0; y < out.size.y; ++y)
            for (int x = 0; x < out.size.x; ++x)
                out.labels[at++] = rest.restLabel(out.origin + out.spacing * glm::dvec3(x, y, z)) & channel::rowBits;
    return out;
}

float Medium::impedance(std::uint8_t label) const noexcept
{
    constexpr float gel = 1.54F;
    const channel::TissueSound& s = sound(label);
    const bool air = (label & compared) == 0;
    return air || !(s.soundSpeed > 0) || !(s.density > 0) ? gel : 1e-6F * s.soundSpeed * s.density;
}

// In the box low <= n < high: ln Z smoothed by (1 2 1) / 4 along each axis, and which voxels are pure, two voxels far.
void Medium::finish(Layer& layer, glm::ivec3 low, glm::ivec3 high) const
{
    layer.lnZ.resize(layer.labels.size());
    // What is written back lies a border inside what is looked at, so that no voxel is judged by another row's end.
    const glm::ivec3 from = glm::max(low - border, glm::ivec3(0)), to = glm::min(high + border, layer.size);
    low = glm::max(low - 2 * border, glm::ivec3(0));
    high = glm::min(high + 2 * border, layer.size);
    const glm::ivec3 n = high - low;
    if (to.x <= from.x || to.y <= from.y || to.z <= from.z)
        return;
    std::vector<std::int16_t> z(base::countOf(n)), before;
    std::vector<std::uint8_t> same(base::countOf(n)), was;  // the label, or 0xff where not pure
    std::size_t at = 0;
    for (int k = low.z; k < high.z; ++k)
        for (int j = low.y; j < high.y; ++j)
            for (int i = low.x; i < high.x; ++i, ++at) {
                same[at] = layer.labels[layer.offset({i, j, k})] & compared;
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
                const std::size_t voxel = layer.offset({i, j, k});
                layer.lnZ[voxel] = z[at];
                layer.labels[voxel] =
                    static_cast<std::uint8_t>((layer.labels[voxel] & compared) | (same[at] != mixed ? pureBit : 0));
            }
}

// Whether the voxels from `low` to `high` are there, those of the border not counted. Before a number becomes an index: a
// place may be anywhere.
bool Medium::Layer::holds(glm::vec3 low, glm::vec3 high) const noexcept
{
    const glm::vec3 end(size - border);
    return low.x >= border && low.y >= border && low.z >= border && high.x < end.x && high.y < end.y && high.z < end.z;
}

std::uint8_t Medium::label(glm::vec3 v) const noexcept
{
    const glm::vec3 voxel = v + 0.5F;
    return layer_.holds(v, voxel) ? layer_.labels[layer_.offset(glm::ivec3(voxel))] : labelAround(v);
}

std::uint8_t Medium::labelAround(glm::vec3 v) const noexcept
{
    if (around_.labels.empty())
        return unknown;
    const glm::vec3 at = toAround_ + perVoxel_ * v, voxel = at + 0.5F;
    return around_.holds(at, voxel) ? around_.labels[around_.offset(glm::ivec3(voxel))] : unknown;
}

Medium::Impedance Medium::impedanceAt(glm::vec3 v) const noexcept
{
    if (layer_.holds(v, v))
        return impedanceIn(layer_, v);
    const glm::vec3 at = toAround_ + perVoxel_ * v;
    if (around_.labels.empty() || !around_.holds(at, at))
        return {pureImpedance(unknown), glm::vec3(0)};
    const Impedance there = impedanceIn(around_, at);
    return {there.ln, perVoxel_ * there.slope};
}

// Linear along each axis.
Medium::Impedance Medium::impedanceIn(const Layer& layer, glm::vec3 v) noexcept
{
    const glm::ivec3 n(v);
    const glm::vec3 t = v - glm::vec3(n);
    const std::int16_t* q = &layer.lnZ[layer.offset(n)];
    const auto y = static_cast<std::size_t>(layer.size.x), z = y * static_cast<std::size_t>(layer.size.y);
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

void Medium::dig(Layer& layer, const channel::Hole& hole, double radius, glm::ivec3& low, glm::ivec3& high)
{
    const auto voxel = [&](const std::array<float, 3>& p) {
        return glm::vec3((glm::dvec3(vec3(p)) - layer.origin) / layer.spacing);
    };
    const glm::vec3 from = voxel(hole.from), way = voxel(hole.to) - from;
    // At least a voxel wide, or a coarse grid would lose it.
    const auto r = static_cast<float>(std::max(radius / layer.spacing, 0.75));
    const float square = glm::dot(way, way);
    if (!(square > 0))
        return;
    const glm::ivec3 first = glm::max(glm::ivec3(glm::floor(glm::min(from, from + way) - r)), glm::ivec3(0));
    const glm::ivec3 last = glm::min(glm::ivec3(glm::ceil(glm::max(from, from + way) + r)), layer.size - 1);
    for (int k = first.z; k <= last.z; ++k)
        for (int j = first.y; j <= last.y; ++j)
            for (int i = first.x; i <= last.x; ++i) {
                const glm::vec3 d = glm::vec3(i, j, k) - from;
                const float along = glm::dot(d, way) / square;
                const glm::vec3 off = d - along * way;
                std::uint8_t& label = layer.labels[layer.offset({i, j, k})];
                const bool tissue = (label & channel::rowBits) != 0 && (label & holeBit) == 0;
                if (!tissue || along < 0 || along > 1 || glm::dot(off, off) > r * r)
                    continue;
                layer.saved.push_back({layer.offset({i, j, k}), label});
                label = static_cast<std::uint8_t>((label & channel::rowBits) | holeBit);
            }
    low = glm::min(low, first);
    high = glm::max(high, last + 1);
}

void Medium::punch(Layer& layer, double radius) const
{
    glm::ivec3 low = layer.size, high(0);
    while (!layer.saved.empty()) {
        const Saved& s = layer.saved.back();
        layer.labels[s.at] = s.label;
        const glm::ivec3 n = base::cellOf(layer.size, s.at);
        low = glm::min(low, n);
        high = glm::max(high, n + 1);
        layer.saved.pop_back();
    }
    for (const channel::Hole& hole : holes_)
        dig(layer, hole, radius, low, high);
    finish(layer, low, high);
}

bool Medium::punch(std::span<const channel::Hole> holes, double radius)
{
    if (std::ranges::equal(holes, holes_, [](const auto& a, const auto& b) { return a.from == b.from && a.to == b.to; }))
        return false;
    holes_.assign(holes.begin(), holes.end());
    punch(layer_, radius);
    if (!around_.labels.empty())
        punch(around_, radius);
    return true;
}

}  // namespace palpate::ultrasound
