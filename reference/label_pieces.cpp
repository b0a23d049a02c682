#include <reference/label_pieces.h>

#include <algorithm>
#include <cstdint>

namespace palpate::reference {

namespace {

// Region of each sample; -1 outside.
std::vector<std::int16_t> regionsOf(const SmoothLabels& labels)
{
    std::vector<std::int16_t> region;
    region.reserve(labels.samples());
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        region.push_back(static_cast<std::int16_t>(regionAt(labels, labels.affine.toPatient(Vec3(n + labels.low)))));
    });
    return region;
}

// Pieces of one region among the samples, by flood.
class Pieces {
public:
    explicit Pieces(const SmoothLabels& labels) : labels_(labels), region_(regionsOf(labels)) {}

    std::vector<RegionSeed> seeds(double least)
    {
        std::vector<RegionSeed> out;
        volume::forEachIndex(Index3(0), labels_.size - 1, [&](Index3 n) {
            if (region_[at(n)] >= 0) {
                const RegionSeed seed = flood(n);
                if (seed.volume >= least) {
                    out.push_back(seed);
                }
            }
        });
        return out;
    }

private:
    std::size_t at(Index3 n) const noexcept { return labels_.offset(n); }
    Vec3 position(Index3 n) const noexcept { return labels_.affine.toPatient(Vec3(n + labels_.low)); }

    // Empties the piece around `from`; its sample with the largest share is the seed.
    RegionSeed flood(Index3 from)
    {
        const std::int16_t region = region_[at(from)];
        std::vector<Index3> queue{from};
        region_[at(from)] = -1;
        Index3 best = from;
        for (std::size_t i = 0; i < queue.size(); ++i) {
            const Index3 n = queue[i];
            best = fraction(n, region) > fraction(best, region) ? n : best;
            for (int side = 0; side < 6; ++side) {
                Index3 next = n;
                next[side / 2] += side % 2 == 0 ? -1 : 1;
                if (next[side / 2] >= 0 && next[side / 2] < labels_.size[side / 2] && region_[at(next)] == region) {
                    region_[at(next)] = -1;
                    queue.push_back(next);
                }
            }
        }
        return {region, position(best), static_cast<double>(queue.size()) * labels_.affine.voxelVolume()};
    }

    std::uint16_t fraction(Index3 n, int region) const noexcept
    {
        const auto here = labels_.at(at(n));
        const auto found = std::ranges::find(here, region, &SmoothLabels::Share::region);
        return found != here.end() ? found->fraction : std::uint16_t{0};
    }

    const SmoothLabels& labels_;
    std::vector<std::int16_t> region_;  // of each sample; -1 outside, and where it was flooded
};

}  // namespace

std::vector<double> thicknesses(const SmoothLabels& labels)
{
    const Vec3 spacing = labels.affine.spacing();
    const double voxel = std::min({spacing.x, spacing.y, spacing.z});
    // Voxels, and faces to others: a face counts by its area, that of the largest one is 1.
    std::vector<double> count(labels.rows.size(), 0.0), border(labels.rows.size(), 0.0);
    const auto region = regionsOf(labels);
    volume::forEachIndex(Index3(0), labels.size - 1, [&](Index3 n) {
        const std::int16_t here = region[labels.offset(n)];
        if (here < 0) {
            return;
        }
        count[static_cast<std::size_t>(here)] += 1.0;
        for (int side = 0; side < 6; ++side) {
            Index3 next = n;
            next[side / 2] += side % 2 == 0 ? -1 : 1;
            const bool inside = next[side / 2] >= 0 && next[side / 2] < labels.size[side / 2];
            border[static_cast<std::size_t>(here)] +=
                !inside || region[labels.offset(next)] != here ? voxel / spacing[side / 2] : 0.0;
        }
    });
    for (std::size_t r = 0; r < count.size(); ++r) {
        count[r] = border[r] > 0.0 ? 2.0 * voxel * count[r] / border[r] : voxel;
    }
    return count;
}

std::vector<RegionSeed> regionSeeds(const SmoothLabels& labels, double least)
{
    return Pieces(labels).seeds(least);
}

}  // namespace palpate::reference
