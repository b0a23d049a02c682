#include <channel/deformation.h>

#include <base/cells.h>
#include <channel/lanes.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>

namespace palpate::channel {
namespace {

glm::dvec3 position(const Grid& grid, glm::ivec3 n) noexcept
{
    return vec(grid.origin) + grid.spacing * glm::dvec3(n);
}

// Quadratic B-spline of a node `d` spacings away, |d| < 3/2.
double spline(double d) noexcept
{
    d = std::abs(d);
    return d < 0.5 ? 0.75 - d * d : 0.5 * (1.5 - d) * (1.5 - d);
}

}  // namespace

VoxelBox enclosing(const VoxelBox& a, const VoxelBox& b) noexcept
{
    if (a.empty())
        return b;
    if (b.empty())
        return a;
    return {glm::min(a.low, b.low), glm::max(a.high, b.high)};
}

Deformation::Deformation(const Scenery& scenery, std::span<const std::uint8_t> labels)
    : labelGrid_(scenery.labels),
      lattice_(scenery.lattice),
      labels_(labels.begin(), labels.end()),
      inverse_(sizeOf(lattice_), static_cast<float>(1 / lattice_.spacing))
{
    markPure();
    u_.resize(base::countOf(glm::max(sizeOf(lattice_), 0)), glm::vec4(0));
    visited_.resize(u_.size(), 0);
    layerAir();
}

// Axis after axis: of three cells that are the same within themselves and to each other.
void Deformation::markPure()
{
    constexpr std::uint8_t compared = rowBits | pureBit;
    for (std::uint8_t& label : labels_)
        label = static_cast<std::uint8_t>((label & ~compared) | (label & rowBits) | pureBit);
    std::vector<std::uint8_t> before;
    std::size_t stride = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        before = labels_;
        for (std::size_t i = stride; i + stride < labels_.size(); ++i)
            if ((((before[i] ^ before[i - stride]) | (before[i] ^ before[i + stride])) & compared) != 0)
                labels_[i] &= static_cast<std::uint8_t>(~pureBit);
        stride *= static_cast<std::size_t>(labelGrid_.size[axis]);
    }
}

// Layer after layer: the air nodes next to a node of the body, the air next to them, ..
void Deformation::layerAir()
{
    const int row = lattice_.size[0], layer = row * lattice_.size[1];
    for (int k = 0; k < neighbours; ++k)
        around_[static_cast<std::size_t>(k)] = (k / 9 - 1) * layer + (k / 3 % 3 - 1) * row + k % 3 - 1;
    inward_.resize(u_.size(), 0);
    outward_.resize(u_.size(), 0);
    std::vector<std::uint8_t> layers(u_.size(), 0);  // 0 = body, from 1 on air, unknown = not reached yet
    constexpr std::uint8_t unknown = 0xff;
    std::vector<std::uint32_t> last, next;
    for (std::uint32_t i = 0; i < u_.size(); ++i) {
        const bool air = restTissue(position(lattice_, base::cellOf(sizeOf(lattice_), i))) == 0;
        layers[i] = air ? unknown : 0;
        if (!air)
            last.push_back(i);
    }
    std::uint8_t depth = 1;
    const auto reach = [&](std::uint32_t from, int k) {
        if (!base::holds(sizeOf(lattice_), base::cellOf(sizeOf(lattice_), from) + glm::ivec3(k % 3, k / 3 % 3, k / 9) - 1))
            return;
        const std::uint32_t at = neighbour(from, static_cast<std::size_t>(k));
        if (layers[at] == unknown) {
            layers[at] = depth;
            next.push_back(at);
        }
        if (layers[at] == depth) {
            outward_[from] |= 1U << k;
            inward_[at] |= 1U << (neighbours - 1 - k);
        }
    };
    for (; depth <= airLayers; ++depth, last.swap(next)) {
        next.clear();
        for (const std::uint32_t from : last)
            for (int k = 0; k < neighbours; ++k)
                reach(from, k);
    }
}

std::uint32_t Deformation::neighbour(std::uint32_t node, std::size_t k) const noexcept
{
    return node + static_cast<std::uint32_t>(around_[k]);
}

