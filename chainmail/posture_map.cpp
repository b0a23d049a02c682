#include <chainmail/posture_map.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

namespace palpate::chainmail {

namespace {

using volume::LabelImage;
using volume::Tissue;
using Corners = std::array<Vec3, 8>;

constexpr double insideBy = 1e-9;  // of a cell: faces belong to both their cells
constexpr int airAround = 4;       // voxels of air around tissue, so that nobody takes its surface for a cut

double weightOf(int corner, Vec3 at) noexcept
{
    return ((corner & 1) != 0 ? at.x : 1.0 - at.x) * ((corner & 2) != 0 ? at.y : 1.0 - at.y) *
           ((corner & 4) != 0 ? at.z : 1.0 - at.z);
}

Vec3 blended(const Corners& corners, Vec3 at) noexcept
{
    Vec3 sum(0.0);
    for (int c = 0; c < 8; ++c) {
        sum += weightOf(c, at) * corners[static_cast<std::size_t>(c)];
    }
    return sum;
}

// Columns: what the place changes by along x, y and z of the cell.
Mat3 slopes(const Vec3* corners, Vec3 at) noexcept
{
    Mat3 out(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        for (int c = 0; c < 8; ++c) {
            Vec3 side = at;
            side[axis] = (c >> axis & 1) != 0 ? 1.0 : 0.0;
            out[axis] += ((c >> axis & 1) != 0 ? 1.0 : -1.0) * weightOf(c, side) * corners[c];
        }
    }
    return out;
}

Corners cornersOf(const volume::NodeGrid& nodes, const std::vector<Vec3>& places, Index3 cell)
{
    Corners out;
    for (int c = 0; c < 8; ++c) {
        out[static_cast<std::size_t>(c)] = places[nodes.offset(cell + Index3(c & 1, c >> 1 & 1, c >> 2))];
    }
    return out;
}

volume::Box boxOf(const Corners& corners) noexcept
{
    volume::Box box{corners[0], corners[0]};
    for (const Vec3& p : corners) {
        box = {glm::min(box.low, p), glm::max(box.high, p)};
    }
    return box;
}

// Cells that carry tissue, those that are full of it first, with the voxels that they may reach.
struct Carrier {
    Index3 cell{0};
    Index3 low{0}, high{0};  // voxels, both included
};

// Voxels, both ends included.
struct Extent {
    Index3 low{0}, high{0};
};

class Drawing {
public:
    Drawing(const Tissue& tissue, const PostureMap& map)
        : map_(map), from_(tissue.labels()), toIndex_(glm::inverse(from_.affine.linear))
    {
        const auto& g = map.nodes;
        Vec3 low(0.0), high(Vec3(from_.size - 1));
        volume::forEachIndex(Index3(0), g.size - 2, [&](Index3 c) {
            if (map.filled[g.offset(c)] == 2) {
                for (const Vec3& p : cornersOf(g, map.now, c)) {
                    const bool beyond =
                        glm::any(glm::lessThan(index(p), low)) || glm::any(glm::greaterThan(index(p), high));
                    low = beyond ? glm::min(low, index(p)) : low;
                    high = beyond ? glm::max(high, index(p)) : high;
                }
            }
        });
        shift_ = Index3(glm::ceil(-low - 1e-6)) + airAround;
        image_.size = shift_ + glm::max(Index3(glm::ceil(high - 1e-6)) + 1, from_.size) + airAround;
        image_.affine = {from_.affine.linear, from_.affine.toPatient(-Vec3(shift_))};
        image_.values.assign(image_.offset({0, 0, image_.size.z}), 0);
        source_.assign(image_.values.size(), Vec3f(std::numeric_limits<float>::quiet_NaN()));
        findCarriers();
    }

    /// @param solid  by label, not 0 for tissue (65536 x 1)
    void run(const std::vector<std::uint8_t>& solid)
    {
        tbb::parallel_for(tbb::blocked_range<int>(0, image_.size.z, 4), [&](const tbb::blocked_range<int>& slices) {
            for (const Carrier& carrier : carriers_) {
                drawCell(carrier, slices.begin(), slices.end() - 1);
            }
        });
        crop(solid);
    }

    // A structure of few voxels may fall between the new ones.
    void keepSmall(std::span<const volume::Structure> structures)
    {
        std::vector<std::uint64_t> count(65536, 0);
        for (const std::uint16_t v : image_.values) {
            ++count[v];
        }
        for (const volume::Structure& s : structures) {
            const auto at = std::find(from_.values.begin(), from_.values.end(), s.value);
            if (s.value == 0 || count[s.value] > 0 || at == from_.values.end()) {
                continue;
            }
            const auto n = static_cast<std::size_t>(at - from_.values.begin());
            const auto plane = from_.offset({0, 0, 1});
            const auto row = static_cast<std::size_t>(from_.size.x);
            const Index3 voxel(n % row, n % plane / row, n / plane);
            const Vec3 place = from_.affine.toPatient(Vec3(voxel));
            const Index3 to(glm::floor(index(map_.moved(place).value_or(place)) + Vec3(shift_) + 0.5));
            image_.values[image_.offset(glm::clamp(to, Index3(0), image_.size - 1))] = s.value;
        }
    }

