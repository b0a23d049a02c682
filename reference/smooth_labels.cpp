#include <reference/smooth_labels.h>

#include <base/folds.h>
#include <reference/soft_voxels.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

namespace palpate::reference {

namespace {

constexpr double blur = 1.0;          // standard deviation of the Gaussian [voxels]
constexpr int gaussReach = 3;         // of the Gaussian [voxels]
constexpr double full = 65535.0;      // a fraction of one
constexpr double pure = 0.98;         // share from which on a voxel is one tissue throughout
constexpr double maxBias = 0.45;      // beyond it a bias would drown the shares
constexpr double closeEnough = 1e-3;  // of a region's volume
constexpr int fitPasses = 6;

std::array<float, 2 * gaussReach + 1> gaussian()
{
    std::array<float, 2 * gaussReach + 1> weights{};
    double sum = 0.0;
    for (int t = -gaussReach; t <= gaussReach; ++t) {
        sum += std::exp(-t * t / (2.0 * blur * blur));
    }
    for (int t = -gaussReach; t <= gaussReach; ++t) {
        weights[static_cast<std::size_t>(t + gaussReach)] =
            static_cast<float>(std::exp(-t * t / (2.0 * blur * blur)) / sum);
    }
    return weights;
}

// Part of the samples: those that one tissue reaches.
struct SampleBox {
    Index3 low{0}, size{0};

