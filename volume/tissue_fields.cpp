#include <volume/cell_mixture.h>
#include <volume/distance.h>
#include <volume/tissue.h>
#include <volume/tissue_impl.h>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <type_traits>

namespace palpate::volume {

namespace {

constexpr double coarse = 2.0;  // edge of a voxel, in cells, from which on samples are tissue or not

// Reads the voxels that fill a node's cell, by s^3 samples of the cell. Along voxel axes that are about as coarse as the
// samples it interpolates: the nearest voxel alone would shift everything by up to half a voxel where samples fall on the
// faces between voxels.
class CellSampler {
public:
    // `forMaterial`: for visitMaterial(), which samples cells far smaller than the voxels more finely.
    CellSampler(const TissueData& tissue, const NodeGrid& grid, bool forMaterial)
        : size_(tissue.size),
          label_(tissue.label->getConstUnsafeAccessor()),
          stiffness_(tissue.stiffness->getConstUnsafeAccessor()),
          scaledBy_(tissue.stiffnessMap.points.empty() ? nullptr : &tissue)
    {
        const Mat3 toIndex = glm::inverse(tissue.affine.linear);
        const Vec3 voxel = tissue.affine.spacing();
        const double finest = std::min({voxel.x, voxel.y, voxel.z});
        isCoarse_ = forMaterial && std::max({voxel.x, voxel.y, voxel.z}) > coarse * grid.spacing;
        const int s = std::clamp(static_cast<int>(std::ceil(grid.spacing / finest - 1e-6)), isCoarse_ ? 3 : 1, 4);
        for (int i = 0; i < s * s * s; ++i) {
            const Vec3 at = (Vec3(i % s, i / s % s, i / s / s) + 0.5) / static_cast<double>(s) - 0.5;
            places_.push_back(2.0 * at);
            offsets_.push_back(toIndex * (at * grid.spacing));
        }
        step_ = toIndex * grid.spacing;
        start_ = toIndex * (grid.origin - tissue.affine.origin);
        for (int k = 0; k < 3; ++k) {
            interpolate_[k] = voxel[k] > 0.8 * grid.spacing / s;
        }
    }

    std::size_t samples() const { return offsets_.size(); }