VoxelBox Deformation::apply(const Displaced& displaced)
{
    for (const std::uint32_t n : moved_)
        u_[n] = glm::vec4(0);
    moved_.clear();
    ++pass_;
    float largest = 0;
    const std::size_t count = std::min<std::size_t>(displaced.count, maxDisplaced);
    for (std::size_t i = 0; i < count; ++i) {
        const Displacement& d = displaced.nodes[i];
        const glm::vec3 u(d.u[0], d.u[1], d.u[2]);
        const float square = glm::dot(u, u);
        if (d.node >= u_.size() || !(square > 0) || !std::isfinite(square) || visited_[d.node] == pass_)
            continue;
        u_[d.node] = glm::vec4(u, 1);
        visited_[d.node] = pass_;
        moved_.push_back(d.node);
        largest = std::max(largest, square);
    }
    largest_ = std::sqrt(largest);
    carryAir();
    inverse_.update(u_, moved_);
    const VoxelBox now = boxOfMoved();
    const VoxelBox changed = enclosing(last_, now);
    last_ = now;
    return changed;
}

// The surface lies between nodes of the body, which move, and nodes of the air, which nobody moves. Without this it would
// lag behind by up to a spacing, and deep dimples would fold. So the air goes along, and less from layer to layer.
void Deformation::carryAir()
{
    constexpr int whole = 2;
    constexpr float step = 0.6F;  // [lattice spacings per layer]; under 1, so that nothing folds
    std::size_t begin = 0;
    visible_ = moved_.size();
    for (int layer = 0; layer < airLayers && begin < moved_.size(); ++layer) {
        const std::size_t end = moved_.size();
        reachAir(std::span(moved_).subspan(begin));
        for (const std::uint32_t at : frontier_) {
            const glm::vec3 mean = meanInside(at);
            const float length = glm::length(mean), less = step * static_cast<float>(lattice_.spacing);
            const glm::vec3 carried = layer < whole ? mean : length > less ? mean * (1 - less / length) : glm::vec3(0);
            if (carried == glm::vec3(0))
                continue;
            u_[at] = glm::vec4(carried, 1);
            moved_.push_back(at);
        }
        if (layer < whole)
            visible_ = moved_.size();
        begin = end;
    }
}

// The air nodes of the next layer.
void Deformation::reachAir(std::span<const std::uint32_t> from)
{
    frontier_.clear();
    for (const std::uint32_t node : from)
        for (std::uint32_t left = outward_[node]; left != 0; left &= left - 1) {
            const std::uint32_t at = neighbour(node, static_cast<std::size_t>(std::countr_zero(left)));
            if (visited_[at] != pass_) {
                visited_[at] = pass_;
                frontier_.push_back(at);
            }
        }
}

// Of the neighbours one layer further in, as far as they have moved.
glm::vec3 Deformation::meanInside(std::uint32_t node) const noexcept
{
    Lanes sum{};
    for (std::uint32_t left = inward_[node]; left != 0; left &= left - 1)
        sum += lanes(u_[neighbour(node, static_cast<std::size_t>(std::countr_zero(left)))]);
    return glm::vec3(sum[0], sum[1], sum[2]) / std::max(sum[3], 1.0F);
}

VoxelBox Deformation::boxOfMoved() const
{
    if (moved_.empty())
        return {};
    glm::ivec3 low = sizeOf(lattice_), high(-1);
    const auto row = static_cast<std::uint32_t>(lattice_.size[0]);
    glm::ivec3 first(0);  // of the row that the last node was in
    std::uint32_t begin = ~row;
    for (std::size_t m = 0; m < visible_; ++m) {
        if (moved_[m] - begin >= row) {
            begin = moved_[m] - moved_[m] % row;
            first = base::cellOf(sizeOf(lattice_), begin);
            low = glm::min(low, glm::ivec3(low.x, first.y, first.z));
            high = glm::max(high, first);
        }
        const int x = static_cast<int>(moved_[m] - begin);
        low.x = std::min(low.x, x);
        high.x = std::max(high.x, x);
    }
    // A node reaches one spacing into its cells, and what it moves lands up to |u| further away.
    const glm::dvec3 reach(lattice_.spacing + largest_ + labelGrid_.spacing);
    const glm::dvec3 from = (position(lattice_, low) - reach - vec(labelGrid_.origin)) / labelGrid_.spacing;
    const glm::dvec3 to = (position(lattice_, high) + reach - vec(labelGrid_.origin)) / labelGrid_.spacing;
    return {glm::clamp(glm::ivec3(glm::floor(from)), glm::ivec3(0), sizeOf(labelGrid_)),
            glm::clamp(glm::ivec3(glm::ceil(to)) + 1, glm::ivec3(0), sizeOf(labelGrid_))};
}

