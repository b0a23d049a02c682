#include <volume/resample.h>

#include <base/error.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

namespace palpate::volume {

namespace {

constexpr int blockSide = 8;        // new voxels that are looked at together
constexpr double equal = 1e-9;      // shares that differ by less are the same
constexpr double maxLoss = 0.1;     // of a structure's volume before it gets voxels back
constexpr double minShare = 1e-10;  // of a voxel that a structure can get back: more than rounding leaves
constexpr double maxSlant = 0.01;   // of the old axes in the new ones [old voxels]: those are parallel

// The orthogonal matrix nearest to `m` (N. Higham, "Computing the Polar Decomposition", 1986); a mirrored one stays so.
Mat3 nearestOrthogonal(Mat3 m)
{
    for (int step = 0; step < 50; ++step) {
        const Mat3 next = 0.5 * (m + glm::transpose(glm::inverse(m)));
        const Mat3 change = next - m;
        m = next;
        if (glm::length(change[0]) + glm::length(change[1]) + glm::length(change[2]) < 1e-15) {
            break;
        }
    }
    return m;
}

struct Share {
    std::uint16_t label = 0;
    double weight = 0;
};

// Finds the fraction of each label in new voxels.
class Sampler {
public:
    Sampler(const LabelImage& image, const VoxelGrid& grid, std::span<const std::uint64_t> voxels)
        : image_(image), voxels_(voxels)
    {
        const Mat3 toIndex = glm::inverse(image.affine.linear);
        const Vec3 old = image.affine.spacing();
        const Vec3 spacing = grid.affine.spacing();
        step_ = toIndex * grid.affine.linear;
        start_ = toIndex * (grid.affine.origin - image.affine.origin);
        Vec3 square(0.0);  // of the old voxels that a sample reaches over, along each old axis
        double across = 0;
        for (int k = 0; k < 3; ++k) {
            const Vec3 along = glm::abs(step_[k]);
            samples_[k] = std::max(1, static_cast<int>(std::ceil(std::max({along.x, along.y, along.z}) - 1e-6)));
            const Vec3 part = step_[k] / static_cast<double>(samples_[k]);
            square += part * part;
            reach_ += 0.5 * along;
            across = std::max(across, along.x + along.y + along.z - along[k]);
        }
        for (int axis = 0; axis < 3; ++axis) {
            const bool interpolated = old[axis] > 0.499 * std::min({spacing.x, spacing.y, spacing.z});
            width_[axis] = interpolated ? 1.0 : std::min(1.0, std::sqrt(square[axis]));
        }
        rim_ = across < maxSlant ? Index3(glm::ceil(reach_)) : Index3(0);
        reach_ += 1.0;
    }

    // The one label that all of the new voxels from `low` to `high` are made of, or -1.
    int uniform(Index3 low, Index3 high) const
    {
        Vec3 first(std::numeric_limits<double>::max()), last(std::numeric_limits<double>::lowest());
        for (int corner = 0; corner < 8; ++corner) {
            const Vec3 n((corner & 1) != 0 ? high.x : low.x, (corner & 2) != 0 ? high.y : low.y,
                         (corner & 4) != 0 ? high.z : low.z);
            first = glm::min(first, start_ + step_ * n);
            last = glm::max(last, start_ + step_ * n);
        }
        const Index3 size = image_.size;
        // No whole number can be made of a place that is far away.
        const Index3 far = rim_ + 2;
        const Index3 from(glm::floor(glm::max(first - reach_, -Vec3(far))));
        const Index3 to(glm::ceil(glm::min(last + reach_, Vec3(size + far))));
        const bool beyond = glm::any(glm::lessThan(from, -rim_)) || glm::any(glm::greaterThanEqual(to, size + rim_));
        const Index3 a = glm::clamp(from, Index3(0), size - 1);
        const Index3 b = glm::clamp(to, Index3(0), size - 1);
        const std::uint16_t value = beyond ? std::uint16_t{0} : image_.values[image_.offset(a)];
        for (int z = a.z; z <= b.z; ++z) {
            for (int y = a.y; y <= b.y; ++y) {
                const std::uint16_t* row = image_.values.data() + image_.offset({0, y, z});
                if (!std::all_of(row + a.x, row + b.x + 1, [&](std::uint16_t v) { return v == value; })) {
                    return -1;
                }
            }
        }
        return value;
    }