    std::size_t offset(Index3 n) const noexcept { return base::offsetOf(size, n); }
};

// One axis of the blur. Beyond a flat side lies its mirror image; beyond the others, nothing.
void blurAxis(const SmoothLabels& labels, const SampleBox& box, int axis, std::vector<float>& values)
{
    static const auto weights = gaussian();
    const int count = box.size[axis];
    const bool mirrorLow = labels.flat[static_cast<std::size_t>(2 * axis)] && box.low[axis] == 0;
    const bool mirrorHigh =
        labels.flat[static_cast<std::size_t>(2 * axis + 1)] && box.low[axis] + count == labels.size[axis];
    std::size_t stride = 1;
    for (int a = 0; a < axis; ++a) {
        stride *= static_cast<std::size_t>(box.size[a]);
    }
    std::vector<float> line(static_cast<std::size_t>(count + 2 * gaussReach));
    Index3 last = box.size - 1;
    last[axis] = 0;
    volume::forEachIndex(Index3(0), last, [&](Index3 n) {
        float* at = values.data() + box.offset(n);
        for (int i = -gaussReach; i < count + gaussReach; ++i) {
            const int mirrored = i < 0 ? -1 - i : i >= count ? 2 * count - 1 - i : i;
            const bool there = (i >= 0 || mirrorLow) && (i < count || mirrorHigh) && mirrored >= 0 && mirrored < count;
            line[static_cast<std::size_t>(i + gaussReach)] = there ? at[stride * static_cast<std::size_t>(mirrored)] : 0.0F;
        }
        for (int i = 0; i < count; ++i) {
            const float* from = line.data() + i;
            at[stride * static_cast<std::size_t>(i)] = std::inner_product(weights.begin(), weights.end(), from, 0.0F);
        }
    });
}

// The samples that each region reaches.
std::vector<SampleBox> boxesOf(const SoftVoxels& voxels, const SmoothLabels& labels)
{
    std::array<std::size_t, 256> region{};
    for (std::size_t r = 0; r < labels.rows.size(); ++r) {
        region[labels.rows[r]] = r;
    }
    const Index3 shift = voxels.low - labels.low;
    std::vector<Index3> low(labels.rows.size(), labels.size), high(labels.rows.size(), Index3(-1));
    volume::forEachIndex(Index3(0), voxels.size - 1, [&](Index3 n) {
        if (const std::uint8_t row = voxels.row[voxels.offset(n)]; row != 0) {
            low[region[row]] = glm::min(low[region[row]], n + shift);
            high[region[row]] = glm::max(high[region[row]], n + shift);
        }
    });
    std::vector<SampleBox> boxes;
    for (std::size_t r = 0; r < labels.rows.size(); ++r) {
        const Index3 from = glm::max(low[r] - gaussReach, Index3(0));
        boxes.push_back({from, glm::min(high[r] + gaussReach, labels.size - 1) - from + 1});
    }
    return boxes;
}

void addShares(const SoftVoxels& voxels, SmoothLabels& labels)
{
    const std::vector<SampleBox> boxes = boxesOf(voxels, labels);
    const Index3 shift = voxels.low - labels.low;
    std::vector<std::vector<std::pair<std::size_t, std::uint16_t>>> of(labels.rows.size());  // samples and shares
    labels.first.assign(labels.samples() + 1, 0);
    for (std::size_t r = 0; r < labels.rows.size(); ++r) {
        const SampleBox& box = boxes[r];
        std::vector<float> values(box.offset({0, 0, box.size.z}), 0.0F);
        const Index3 low = glm::max(box.low, shift), high = glm::min(box.low + box.size, shift + voxels.size) - 1;
        volume::forEachIndex(low, high, [&](Index3 n) {
            values[box.offset(n - box.low)] = voxels.row[voxels.offset(n - shift)] == labels.rows[r] ? 1.0F : 0.0F;
        });
        for (int axis = 0; axis < 3; ++axis) {
            blurAxis(labels, box, axis, values);
        }
        volume::forEachIndex(Index3(0), box.size - 1, [&](Index3 n) {
            const auto fraction = std::lround(full * static_cast<double>(values[box.offset(n)]));
            if (fraction > 0) {
                of[r].emplace_back(labels.offset(n + box.low), static_cast<std::uint16_t>(fraction));
                ++labels.first[of[r].back().first + 1];
            }
        });
    }
    std::partial_sum(labels.first.begin(), labels.first.end(), labels.first.begin());
    labels.fractions.resize(labels.first.back());
    std::vector<std::size_t> next(labels.first.begin(), labels.first.end() - 1);
    for (std::size_t r = 0; r < of.size(); ++r) {
        for (const auto& [sample, fraction] : of[r]) {
            labels.fractions[next[sample]++] = {static_cast<std::uint8_t>(r), fraction};
        }
        of[r] = {};
    }
}

// The eight samples around a place, with their weights.
struct NearVoxels {
    std::array<std::size_t, 8> at{};
    std::array<double, 8> weight{};
};

// `q`: in samples. False beyond the samples, and beyond a flat side.
bool cornersAt(const SmoothLabels& labels, Vec3 q, NearVoxels& c) noexcept
{
    Index3 base(0), next(0);
    Vec3 f(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        const double end = labels.size[axis] - 1;
        const double low = labels.flat[static_cast<std::size_t>(2 * axis)] ? -0.5 : 0.0;
        const double high = labels.flat[static_cast<std::size_t>(2 * axis + 1)] ? end + 0.5 : end;
        if (!(q[axis] >= low && q[axis] <= high)) {
            return false;
        }
        const double inside = std::clamp(q[axis], 0.0, end);
        base[axis] = static_cast<int>(inside);
        next[axis] = std::min(base[axis] + 1, labels.size[axis] - 1);
        f[axis] = inside - base[axis];
    }
    for (int i = 0; i < 8; ++i) {
        const bool x = (i & 1) != 0, y = (i & 2) != 0, z = (i & 4) != 0;
        const auto corner = static_cast<std::size_t>(i);
        c.at[corner] = labels.offset({x ? next.x : base.x, y ? next.y : base.y, z ? next.z : base.z});
        c.weight[corner] = (x ? f.x : 1.0 - f.x) * (y ? f.y : 1.0 - f.y) * (z ? f.z : 1.0 - f.z);
    }
    return true;
}

// Regions at a place, in order, with their shares.
struct SharesAt {
    std::array<std::uint8_t, 256> region;
    std::array<double, 256> fraction;
    std::size_t count = 0;

    void add(std::uint8_t r, double more) noexcept
    {
        std::size_t at = count;
        while (at > 0 && region[at - 1] >= r) {
            --at;
        }
        if (at == count || region[at] != r) {
            std::copy_backward(region.begin() + at, region.begin() + count, region.begin() + count + 1);
            std::copy_backward(fraction.begin() + at, fraction.begin() + count, fraction.begin() + count + 1);
            region[at] = r;
            fraction[at] = 0.0;
            ++count;
        }
        fraction[at] += more;
    }
};

void sharesAt(const SmoothLabels& labels, const NearVoxels& c, SharesAt& out) noexcept
{
    out.count = 0;
    for (std::size_t i = 0; i < 8; ++i) {
        for (const auto& s : labels.at(c.at[i])) {
            out.add(s.region, c.weight[i] * s.fraction);
        }
    }
    for (std::size_t i = 0; i < out.count; ++i) {
        out.fraction[i] /= full;
    }
}

// Shares at eight points of every voxel near a border, and how many points the others have.
struct BorderPoints {
    struct Share {
        std::uint8_t region = 0;
        float fraction = 0.0F;
    };
    std::vector<std::size_t> first{0};  // of a point, in `shares` (points + 1)
    std::vector<Share> fractions;
    std::vector<std::vector<std::uint32_t>> with;  // points that a region is at (rows)
    std::vector<std::size_t> inner;                // points of voxels that are one tissue throughout (rows x 1)