    const LabelImage& image() const noexcept { return image_; }

    // The image beside the labels, where each voxel's tissue comes from; air has air's value.
    std::vector<float> drawn(const std::vector<float>& values, float outside) const
    {
        std::vector<float> out(source_.size(), outside);
        tbb::parallel_for(std::size_t{0}, source_.size(), [&](std::size_t i) {
            if (!std::isnan(source_[i].x)) {
                out[i] = trilinear(values, Vec3(source_[i]));
            }
        });
        return out;
    }

private:
    // Takes away the layers around the volume's voxels that no tissue came to. Where it comes to the border for the first
    // time, air is left beyond it: tissue at the border is a cut.
    void crop(const std::vector<std::uint8_t>& solid)
    {
        Extent keep{shift_, shift_ + from_.size - 1};
        const Extent before = extentOf(from_, solid), after = extentOf(image_, solid);
        for (int axis = 0; axis < 3 && after.high.x >= 0; ++axis) {
            if (after.low[axis] < keep.low[axis] + airAround && before.low[axis] + shift_[axis] > after.low[axis]) {
                keep.low[axis] = std::max(0, std::min(keep.low[axis], after.low[axis] - airAround));
            }
            if (after.high[axis] > keep.high[axis] - airAround && before.high[axis] + shift_[axis] < after.high[axis]) {
                keep.high[axis] = std::min(image_.size[axis] - 1, std::max(keep.high[axis], after.high[axis] + airAround));
            }
        }
        LabelImage kept{keep.high - keep.low + 1, {image_.affine.linear, image_.affine.toPatient(Vec3(keep.low))}, {}};
        std::vector<Vec3f> source;
        kept.values.reserve(kept.offset({0, 0, kept.size.z}));
        source.reserve(kept.values.capacity());
        volume::forEachIndex(keep.low, keep.high, [&](Index3 n) {
            kept.values.push_back(image_.values[image_.offset(n)]);
            source.push_back(source_[image_.offset(n)]);
        });
        image_ = std::move(kept);
        source_ = std::move(source);
        shift_ -= keep.low;
    }

    static Extent extentOf(const LabelImage& image, const std::vector<std::uint8_t>& solid)
    {
        Extent box{image.size, Index3(-1)};
        volume::forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
            if (solid[image.values[image.offset(n)]] != 0) {
                box = {glm::min(box.low, n), glm::max(box.high, n)};
            }
        });
        return box;
    }

    Vec3 index(Vec3 place) const noexcept { return toIndex_ * (place - from_.affine.origin); }  // in voxels of the volume

    void findCarriers()
    {
        const auto& g = map_.nodes;
        for (const std::uint8_t wanted : {std::uint8_t{2}, std::uint8_t{1}}) {
            volume::forEachIndex(Index3(0), g.size - 2, [&](Index3 c) {
                if (map_.filled[g.offset(c)] != wanted) {
                    return;
                }
                Corners corners = cornersOf(g, map_.now, c);
                for (Vec3& p : corners) {
                    p = index(p) + Vec3(shift_);
                }
                const volume::Box box = boxOf(corners);
                const Index3 low = glm::max(Index3(glm::ceil(box.low - 1e-6)), Index3(0));
                const Index3 high = glm::min(Index3(glm::floor(box.high + 1e-6)), image_.size - 1);
                if (!glm::any(glm::greaterThan(low, high))) {
                    carriers_.push_back({c, low, high});
                }
            });
        }
    }

    // A voxel that a cell before has already drawn stays: where cells fold over each other, the first wins.
    void drawCell(const Carrier& carrier, int first, int last)
    {
        const Index3 low(carrier.low.x, carrier.low.y, std::max(carrier.low.z, first));
        const Index3 high(carrier.high.x, carrier.high.y, std::min(carrier.high.z, last));
        if (low.z > high.z) {
            return;
        }
        const Corners now = cornersOf(map_.nodes, map_.now, carrier.cell);
        const Corners taken = cornersOf(map_.nodes, map_.taken, carrier.cell);
        volume::forEachIndex(low, high, [&](Index3 n) {
            const std::size_t at = image_.offset(n);
            if (!std::isnan(source_[at].x)) {
                return;
            }
            if (const auto inside = placeInCell(now.data(), image_.affine.toPatient(Vec3(n)))) {
                const Vec3 from = index(blended(taken, *inside));
                const Index3 voxel(glm::floor(from + 0.5));
                if (glm::all(glm::greaterThanEqual(voxel, Index3(0))) && glm::all(glm::lessThan(voxel, from_.size))) {
                    source_[at] = Vec3f(from);
                    image_.values[at] = from_.values[from_.offset(voxel)];
                }
            }
        });
    }