    // The shares of the labels in new voxel `n`. They add up to 1.
    void fractions(Index3 n, std::vector<Share>& out) const
    {
        out.clear();
        const Vec3 centre = start_ + step_ * Vec3(n);
        const double part = 1.0 / static_cast<double>(base::countOf(samples_));
        forEachIndex(Index3(0), samples_ - 1,
                     [&](Index3 s) { addSample(out, centre + step_ * ((Vec3(s) + 0.5) / Vec3(samples_) - 0.5), part); });
    }

    std::uint16_t winner(const std::vector<Share>& fractions) const
    {
        const Share* best = &fractions.front();
        for (const Share& s : fractions) {
            const bool more = s.weight > best->weight + equal;
            const bool same = !more && s.weight > best->weight - equal;
            const auto rank = [&](std::uint16_t label) { return std::pair(voxels_[label], label); };
            best = more || (same && rank(s.label) < rank(best->label)) ? &s : best;
        }
        return best->label;
    }

private:
    // A sample is a box around `at` of `width_`, no wider than an old voxel: it lies in two of them along each axis.
    void addSample(std::vector<Share>& out, Vec3 at, double part) const
    {
        const Vec3 low = glm::floor(at);
        const Vec3 t = glm::clamp((at - low - 0.5) / width_ + 0.5, 0.0, 1.0);
        for (int corner = 0; corner < 8; ++corner) {
            const Index3 step(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
            const Vec3 w = glm::mix(1.0 - t, t, Vec3(step));
            if (const double weight = w.x * w.y * w.z; weight > 0) {
                add(out, Index3(low) + step, part * weight);
            }
        }
    }

    // New voxels that the image's border cuts go on as they are inside; what is further out is label 0.
    void add(std::vector<Share>& out, Index3 n, double weight) const
    {
        const Index3 nearest = glm::clamp(n, Index3(0), image_.size - 1);
        const bool inside = glm::all(glm::lessThanEqual(glm::abs(n - nearest), rim_));
        const std::uint16_t label = inside ? image_.values[image_.offset(nearest)] : std::uint16_t{0};
        for (Share& s : out) {
            if (s.label == label) {
                s.weight += weight;
                return;
            }
        }
        out.push_back({label, weight});
    }

    const LabelImage& image_;
    std::span<const std::uint64_t> voxels_;  // of each label in the old image (65536 x 1)
    Mat3 step_{1.0};                         // steps of new voxels [old voxels]
    Vec3 start_{0.0};                        // centre of new voxel (0, 0, 0) [old voxels]
    Index3 samples_{1};                      // of a new voxel, along each of its axes
    Vec3 width_{1.0};                        // of a sample [old voxels]
    Vec3 reach_{0.0};                        // of a new voxel's samples [old voxels]
    Index3 rim_{0};                          // old voxels that the image goes on by
};

// A voxel that a thin structure may get: it fills `fraction` of it.
struct Claim {
    float fraction = 0;
    std::size_t voxel = 0;
};

using Totals = std::vector<double>;  // by label (65536 x 1)

// What one slab of new voxels adds to the totals, by label that occurs in it.
struct Slab {
    std::vector<std::pair<std::uint16_t, double>> filled;
    std::vector<std::pair<std::uint16_t, std::vector<Claim>>> claims;
};

class Resampling {
public:
    Resampling(const LabelImage& image, const VoxelGrid& grid, const std::function<void(double)>& progress)
        : image_(image),
          grid_(grid),
          progress_(progress),
          voxels_(65536, 0),
          won_(65536, 0),
          got_(65536, 0),
          isThin_(65536, 0),
          beside_(65536, 0)
    {
        for (const std::uint16_t v : image.values) {
            ++voxels_[v];
        }
        out_.size = grid.size;
        out_.affine = grid.affine;
        out_.values.assign(base::countOf(grid.size), 0);
    }