glm::dvec3 Deformation::rest(glm::dvec3 x, glm::vec3& shift) const noexcept
{
    inverse_.follow(glm::vec3((x - vec(lattice_.origin)) / lattice_.spacing), shift);
    return shift == glm::vec3(0) ? x : x + lattice_.spacing * glm::dvec3(shift);
}

glm::vec3 Deformation::displacement(glm::vec3 g) const noexcept
{
    return static_cast<float>(lattice_.spacing) * inverse_.displacement(g);
}

glm::dvec3 Deformation::seen(glm::dvec3 p) const noexcept
{
    return p +
           lattice_.spacing * glm::dvec3(inverse_.displacement(glm::vec3((p - vec(lattice_.origin)) / lattice_.spacing)));
}

std::uint8_t Deformation::restTissue(glm::dvec3 p) const noexcept
{
    const glm::dvec3 g = (p - vec(labelGrid_.origin)) / labelGrid_.spacing, nearest = glm::floor(g + 0.5);
    const glm::dvec3 last = glm::dvec3(sizeOf(labelGrid_)) - 1.0;
    if (!(nearest.x >= 1 && nearest.y >= 1 && nearest.z >= 1 && nearest.x < last.x && nearest.y < last.y &&
          nearest.z < last.z))
        return 0;
    const glm::ivec3 middle(nearest);
    const std::uint8_t label = labels_[base::offsetOf(sizeOf(labelGrid_), middle)];
    if ((label & pureBit) != 0)
        return label & rowBits;
    std::array<std::array<float, 3>, 3> along{};
    for (int axis = 0; axis < 3; ++axis)
        for (int step = 0; step < 3; ++step)
            along[static_cast<std::size_t>(axis)][static_cast<std::size_t>(step)] =
                static_cast<float>(spline(g[axis] - nearest[axis] - (step - 1)));
    std::array<std::uint8_t, neighbours> tissues{};  // that there are, and their weights
    std::array<float, neighbours> sums{};
    std::size_t known = 0;
    const auto row = static_cast<std::size_t>(labelGrid_.size[0]),
               layer = row * static_cast<std::size_t>(labelGrid_.size[1]);
    const std::uint8_t* corner = &labels_[base::offsetOf(sizeOf(labelGrid_), middle - 1)];
    for (std::size_t z = 0; z < 3; ++z)
        for (std::size_t y = 0; y < 3; ++y)
            for (std::size_t x = 0; x < 3; ++x) {
                const std::uint8_t tissue = corner[z * layer + y * row + x] & rowBits;
                std::size_t n = 0;
                while (n < known && tissues[n] != tissue)
                    ++n;
                known = std::max(known, n + 1);
                tissues[n] = tissue;
                sums[n] += along[0][x] * along[1][y] * along[2][z];
            }
    const auto best = std::max_element(sums.begin(), sums.begin() + static_cast<std::ptrdiff_t>(known));
    return tissues[static_cast<std::size_t>(best - sums.begin())];
}

std::uint8_t Deformation::restLabel(glm::dvec3 p) const noexcept
{
    const glm::ivec3 nearest(glm::floor((p - vec(labelGrid_.origin)) / labelGrid_.spacing + 0.5));
    const std::uint8_t tissue = restTissue(p);
    if (tissue == 0 || !base::holds(sizeOf(labelGrid_), nearest))
        return tissue;
    return tissue | (labels_[base::offsetOf(sizeOf(labelGrid_), nearest)] & shellBit);
}

}  // namespace palpate::channel