    float trilinear(const std::vector<float>& values, Vec3 at) const
    {
        const Vec3 last(from_.size - 1);
        const Vec3 inside = glm::clamp(at, Vec3(0.0), last);
        const Vec3 low = glm::min(glm::floor(inside), glm::max(last - 1.0, Vec3(0.0)));
        double sum = 0.0;
        for (int c = 0; c < 8; ++c) {
            const double weight = weightOf(c, inside - low);
            if (weight > 0.0) {
                sum += weight * static_cast<double>(values[from_.offset(Index3(low) + Index3(c & 1, c >> 1 & 1, c >> 2))]);
            }
        }
        return static_cast<float>(sum);
    }

    const PostureMap& map_;
    LabelImage from_;
    Mat3 toIndex_;
    Index3 shift_{0};  // of the volume's voxel (0, 0, 0) in the new image
    LabelImage image_;
    std::vector<Vec3f> source_;  // where a voxel's tissue comes from, in voxels of the volume; not a number: nowhere
    std::vector<Carrier> carriers_;
};

}  // namespace

std::optional<Vec3> placeInCell(const Vec3* corners, Vec3 place) noexcept
{
    constexpr int maxSteps = 12;
    constexpr double far = 3.0;  // cells from the middle: it cannot come back
    Vec3 at(0.5);
    for (int i = 0; i < maxSteps; ++i) {
        Vec3 off = place;
        for (int c = 0; c < 8; ++c) {
            off -= weightOf(c, at) * corners[c];
        }
        const Mat3 slope = slopes(corners, at);
        const double volume = glm::determinant(slope);
        if (volume == 0.0) {
            return std::nullopt;
        }
        const Vec3 step = glm::inverse(slope) * off;
        at += step;
        if (!(glm::length(at - 0.5) < far)) {
            return std::nullopt;
        }
        if (glm::length(step) < 1e-10) {
            const bool inside = glm::all(glm::greaterThanEqual(at, Vec3(-insideBy))) &&
                                glm::all(glm::lessThanEqual(at, Vec3(1.0 + insideBy)));
            return inside ? std::optional(at) : std::nullopt;
        }
    }
    return std::nullopt;
}

std::optional<Vec3> PostureMap::moved(Vec3 place) const
{
    std::optional<Vec3> out;
    double nearest = nodes.spacing;
    std::size_t node = 0;
    for (const std::uint8_t wanted : {std::uint8_t{2}, std::uint8_t{1}}) {
        volume::forEachIndex(Index3(0), nodes.size - 2, [&](Index3 c) {
            if (out || filled[nodes.offset(c)] != wanted) {
                return;
            }
            const Corners corners = cornersOf(nodes, taken, c);
            const volume::Box box = boxOf(corners);
            if (glm::any(glm::lessThan(place, box.low - nodes.spacing)) ||
                glm::any(glm::greaterThan(place, box.high + nodes.spacing))) {
                return;
            }
            if (const auto at = placeInCell(corners.data(), place)) {
                out = blended(cornersOf(nodes, now, c), *at);
                return;
            }
            volume::forEachIndex(c, c + 1, [&](Index3 n) {
                if (const double away = glm::length(taken[nodes.offset(n)] - place); away < nearest) {
                    nearest = away;
                    node = nodes.offset(n);
                }
            });
        });
    }
    return out || nearest >= nodes.spacing ? out : std::optional(place + now[node] - taken[node]);
}

Tissue inPosture(const Tissue& tissue, const PostureMap& map, const std::string& note)
{
    Drawing drawing(tissue, map);
    std::vector<std::uint8_t> solid(65536, 0);
    for (const volume::Structure& s : tissue.structures()) {
        solid[s.value] = tissue.table().rows[s.tissue].role != volume::Role::air ? 1 : 0;
    }
    drawing.run(solid);
    drawing.keepSmall(tissue.structures());
    std::vector<volume::LabelName> names;
    for (const volume::Structure& s : tissue.structures()) {
        names.push_back({s.value, s.name, tissue.table().rows[s.tissue].name, s.colour, s.terminology});
    }
    auto provenance = tissue.provenance();
    provenance.emplace_back("gravity", note);
    auto companion = tissue.companion();
    if (companion) {
        const float air = companion->unit == "HU" ? -1000.0F : 0.0F;
        companion->values = drawing.drawn(companion->values, air);
    }
    return Tissue::fromLabels(drawing.image(), tissue.table(), names, std::move(provenance),
                              companion ? &*companion : nullptr);
}

}  // namespace palpate::chainmail