    ResampledLabels run()
    {
        filled_ = fill();
        for (const std::uint16_t v : out_.values) {
            ++won_[v];
        }
        giveBack();
        ResampledLabels result;
        for (std::size_t v = 1; v < voxels_.size(); ++v) {
            if (voxels_[v] > 0) {
                result.changes.push_back(
                    {static_cast<std::uint16_t>(v), static_cast<double>(voxels_[v]) * image_.affine.voxelVolume(),
                     static_cast<double>(won_[v]) * grid_.affine.voxelVolume(), got_[v], beside_[v] != 0});
            }
        }
        result.image = std::move(out_);
        return result;
    }

private:
    // Calls visit(voxel, shares, slab) for new voxels of more than one label and uniform(label, count, slab) for blocks of
    // one; slabs on all cores, each with a record of its own so that sums do not depend on who was first.
    template <typename Visit, typename Uniform>
    std::vector<Slab> sweep(double from, double to, const Visit& visit, const Uniform& uniform)
    {
        const Sampler sampler(image_, grid_, voxels_);
        const Index3 blocks = (grid_.size + blockSide - 1) / blockSide;
        std::vector<Slab> slabs(static_cast<std::size_t>(blocks.z));
        constexpr int atOnce = 8;
        for (int first = 0; first < blocks.z; first += atOnce) {
            tbb::parallel_for(first, std::min(first + atOnce, blocks.z), [&](int bz) {
                Slab& slab = slabs[static_cast<std::size_t>(bz)];
                std::vector<Share> fractions;
                forEachIndex(Index3(0, 0, bz), Index3(blocks.x - 1, blocks.y - 1, bz), [&](Index3 block) {
                    const Index3 low = block * blockSide;
                    const Index3 high = glm::min(low + blockSide, grid_.size) - 1;
                    if (const int label = sampler.uniform(low, high); label >= 0) {
                        uniform(low, high, static_cast<std::uint16_t>(label), slab);
                        return;
                    }
                    forEachIndex(low, high, [&](Index3 n) {
                        sampler.fractions(n, fractions);
                        visit(out_.offset(n), fractions, sampler, slab);
                    });
                });
            });
            if (progress_) {
                progress_(from + (to - from) * std::min(1.0, static_cast<double>(first + atOnce) / blocks.z));
            }
        }
        return slabs;
    }

    // Gives every new voxel the label with the largest share; returns how many voxels each label fills.
    Totals fill()
    {
        const auto count = [](Slab& slab, std::uint16_t label, double by) {
            for (auto& [known, sum] : slab.filled) {
                if (known == label) {
                    sum += by;
                    return;
                }
            }
            slab.filled.emplace_back(label, by);
        };
        const auto slabs = sweep(
            0, 0.8,
            [&](std::size_t voxel, const std::vector<Share>& fractions, const Sampler& sampler, Slab& slab) {
                out_.values[voxel] = sampler.winner(fractions);
                for (const Share& s : fractions) {
                    count(slab, s.label, s.weight);
                }
            },
            [&](Index3 low, Index3 high, std::uint16_t label, Slab& slab) {
                forEachIndex(low, high, [&](Index3 n) { out_.values[out_.offset(n)] = label; });
                count(slab, label, static_cast<double>(base::countOf(high - low + 1)));
            });
        Totals filled(65536, 0.0);
        for (const Slab& slab : slabs) {
            for (const auto& [label, sum] : slab.filled) {
                filled[label] += sum;
            }
        }
        return filled;
    }