    std::span<const Share> at(std::size_t point) const
    {
        return {fractions.data() + first[point], first[point + 1] - first[point]};
    }
};

BorderPoints borderPoints(const SmoothLabels& labels)
{
    BorderPoints out;
    out.inner.assign(labels.rows.size(), 0);
    out.with.resize(labels.rows.size());
    SharesAt here;
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        std::uint16_t most = 0;
        std::uint8_t top = 0;
        double sum = 0.0;
        for (const auto& s : labels.at(labels.offset(n))) {
            top = s.fraction > most ? s.region : top;
            most = std::max(most, s.fraction);
            sum += s.fraction;
        }
        if (most >= pure * full) {
            out.inner[top] += 8;
            return;
        }
        if (sum <= (1.0 - pure) * full) {
            return;
        }
        for (int i = 0; i < 8; ++i) {
            NearVoxels c;
            if (!cornersAt(labels, Vec3(n) + countedAt(n, i), c)) {
                continue;
            }
            sharesAt(labels, c, here);
            for (std::size_t k = 0; k < here.count; ++k) {
                out.fractions.push_back({here.region[k], static_cast<float>(here.fraction[k])});
                out.with[here.region[k]].push_back(static_cast<std::uint32_t>(out.first.size() - 1));
            }
            out.first.push_back(out.fractions.size());
        }
    });
    return out;
}

// What to add to a bias so that `wanted` points have a margin above nothing, and nothing is half way to the next one; 0
// when about as many have it already.
double biasStep(std::vector<double>& margins, double wanted)
{
    const auto now = static_cast<double>(std::ranges::count_if(margins, [](double m) { return m > 0.0; }));
    if (margins.empty() || std::abs(now - wanted) <= closeEnough * wanted) {
        return 0.0;
    }
    const double last = std::clamp(wanted, 0.0, static_cast<double>(margins.size()) - 1.0);
    const auto at = margins.begin() + static_cast<std::ptrdiff_t>(last);
    std::nth_element(margins.begin(), at, margins.end(), std::greater<>());
    const bool between = at != margins.begin() && wanted < static_cast<double>(margins.size());
    return between ? -0.5 * (*std::min_element(margins.begin(), at) + *at) : -*at;
}

void fitBody(SmoothLabels& labels, const BorderPoints& points, double wanted)
{
    std::vector<double> margins;
    for (std::size_t p = 0; p + 1 < points.first.size(); ++p) {
        const double sum = base::sumOf(points.at(p), [](const auto& s) { return s.fraction; });
        margins.push_back(sum - 0.5 + labels.bodyBias);
    }
    const double inner = std::accumulate(points.inner.begin(), points.inner.end(), 0.0);
    labels.bodyBias = std::clamp(labels.bodyBias + biasStep(margins, wanted - inner), -maxBias, maxBias);
}

void fitRow(SmoothLabels& labels, const BorderPoints& points, std::size_t row, double wanted)
{
    std::vector<double> margins;
    for (const std::uint32_t p : points.with[row]) {
        double sum = 0.0, own = 0.0, other = -1.0;
        for (const auto& s : points.at(p)) {
            const double fraction = s.fraction;
            sum += fraction;
            if (s.region == row) {
                own = fraction;
            } else {
                other = std::max(other, fraction + labels.bias[s.region]);
            }
        }
        if (sum >= 0.5 - labels.bodyBias) {
            margins.push_back(own + labels.bias[row] - other);
        }
    }
    const double step = biasStep(margins, wanted - static_cast<double>(points.inner[row]));
    labels.bias[row] = std::clamp(labels.bias[row] + step, -maxBias, maxBias);
}

}  // namespace