    // Calls visit(label, weight), or visit(label, weight, voxel), for the voxels at node n; the weights add up to 1, less
    // what lies outside the volume. Or visit(label, weight, voxel, place), with the sample's place in the cell, -1 to 1.
    template <typename Visit>
    void visit(Index3 n, const Visit& visit) const
    {
        const Vec3 centre = start_ + step_ * Vec3(n);
        const double fraction = 1.0 / static_cast<double>(offsets_.size());
        for (std::size_t i = 0; i < offsets_.size(); ++i) {
            const Vec3 at = centre + offsets_[i];
            if (glm::any(interpolate_)) {
                visitAround(at, fraction, places_[i], visit);
            } else {
                read(Index3(glm::floor(at + 0.5)), fraction, places_[i], visit);
            }
        }
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
        const Vec3 centre = start_ + step_ * Vec3(n);
        const double fraction = 1.0 / static_cast<double>(offsets_.size());
        for (std::size_t i = 0; i < offsets_.size(); ++i) {
            double tissue = 0.0;
            visitAround(centre + offsets_[i], 1.0, places_[i],
                        [&](std::uint16_t label, double weight) { tissue += isTissue(label) ? weight : 0.0; });
            if (tissue >= 0.5) {
                visitAround(centre + offsets_[i], fraction / tissue, places_[i], visit);
            }
        }
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
    void visitAround(Vec3 at, double fraction, Vec3 place, const Visit& visit) const
    {
        const Vec3 low = glm::mix(glm::floor(at + 0.5), glm::floor(at), Vec3(interpolate_));
        const Vec3 t = (at - low) * Vec3(interpolate_);
        for (int corner = 0; corner < 8; ++corner) {
            const Index3 step(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
            const Vec3 w = glm::mix(1.0 - t, t, Vec3(step));
            const double weight = w.x * w.y * w.z;
            if (weight > 0) {
                read(Index3(low) + step, fraction * weight, place, visit);
            }
        }
    }

    template <typename Visit>
    void read(Index3 n, double weight, Vec3 place, const Visit& visit) const
    {
        if (n.x >= 0 && n.y >= 0 && n.z >= 0 && n.x < size_.x && n.y < size_.y && n.z < size_.z) {
            const openvdb::Coord ijk(n.x, n.y, n.z);
            const auto label = static_cast<std::uint16_t>(label_.getValue(ijk));
            if constexpr (std::is_invocable_v<Visit, std::uint16_t, double, const openvdb::Coord&, Vec3>) {
                visit(label, weight, ijk, place);
            } else if constexpr (std::is_invocable_v<Visit, std::uint16_t, double, const openvdb::Coord&>) {
                visit(label, weight, ijk);
            } else {
                visit(label, weight);
            }
        }
    }

    Index3 size_;
    openvdb::Int32Grid::ConstUnsafeAccessor label_;
    openvdb::FloatGrid::ConstUnsafeAccessor stiffness_;
    const TissueData* scaledBy_;  // null where no image scales the stiffness
    std::vector<Vec3> offsets_;   // samples of a cell, in voxels from the node
    std::vector<Vec3> places_;    // the same, -1 to 1 along each edge of the cell
    Mat3 step_{1.0};              // node steps in voxels
    Vec3 start_{0.0};             // node (0, 0, 0) in voxels
    glm::bvec3 interpolate_{false};
    bool isCoarse_ = false;  // voxels, beside the cells
};

// Nodes, both ends included.
using NodeRange = IndexBox;

// Calls visit(sampler, row of nodes) for rows along x of the range, on all cores with a sampler each.
template <typename Visit>
void forEachRow(const TissueData& tissue, const NodeGrid& grid, const NodeRange& range, const Visit& visit,
                bool forMaterial = false)
{
    if (range.empty()) {
        return;
    }
    tbb::parallel_for(tbb::blocked_range<int>(range.low.z, range.high.z + 1), [&](const tbb::blocked_range<int>& slices) {
        const CellSampler sampler(tissue, grid, forMaterial);
        for (int z = slices.begin(); z != slices.end(); ++z) {
            for (int y = range.low.y; y <= range.high.y; ++y) {
                visit(sampler, Index3(range.low.x, y, z));
            }
        }
    });
}

CellMaterial cellMaterial(const TissueData& tissue, const CellSampler& sampler, Index3 n,
                          const std::vector<const TissueRow*>& rows)
{
    CellMixture mixture;
    const auto isTissue = [&](std::uint16_t label) { return rows[label] != nullptr; };
    sampler.visitMaterial(n, isTissue, [&](std::uint16_t label, double weight, const openvdb::Coord& voxel, Vec3 at) {
        if (const TissueRow* row = rows[label]) {
            const Vec3 place = tissue.affine.toPatient({voxel.x(), voxel.y(), voxel.z()});
            const bool held = row->fixed || (tissue.support && tissue.support->height(place) < 0.0);
            mixture.add(*row, weight, sampler.factor(label, voxel), held, at);
        }
    });
    return mixture.material();
}

NodeRange grown(const NodeRange& range, const NodeGrid& grid, Index3 by)
{
    return {glm::max(range.low - by, Index3(0)), glm::min(range.high + by, grid.size - 1)};
}

// The nodes whose cell may hold one of the voxels of `extent`.
NodeRange nodesAround(const TissueData& tissue, const NodeGrid& grid, const IndexBox& extent)
{
    const Box box = patientBox(tissue.affine, extent);
    const Vec3 voxel = tissue.affine.spacing();
    const double reach = std::max({voxel.x, voxel.y, voxel.z}) + grid.spacing;
    const Vec3 last(grid.size);
    const Vec3 low = glm::clamp(glm::floor((box.low - reach - grid.origin) / grid.spacing), Vec3(-1.0), last);
    const Vec3 high = glm::clamp(glm::ceil((box.high + reach - grid.origin) / grid.spacing), Vec3(-1.0), last);
    return grown({Index3(low), Index3(high)}, grid, Index3(0));
}

// Fraction of each node's cell that is filled by marked labels (nodes x 1).
std::vector<float> fractionOf(const TissueData& tissue, const NodeGrid& grid, const NodeRange& range,
                              const std::vector<std::uint8_t>& wanted)
{
    std::vector<float> fraction(grid.count(), 0.0F);
    forEachRow(tissue, grid, range, [&](const CellSampler& sampler, Index3 n) {
        for (; n.x <= range.high.x; ++n.x) {
            double sum = 0;
            sampler.visit(n, [&](std::uint16_t label, double weight) { sum += wanted[label] != 0 ? weight : 0.0; });
            fraction[grid.offset(n)] = static_cast<float>(sum);
        }
    });
    return fraction;
}

// Binomial smoothing [1 2 1]/4 of one line, `passes` times; nodes beyond its ends repeat the end.
void smoothLine(float* first, std::size_t stride, int count, int passes, std::vector<float>& line)
{
    line.resize(static_cast<std::size_t>(count));
    for (int pass = 0; pass < passes; ++pass) {
        for (std::size_t k = 0; k < line.size(); ++k) {
            line[k] = first[k * stride];
        }
        for (std::size_t k = 0; k < line.size(); ++k) {
            const float before = line[k == 0 ? 0 : k - 1];
            const float after = line[std::min(k + 1, line.size() - 1)];
            first[k * stride] = 0.25F * (before + after) + 0.5F * line[k];
        }
    }
}

void smoothAxis(std::vector<float>& values, const NodeGrid& grid, const NodeRange& range, int axis, int passes)
{
    const int outer = axis == 2 ? 1 : 2;
    const int inner = axis == 0 ? 1 : 0;
    Index3 step(0);
    step[axis] = 1;
    const std::size_t stride = grid.offset(step);
    tbb::parallel_for(tbb::blocked_range<int>(range.low[outer], range.high[outer] + 1),
                      [&](const tbb::blocked_range<int>& lines) {
                          std::vector<float> line;
                          for (int o = lines.begin(); o != lines.end(); ++o) {
                              for (int i = range.low[inner]; i <= range.high[inner]; ++i) {
                                  Index3 start = range.low;
                                  start[outer] = o;
                                  start[inner] = i;
                                  smoothLine(values.data() + grid.offset(start), stride,
                                             range.high[axis] - range.low[axis] + 1, passes, line);
                              }
                          }
                      });
}

// So many passes along each patient axis that neither the nodes' nor the voxels' steps can be felt: a deviation of about
// 0.7 node spacings or voxels, whichever is more.
Index3 smoothingPasses(const TissueData& tissue, const NodeGrid& grid)
{
    Index3 passes(1);
    for (int axis = 0; axis < 3; ++axis) {
        const Mat3& m = tissue.affine.linear;
        const double voxel = std::max({std::abs(m[0][axis]), std::abs(m[1][axis]), std::abs(m[2][axis])}) / grid.spacing;
        passes[axis] = std::clamp(static_cast<int>(std::lround(voxel * voxel)), 1, 12);
    }
    return passes;
}

bool inside(const Box& box, const Box& of)
{
    return glm::all(glm::greaterThan(box.low, of.low)) && glm::all(glm::lessThan(box.high, of.high));
}

// A structure beside the grid: the distance to its box.
DistanceField distanceToBox(const NodeGrid& grid, const Box& box)
{
    DistanceField field{{grid, std::vector<float>(grid.count())}};
    for (std::size_t i = 0; i < field.values.size(); ++i) {
        const Vec3 p = grid.position(grid.node(i));
        field.values[i] = static_cast<float>(glm::length(p - glm::clamp(p, box.low, box.high)));
    }
    return field;
}

DistanceField distanceToMarked(const TissueData& tissue, const NodeGrid& grid, const std::vector<std::uint8_t>& wanted)
{
    const IndexBox extent = tissue.extentOf(wanted);
    const Box box = patientBox(tissue.affine, extent);
    const NodeRange range = nodesAround(tissue, grid, extent);
    std::vector<float> fraction = fractionOf(tissue, grid, range, wanted);
    if (*std::max_element(fraction.begin(), fraction.end()) <= 0.0F) {
        return distanceToBox(grid, box);
    }
    double volume = integral(grid, fraction);
    if (inside(box, grid.box())) {
        volume = 0;
        for (const Structure& s : tissue.structures) {
            volume += wanted[s.value] != 0 ? s.volume : 0.0;
        }
    }
    const Index3 passes = smoothingPasses(tissue, grid);
    const NodeRange smoothed = grown(range, grid, passes);
    for (int axis = 0; axis < 3; ++axis) {
        smoothAxis(fraction, grid, smoothed, axis, passes[axis]);
    }
    const float iso = isoForVolume(grid, fraction, volume);
    DistanceField field{{grid, signedDistance(grid, fraction, iso)}};
    keepVolume(grid, field.values, volume);
    return field;
}

void checkGrid(const NodeGrid& grid)
{
    if (grid.size.x < 2 || grid.size.y < 2 || grid.size.z < 2 || !(grid.spacing > 0)) {
        throw std::runtime_error(fmt::format("a grid of {} x {} x {} nodes, {} m apart, cannot hold a field", grid.size.x,
                                             grid.size.y, grid.size.z, grid.spacing));
    }
}

// Root of arithmetic times harmonic mean of the modulus over the tissue in a cell [Pa]; 0 without tissue.
double cellModulus(const CellSampler& sampler, Index3 n, const std::vector<double>& modulus)
{
    double weight = 0;
    double sum = 0;
    double inverse = 0;
    sampler.visit(n, [&](std::uint16_t label, double w, const openvdb::Coord& voxel) {
        const double e = modulus[label] * sampler.factor(label, voxel);
        if (e > 0) {
            weight += w;
            sum += w * e;
            inverse += w / e;
        }
    });
    return weight > 0 ? std::sqrt(sum / inverse) : 0.0;
}

// Gives nodes of value 0 the value of the nearest node that has one.
void fillFromNearest(const NodeGrid& grid, std::vector<float>& values)
{
    std::vector<std::int32_t> nearest(values.size(), -1);
    std::vector<SurfacePoint> points;
    std::vector<std::size_t> source;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const Index3 n = grid.node(i);
        const auto empty = [&](Index3 step) { return grid.contains(n + step) && values[grid.offset(n + step)] <= 0.0F; };
        if (values[i] > 0 && (empty({1, 0, 0}) || empty({-1, 0, 0}) || empty({0, 1, 0}) || empty({0, -1, 0}) ||
                              empty({0, 0, 1}) || empty({0, 0, -1}))) {
            nearest[i] = static_cast<std::int32_t>(points.size());
            points.push_back({Vec3f(n), Vec3f(0.0F)});
            source.push_back(i);
        }
    }
    if (points.empty()) {
        return;
    }
    spreadNearest(grid.size, points, nearest);
    const std::vector<float> known = values;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (known[i] <= 0.0F) {
            values[i] = known[source[static_cast<std::size_t>(nearest[i])]];
        }
    }
}

// The row with most weight in a cell, air when less than half of it is tissue.
std::uint8_t cellRow(const CellSampler& sampler, Index3 n, const LabelLookup& lookup)
{
    std::array<std::pair<std::uint8_t, double>, 64> rows;
    std::size_t count = 0;
    double solid = 0;
    sampler.visit(n, [&](std::uint16_t label, double weight) {
        if (lookup.solid[label] == 0) {
            return;
        }
        solid += weight;
        const std::uint8_t row = lookup.row[label];
        std::size_t i = 0;
        while (i < count && rows[i].first != row) {
            ++i;
        }
        if (i == count) {
            rows[count++] = {row, 0.0};
        }
        rows[i].second += weight;
    });
    if (solid < 0.5 - 1e-9) {
        return 0;
    }
    const auto end = rows.begin() + static_cast<std::ptrdiff_t>(count);
    return std::max_element(rows.begin(), end, [](const auto& a, const auto& b) { return a.second < b.second; })->first;
}

}  // namespace

DistanceField Tissue::distanceTo(std::span<const std::uint16_t> labels, const NodeGrid& grid) const
{
    checkGrid(grid);
    std::vector<std::uint8_t> wanted(65536, 0);
    for (const std::uint16_t label : labels) {
        wanted[label] = 1;
    }
    const auto& all = impl_->structures;
    if (std::none_of(all.begin(), all.end(), [&](const Structure& s) { return wanted[s.value] != 0; })) {
        throw std::runtime_error(fmt::format(
            "no voxel has {}", labels.size() == 1 ? fmt::format("label {}", labels[0]) : "one of the labels asked for"));
    }
    return distanceToMarked(*impl_, grid, wanted);
}

DistanceField Tissue::distanceToBody(const NodeGrid& grid) const
{
    checkGrid(grid);
    if (impl_->extentOf(impl_->lookup.solid).empty()) {
        throw std::runtime_error("the volume holds no tissue, only air");
    }
    return distanceToMarked(*impl_, grid, impl_->lookup.solid);
}

ScalarField Tissue::youngsModulusOn(const NodeGrid& grid) const
{
    checkGrid(grid);
    const TissueData& tissue = *impl_;
    std::vector<double> modulus(65536, 0.0);
    for (const Structure& s : tissue.structures) {
        modulus[s.value] = tissue.lookup.solid[s.value] != 0 ? tissue.table.rows[s.tissue].youngsModulus : 0.0;
    }
    ScalarField field{grid, std::vector<float>(grid.count(), 0.0F)};
    const NodeRange range = nodesAround(tissue, grid, tissue.extentOf(tissue.lookup.solid));
    forEachRow(tissue, grid, range, [&](const CellSampler& sampler, Index3 n) {
        for (; n.x <= range.high.x; ++n.x) {
            field.values[grid.offset(n)] = static_cast<float>(cellModulus(sampler, n, modulus));
        }
    });
    fillFromNearest(grid, field.values);
    return field;
}

std::vector<CellMaterial> Tissue::materialOn(const NodeGrid& grid) const
{
    checkGrid(grid);
    const TissueData& tissue = *impl_;
    std::vector<const TissueRow*> rows(65536, nullptr);
    for (const Structure& s : tissue.structures) {
        rows[s.value] = tissue.lookup.solid[s.value] != 0 ? &tissue.table.rows[s.tissue] : nullptr;
    }
    std::vector<CellMaterial> cells(grid.count());
    const NodeRange range = nodesAround(tissue, grid, tissue.extentOf(tissue.lookup.solid));
    forEachRow(
        tissue, grid, range,
        [&](const CellSampler& sampler, Index3 n) {
            for (; n.x <= range.high.x; ++n.x) {
                cells[grid.offset(n)] = cellMaterial(tissue, sampler, n, rows);
            }
        },
        true);
    return cells;
}

std::vector<std::uint8_t> Tissue::tissueOn(const NodeGrid& grid) const
{
    checkGrid(grid);
    const TissueData& tissue = *impl_;
    std::vector<std::uint8_t> rows(grid.count(), 0);
    const NodeRange range = nodesAround(tissue, grid, tissue.extentOf(tissue.lookup.solid));
    forEachRow(tissue, grid, range, [&](const CellSampler& sampler, Index3 n) {
        for (; n.x <= range.high.x; ++n.x) {
            rows[grid.offset(n)] = cellRow(sampler, n, tissue.lookup);
        }
    });
    return rows;
}

std::vector<float> Tissue::imageOn(const NodeGrid& grid) const
{
    checkGrid(grid);
    const TissueData& tissue = *impl_;
    std::vector<float> values(grid.count(), std::numeric_limits<float>::quiet_NaN());
    if (!tissue.image) {
        return values;
    }
    const NodeRange range = nodesAround(tissue, grid, tissue.extentOf(tissue.lookup.solid));
    forEachRow(tissue, grid, range, [&](const CellSampler& sampler, Index3 n) {
        const auto image = tissue.image->getConstUnsafeAccessor();
        for (; n.x <= range.high.x; ++n.x) {
            double sum = 0, weight = 0;
            sampler.visit(n, [&](std::uint16_t label, double w, const openvdb::Coord& voxel) {
                const auto value = static_cast<double>(image.getValue(voxel));
                if (tissue.lookup.solid[label] != 0 && std::isfinite(value)) {
                    sum += w * value;
                    weight += w;
                }
            });
            if (weight > 0) {
                values[grid.offset(n)] = static_cast<float>(sum / weight);
            }
        }
    });
    return values;
}

}  // namespace palpate::volume