    // The rule for thin structures.
    void giveBack()
    {
        std::vector<std::uint16_t> thin;
        for (std::size_t v = 1; v < voxels_.size(); ++v) {
            if (voxels_[v] > 0 && filled_[v] > 0 && static_cast<double>(won_[v]) < (1 - maxLoss) * filled_[v]) {
                thin.push_back(static_cast<std::uint16_t>(v));
                isThin_[v] = 1;
            }
        }
        if (thin.empty()) {
            return;
        }
        const std::vector<std::vector<Claim>> claims = claimsOf();
        std::stable_sort(thin.begin(), thin.end(),
                         [&](std::uint16_t a, std::uint16_t b) { return filled_[a] < filled_[b]; });
        for (const std::uint16_t label : thin) {
            const auto wanted = static_cast<std::uint64_t>(std::max(1.0, std::round(filled_[label])));
            for (const Claim& claim : claims[label]) {
                if (won_[label] >= wanted) {
                    break;
                }
                if (isSpare(out_.values[claim.voxel], label)) {
                    give(claim.voxel, label);
                }
            }
        }
        for (const std::uint16_t label : thin) {
            if (won_[label] == 0 && !claims[label].empty()) {
                giveBeside(claims[label].front().voxel, label);
            }
        }
    }

    // Whether `owner` can do without a voxel for `taker`: it keeps one, and nine tenths of its volume, unless `taker` has
    // none.
    bool isSpare(std::uint16_t owner, std::uint16_t taker) const
    {
        const bool enough = isThin_[owner] == 0 && static_cast<double>(won_[owner] - 1) >= (1 - maxLoss) * filled_[owner];
        return owner == 0 || (won_[owner] > 1 && (enough || won_[taker] == 0));
    }

    void give(std::size_t voxel, std::uint16_t label)
    {
        --won_[out_.values[voxel]];
        ++won_[label];
        ++got_[label];
        out_.values[voxel] = label;
    }

    // All voxels that `label` is in are the only ones of their structures: it gets one around that which it fills most of,
    // of tissue if there is some, as near as there is one, and of the structure with most voxels.
    void giveBeside(std::size_t voxel, std::uint16_t label)
    {
        const Index3 middle = base::cellOf(out_.size, voxel);
        std::size_t best = voxel;
        std::tuple<int, int, std::uint64_t> bestRank{2, 0, 0};
        forEachIndex(Index3(-1), Index3(1), [&](Index3 step) {
            const Index3 n = middle + step;
            if (!base::holds(out_.size, n) || won_[out_.values[out_.offset(n)]] < 2) {
                return;
            }
            const std::uint16_t owner = out_.values[out_.offset(n)];
            const Index3 square = step * step;
            const std::tuple rank(owner == 0 ? 1 : 0, square.x + square.y + square.z, ~won_[owner]);
            if (rank < bestRank) {
                bestRank = rank;
                best = out_.offset(n);
            }
        });
        if (best != voxel) {
            give(best, label);
            beside_[label] = 1;
        }
    }

    // By label: voxels that it has a fraction of but not won, those that it fills most of first.
    std::vector<std::vector<Claim>> claimsOf()
    {
        const auto slabs = sweep(
            0.8, 1,
            [&](std::size_t voxel, const std::vector<Share>& fractions, const Sampler&, Slab& slab) {
                for (const Share& s : fractions) {
                    if (isThin_[s.label] == 0 || out_.values[voxel] == s.label || s.weight < minShare) {
                        continue;
                    }
                    auto at = std::find_if(slab.claims.begin(), slab.claims.end(),
                                           [&](const auto& c) { return c.first == s.label; });
                    if (at == slab.claims.end()) {
                        at = slab.claims.insert(at, {s.label, {}});
                    }
                    at->second.push_back({static_cast<float>(s.weight), voxel});
                }
            },
            [](Index3, Index3, std::uint16_t, Slab&) {});
        std::vector<std::vector<Claim>> claims(65536);
        for (const Slab& slab : slabs) {
            for (const auto& [label, list] : slab.claims) {
                claims[label].insert(claims[label].end(), list.begin(), list.end());
            }
        }
        for (auto& list : claims) {
            std::sort(list.begin(), list.end(), [](const Claim& a, const Claim& b) {
                return std::pair(-a.fraction, a.voxel) < std::pair(-b.fraction, b.voxel);
            });
        }
        return claims;
    }