// Source of the numbers: as in samplePoints() of the mesher.
Vec3 countedAt(Index3 n, int eighth) noexcept
{
    constexpr std::array<double, 3> step{0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    constexpr double turn = 0.6180339887498949;  // from one eighth to the next
    Vec3 at(0.0);
    for (int axis = 0; axis < 3; ++axis) {
        double along = eighth * turn;
        for (int other = 0; other < 3; ++other) {
            along += step[static_cast<std::size_t>((axis + other) % 3)] * n[other];
        }
        at[axis] = 0.5 * (along - std::floor(along)) - ((eighth >> axis & 1) != 0 ? 0.0 : 0.5);
    }
    return at;
}

SmoothLabels smoothLabels(const volume::Tissue& tissue, Keep keep)
{
    SoftVoxels voxels = readVoxels(tissue, keep);
    SmoothLabels labels;
    labels.affine = tissue.affine();
    labels.heldSide = voxels.held || keep == Keep::all ? -1 : layOnItsBack(labels.affine, voxels);
    labels.flat = flatSides(voxels);
    if (labels.heldSide >= 0) {
        labels.flat[static_cast<std::size_t>(labels.heldSide)] = true;
    }
    labels.low = voxels.low;
    labels.size = voxels.size;
    for (int side = 0; side < 6; ++side) {
        const int margin = labels.flat[static_cast<std::size_t>(side)] ? 0 : gaussReach;
        labels.low[side / 2] -= side % 2 == 0 ? margin : 0;
        labels.size[side / 2] += margin;
    }
    std::array<std::size_t, 256> count{};
    for (const std::uint8_t row : voxels.row) {
        ++count[row];
    }
    for (std::size_t row = 1; row < count.size(); ++row) {
        if (count[row] > 0) {
            labels.rows.push_back(static_cast<std::uint8_t>(row));
            labels.volume.push_back(static_cast<double>(count[row]) * labels.affine.voxelVolume());
        }
    }
    labels.bias.assign(labels.rows.size(), 0.0);
    addShares(voxels, labels);
    fitVolumes(labels, labels.volume);
    return labels;
}

void fitVolumes(SmoothLabels& labels, std::span<const double> wanted)
{
    const BorderPoints points = borderPoints(labels);
    const double point = labels.affine.voxelVolume() / 8.0;
    fitBody(labels, points, std::accumulate(wanted.begin(), wanted.end(), 0.0) / point);
    // Biases mean nothing but against each other: the largest region keeps its own.
    labels.largest = static_cast<int>(std::max_element(wanted.begin(), wanted.end()) - wanted.begin());
    // Small ones first, which the blur took most from: what they take is then no longer the large ones' to give away.
    std::vector<std::size_t> order(labels.rows.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::erase(order, static_cast<std::size_t>(labels.largest));
    std::ranges::sort(order, {}, [&](std::size_t row) { return wanted[row]; });
    for (int pass = 0; pass < fitPasses; ++pass) {
        for (const std::size_t row : order) {
            fitRow(labels, points, row, wanted[row] / point);
        }
    }
}

int regionAt(const SmoothLabels& labels, Vec3 p) noexcept
{
    NearVoxels c;
    if (!cornersAt(labels, labels.affine.toIndex(p) - Vec3(labels.low), c)) {
        return -1;
    }
    const double distance = labels.within.empty() ? 0.0 : distanceToLine(p, labels.from, labels.to);
    SharesAt here;
    sharesAt(labels, c, here);
    double sum = 0.0, competing = 0.0;
    for (std::size_t i = 0; i < here.count; ++i) {
        sum += here.fraction[i];
        if (!labels.within.empty() && distance > labels.within[here.region[i]]) {
            here.fraction[i] = 0.0;
        }
        competing += here.fraction[i];
    }
    if (sum < 0.5 - labels.bodyBias) {
        return -1;
    }
    // Where most of the shares are out of the race, the biases must not weigh more than what is left.
    const double left = competing / sum;
    double best = -1.0;
    int region = labels.largest;
    for (std::size_t i = 0; i < here.count; ++i) {
        const double score = here.fraction[i] + left * labels.bias[here.region[i]];
        if (here.fraction[i] > 0.0 && score > best) {
            best = score;
            region = here.region[i];
        }
    }
    return region;
}

double distanceToLine(Vec3 p, Vec3 from, Vec3 to) noexcept
{
    const Vec3 along = to - from;
    const double square = glm::dot(along, along);
    const double t = square > 0.0 ? std::clamp(glm::dot(p - from, along) / square, 0.0, 1.0) : 0.0;
    return glm::distance(p, from + t * along);
}

}  // namespace palpate::reference
