#include <base/error.h>
#include <volume/cell_mixture.h>
#include <volume/cell_sampler.h>
#include <volume/distance.h>
#include <volume/surface_cells.h>
#include <volume/thin_parts.h>
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

namespace palpate::volume {

namespace {

// Nodes, both ends included.
using NodeRange = IndexBox;

// The voxels of the volume that may lie in cells of the range.
IndexBox voxelsAround(const TissueData& tissue, const NodeGrid& grid, const NodeRange& range)
{
    const Mat3 toIndex = glm::inverse(tissue.affine.linear);
    Vec3 low(std::numeric_limits<double>::infinity());
    Vec3 high = -low;
    for (int corner = 0; corner < 8; ++corner) {
        const glm::bvec3 far((corner & 1) != 0, (corner & 2) != 0, (corner & 4) != 0);
        const Vec3 node = glm::mix(Vec3(range.low) - 1.0, Vec3(range.high) + 1.0, Vec3(far));
        const Vec3 at = toIndex * (grid.origin + grid.spacing * node - tissue.affine.origin);
        low = glm::min(low, at);
        high = glm::max(high, at);
    }
    const Vec3 last(tissue.size - 1);
    return {Index3(glm::clamp(low - 1.0, Vec3(0.0), last)), Index3(glm::clamp(high + 2.0, Vec3(0.0), last))};
}

// Calls visit(sampler, row of nodes) for rows along x of the range, on all cores with a sampler each.
template <typename Visit>
void forEachRow(const TissueData& tissue, const NodeGrid& grid, const NodeRange& range, const Visit& visit,
                bool forMaterial = false)
{
    if (range.empty()) {
        return;
    }
    const LabelBlocks blocks(tissue, voxelsAround(tissue, grid, range));
    tbb::parallel_for(tbb::blocked_range<int>(range.low.z, range.high.z + 1), [&](const tbb::blocked_range<int>& slices) {
        const CellSampler sampler(tissue, grid, blocks, forMaterial);
        for (int z = slices.begin(); z != slices.end(); ++z) {
            for (int y = range.low.y; y <= range.high.y; ++y) {
                visit(sampler, Index3(range.low.x, y, z));
            }
        }
    });
}

// Of the cell of node n, which is at `at`.
CellMixture cellMixture(const TissueData& tissue, const CellSampler& sampler, Index3 n, Vec3 at,
                        const std::vector<const TissueRow*>& rows)
{
    CellMixture mixture;
    const int only = sampler.isScaled() ? LabelBlocks::several : sampler.onlyLabel(n);
    const double height = tissue.support ? tissue.support->height(at) : std::numeric_limits<double>::infinity();
    if (only != LabelBlocks::several && height > sampler.farthest()) {
        const TissueRow* row = rows[static_cast<std::size_t>(only)];
        if (row != nullptr) {
            mixture.add(*row, 1.0, 1.0, row->fixed);
        }
        return mixture;
    }
    const auto isTissue = [&](std::uint16_t label) { return rows[label] != nullptr; };
    sampler.visitMaterial(n, isTissue, [&](std::uint16_t label, double weight, const openvdb::Coord& voxel, Vec3 part) {
        if (const TissueRow* row = rows[label]) {
            const Vec3 place = tissue.affine.toPatient({voxel.x(), voxel.y(), voxel.z()});
            const bool held = row->fixed || (tissue.support && tissue.support->height(place) < 0.0);
            mixture.add(*row, weight, sampler.factor(label, voxel), held, part);
        }
    });
    return mixture;
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
            sampler.visitLabels(n, [&](std::uint16_t label, double weight) { sum += wanted[label] != 0 ? weight : 0.0; });
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

Blur blurOf(const TissueData& tissue, const NodeGrid& grid, Index3 passes)
{
    const LabelBlocks none(tissue, {Index3(0), Index3(0)});
    const Vec3 cell = CellSampler(tissue, grid, none, false).variance(grid, tissue.affine);
    const Vec3 voxel = tissue.affine.spacing();
    // Between the middles of voxels on both sides of a face values are linear: half a hat's variance is the voxels' own,
    // and the other half that of steps, which are at any height in a plane that is not along a face.
    Vec3 steps(0.0);
    for (int k = 0; k < 3; ++k) {
        const Vec3 edge = tissue.affine.linear[k];
        constexpr double alongAxis = 0.99;  // cosine
        const Vec3 along = glm::abs(edge);
        steps += std::max({along.x, along.y, along.z}) > alongAxis * glm::length(edge) ? edge * edge / 12.0 : Vec3(0.0);
    }
    return {glm::sqrt(12.0 * cell) / grid.spacing, glm::sqrt(12.0 * (cell - steps)) / grid.spacing, passes,
            std::max({voxel.x, voxel.y, voxel.z}) / grid.spacing};
}

// Fractions of cells, smoothed so that steps are not felt.
std::vector<float> smoothed(std::vector<float> fraction, const NodeGrid& grid, const NodeRange& range, Index3 passes)
{
    const NodeRange reached = grown(range, grid, passes);
    for (int axis = 0; axis < 3; ++axis) {
        smoothAxis(fraction, grid, reached, axis, passes[axis]);
    }
    return fraction;
}

bool inside(const Box& box, const Box& of)
{
    return glm::all(glm::greaterThan(box.low, of.low)) && glm::all(glm::lessThan(box.high, of.high));
}

// Where the surface from blurred fractions misses the volume by more, structures are thinner than the blur.
constexpr double tooThin = 0.15;
constexpr double exact = 0.01;

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

// To what has no thin parts.
// volume: of its voxels [m^3]
DistanceField distanceToSurface(const NodeGrid& grid, const std::vector<float>& blurred, const Blur& blur, double volume)
{
    const BlurredSurface surface = blurredSurface(grid, blurred, blur);
    const double shell = surface.shell * std::pow(grid.spacing, 3) / volume;
    Enclosed enclosed = shell > tooThin ? Enclosed{} : enclosedBy(grid, blurred, surface);
    const double missing = 1.0 - enclosed.volume / volume;
    if (std::abs(missing) > tooThin || shell > tooThin) {
        DistanceField field{{grid, signedDistance(grid, blurred, isoForVolume(grid, blurred, volume))}};
        keepVolume(grid, field.values, volume);
        return field;
    }
    if (std::abs(missing) > exact && shell > exact) {
        // The way back is of first order: on bodies that are curved all over, their volume says how much of it is due.
        const double weight = std::clamp(1.0 + missing / shell, 0.75, 1.25);
        return {{grid, signedDistance(grid, blurred, surface, static_cast<float>(weight))}};
    }
    return {
        {grid, enclosed.distance.empty() ? signedDistance(grid, blurred, surface, 1.0F) : std::move(enclosed.distance)}};
}

// Whether nodes see parts that are a voxel thick, along its longest edge at least.
bool isAsFineAsVoxels(const TissueData& tissue, const NodeGrid& grid)
{
    const Vec3 voxel = tissue.affine.spacing();
    return grid.spacing < (1.0 + 1e-6) * std::max({voxel.x, voxel.y, voxel.z});
}

// keepsThin: parts of a voxel are as thick as that.
DistanceField distanceToMarked(const TissueData& tissue, const NodeGrid& grid, const std::vector<std::uint8_t>& wanted,
                               bool keepsThin)
{
    const IndexBox extent = tissue.extentOf(wanted);
    const Box box = patientBox(tissue.affine, extent);
    const NodeRange range = nodesAround(tissue, grid, extent);
    const std::vector<float> fraction = fractionOf(tissue, grid, range, wanted);
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
    const Blur blur = blurOf(tissue, grid, smoothingPasses(tissue, grid));
    const std::vector<float> blurred = smoothed(fraction, grid, range, blur.passes);
    const bool findsThin = keepsThin && isAsFineAsVoxels(tissue, grid);
    const ThinParts thin = findsThin ? thinParts(grid, fraction, blurred, blur.voxel) : ThinParts{};
    if (thin.around.empty()) {
        return distanceToSurface(grid, blurred, blur, volume);
    }
    const double missed = volume - integral(grid, fraction);  // by nodes, which may take away more than is left
    const double rest = std::max(integral(grid, thin.rest) + missed, std::pow(grid.spacing, 3));
    DistanceField field{
        {grid, std::vector<float>(grid.count(), static_cast<float>(glm::length(grid.box().high - grid.box().low)))}};
    if (*std::max_element(thin.rest.begin(), thin.rest.end()) > 0.5F) {
        field = distanceToSurface(grid, smoothed(thin.rest, grid, range, blur.passes), blur, rest);
    }
    addThinParts(grid, fraction, thin, field.values);
    return field;
}

void checkGrid(const NodeGrid& grid)
{
    base::failIf(grid.size.x < 2 || grid.size.y < 2 || grid.size.z < 2 || !(grid.spacing > 0),
                 "a grid of {} x {} x {} nodes, {} m apart, cannot hold a field", grid.size.x, grid.size.y, grid.size.z,
                 grid.spacing);
}

// Root of arithmetic times harmonic mean of the modulus over the tissue in a cell [Pa]; 0 without tissue.
double cellModulus(const CellSampler& sampler, Index3 n, const std::vector<double>& modulus)
{
    double weight = 0;
    double sum = 0;
    double inverse = 0;
    sampler.visitScaled(n, [&](std::uint16_t label, double w, double factor) {
        const double e = modulus[label] * factor;
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
    Weights<std::uint8_t, 256> rows;  // as many as a table may have
    double solid = 0;
    sampler.visitLabels(n, [&](std::uint16_t label, double weight) {
        if (lookup.solid[label] != 0) {
            solid += weight;
            rows.add(lookup.row[label], weight);
        }
    });
    if (solid < 0.5 - 1e-9) {
        return 0;
    }
    const auto most =
        std::max_element(rows.weights.begin(), rows.weights.begin() + static_cast<std::ptrdiff_t>(rows.count));
    return rows.keys[static_cast<std::size_t>(most - rows.weights.begin())];
}

template <typename Scale>
std::vector<CellMaterial> materials(const TissueData& tissue, const NodeGrid& grid, const Scale& scale)
{
    constexpr double full = 1.0 - 1e-6;  // fraction of a cell that is all of it
    constexpr double finest = 0.76;      // voxels that show more of gaps than eighths do, at most [cells]
    const Vec3 voxel = tissue.affine.spacing();
    const bool isFine = std::max({voxel.x, voxel.y, voxel.z}) <= finest * grid.spacing;
    checkGrid(grid);
    std::vector<const TissueRow*> rows(65536, nullptr);
    for (const Structure& s : tissue.structures) {
        rows[s.value] = tissue.lookup.solid[s.value] != 0 ? &tissue.table.rows[s.tissue] : nullptr;
    }
    const auto isTissue = [&](std::uint16_t label) { return rows[label] != nullptr; };
    const auto isHeld = [&](std::uint16_t label) { return rows[label] != nullptr && rows[label]->fixed; };
    std::vector<CellMaterial> cells(grid.count());
    const NodeRange range = nodesAround(tissue, grid, tissue.extentOf(tissue.lookup.solid));
    forEachRow(
        tissue, grid, range,
        [&](const CellSampler& sampler, Index3 n) {
            for (; n.x <= range.high.x; ++n.x) {
                const Vec3 at = grid.position(n);
                const CellMixture mixture = cellMixture(tissue, sampler, n, at, rows);
                CellMaterial& cell = cells[grid.offset(n)];
                cell = mixture.material();
                if (mixture.fraction() <= 0.0) {
                    cell.octants = 0;
                    cell.quarters = 0;
                } else if (mixture.fraction() < full) {
                    cell.octants = sampler.octants(n, isTissue);
                    cell.quarters = isFine ? sampler.quarters(n, isTissue) : cell.quarters;
                }
                if (cell.fixed > 0.0F) {
                    cell.held.edges = sampler.onEdges(n, isHeld);
                }
                const auto insideFaces = [&] { return sampler.insideFaces(n, isTissue); };
                const auto scaled = static_cast<float>(scale(at, mixture.fraction(), insideFaces));
                cell.youngsModulus *= scaled;
                cell.fraction = std::min(scaled * cell.fraction, 1.0F);
            }
        },
        true);
    return cells;
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
        throw base::error("no voxel has {}",
                          labels.size() == 1 ? fmt::format("label {}", labels[0]) : "one of the labels asked for");
    }
    return distanceToMarked(*impl_, grid, wanted, false);
}

DistanceField Tissue::distanceToBody(const NodeGrid& grid) const
{
    checkGrid(grid);
    base::failIf(impl_->extentOf(impl_->lookup.solid).empty(), "the volume holds no tissue, only air");
    return distanceToMarked(*impl_, grid, impl_->lookup.solid, true);
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
    return materials(*impl_, grid, [](Vec3, double, const auto&) { return 1.0; });
}

std::vector<CellMaterial> Tissue::materialOn(const NodeGrid& grid, const DistanceField& surface) const
{
    const SurfaceCells cells(surface, grid, impl_->affine);
    return materials(*impl_, grid,
                     [&](Vec3 at, double filled, const auto& insideFaces) { return cells.scale(at, filled, insideFaces); });
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