    const LabelImage& image_;
    const VoxelGrid& grid_;
    const std::function<void(double)>& progress_;
    LabelImage out_;
    // Of each label (65536 x 1):
    std::vector<std::uint64_t> voxels_;  // in the old image
    Totals filled_;                      // new voxels that it fills
    std::vector<std::uint64_t> won_;     // new voxels that it has
    std::vector<std::uint64_t> got_;     // of these, by the rule for thin structures
    std::vector<char> isThin_;
    std::vector<char> beside_;  // it has a voxel that it fills nothing of
};

}  // namespace

VoxelGrid isotropicGrid(const VoxelGrid& of, double spacing)
{
    const Vec3 steps = of.affine.spacing();
    const Mat3& m = of.affine.linear;
    const Mat3 axes = nearestOrthogonal(Mat3(m[0] / steps.x, m[1] / steps.y, m[2] / steps.z));
    const Vec3 middle = of.affine.toPatient(0.5 * Vec3(of.size - 1));
    Vec3 half(0.0);
    for (int corner = 0; corner < 4; ++corner) {
        const Vec3 side(1.0, (corner & 1) != 0 ? 1.0 : -1.0, (corner & 2) != 0 ? 1.0 : -1.0);
        const Vec3 along = glm::transpose(axes) * (m * (0.5 * side * Vec3(of.size)));
        half = glm::max(half, glm::abs(along));
    }
    VoxelGrid grid;
    grid.size = glm::max(Index3(glm::ceil(2.0 * half / spacing - 1e-6)), Index3(1));
    grid.affine.linear = axes * spacing;
    grid.affine.origin = middle - grid.affine.linear * (0.5 * Vec3(grid.size - 1));
    return grid;
}

namespace {

void checkValues(std::size_t values, Index3 size)
{
    base::failIf(values != base::countOf(size), "{} values do not fit a grid of {} x {} x {}", values, size.x, size.y,
                 size.z);
}

}  // namespace

ResampledLabels resampled(const LabelImage& image, const VoxelGrid& grid, const std::function<void(double)>& progress)
{
    checkValues(image.values.size(), image.size);
    return Resampling(image, grid, progress).run();
}

std::vector<float> resampledImage(const VoxelGrid& of, std::span<const float> values, const VoxelGrid& grid, float outside)
{
    checkValues(values.size(), of.size);
    const Mat3 toIndex = glm::inverse(of.affine.linear);
    const Mat3 step = toIndex * grid.affine.linear;
    const Vec3 start = toIndex * (grid.affine.origin - of.affine.origin);
    const LabelImage places{grid.size, {}, {}}, from{of.size, {}, {}};
    std::vector<float> out(base::countOf(grid.size), outside);
    tbb::parallel_for(0, grid.size.z, [&](int z) {
        forEachIndex(Index3(0, 0, z), Index3(grid.size.x - 1, grid.size.y - 1, z), [&](Index3 n) {
            const Vec3 at = start + step * Vec3(n);
            const Vec3 last(of.size - 1);
            // Half a voxel beyond the outermost centres is still inside the outermost voxels.
            if (glm::any(glm::lessThan(at, Vec3(-0.5 - 1e-9))) || glm::any(glm::greaterThan(at, last + 0.5 + 1e-9))) {
                return;
            }
            const Vec3 inside = glm::clamp(at, Vec3(0.0), last);
            const Vec3 low = glm::min(glm::floor(inside), glm::max(last - 1.0, Vec3(0.0)));
            const Vec3 t = inside - low;
            double sum = 0;
            for (int corner = 0; corner < 8; ++corner) {
                const Index3 next(corner & 1, (corner >> 1) & 1, (corner >> 2) & 1);
                const Vec3 w = glm::mix(1.0 - t, t, Vec3(next));
                if (const double weight = w.x * w.y * w.z; weight > 0) {
                    sum += weight * static_cast<double>(values[from.offset(Index3(low) + next)]);
                }
            }
            out[places.offset(n)] = static_cast<float>(sum);
        });
    });
    return out;
}

}  // namespace palpate::volume
