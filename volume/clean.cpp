#include <volume/clean.h>

#include <base/mapped.h>
#include <volume/pieces.h>
#include <volume/voxel_distance.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace palpate::volume {

namespace {

constexpr std::array<Index3, 6> faces{Index3(-1, 0, 0), Index3(1, 0, 0),  Index3(0, -1, 0),
                                      Index3(0, 1, 0),  Index3(0, 0, -1), Index3(0, 0, 1)};

// Calls visit(index of run, y, z) for every run.
template <typename Visit>
void forEachRun(const Pieces& pieces, Index3 size, const Visit& visit)
{
    for (int z = 0; z < size.z; ++z) {
        for (int y = 0; y < size.y; ++y) {
            const auto [begin, end] = pieces.row(y, z);
            for (std::uint32_t run = begin; run != end; ++run) {
                visit(run, y, z);
            }
        }
    }
}

constexpr std::uint32_t firstPiece = 65536;  // keys of faces: below it labels, from it on roots of loose pieces

// Faces around a piece, by what is behind them.
using Faces = std::map<std::uint32_t, std::uint64_t>;

// Finds what loose pieces become. One that lies in another loose piece becomes what that becomes.
class LoosePieces {
public:
    LoosePieces(const LabelImage& image, const Pieces& pieces, const std::vector<char>& loose)
        : image_(image), pieces_(pieces), loose_(loose)
    {
        forEachRun(pieces, image.size, [&](std::uint32_t i, int y, int z) {
            if (loose[pieces.root(i)] != 0) {
                addFaces(i, y, z, around_[pieces.root(i)]);
            }
        });
    }

    // The new label of each, by root. Those whose faces are mostly to what stays are first, and count as staying then;
    // where loose pieces only have each other, their other faces count.
    std::map<std::uint32_t, std::uint16_t> resolve()
    {
        while (!around_.empty()) {
            std::map<std::uint32_t, std::uint16_t> now = decided(false);
            now = now.empty() ? decided(true) : now;
            for (const auto& [root, label] : now) {
                around_.erase(root);
            }
            for (auto& [root, seen] : around_) {
                replace(seen, now);
            }
            label_.merge(now);
        }
        return std::move(label_);
    }

private:
    // Adds what is behind the faces around a run; its own piece is of label `own` and its other runs have that too, so
    // faces to that label are inside the piece.
    void addFaces(std::uint32_t run, int y, int z, Faces& seen) const
    {
        const RowRun& of = pieces_.runs()[run];
        const std::uint16_t own = image_.values[image_.offset({of.first, y, z})];
        const auto look = [&](Index3 n) {
            if (base::holds(image_.size, n) && image_.values[image_.offset(n)] != own) {
                ++seen[keyOf(n)];
            }
        };
        look({of.first - 1, y, z});
        look({of.last + 1, y, z});
        for (int x = of.first; x <= of.last; ++x) {
            look({x, y - 1, z});
            look({x, y + 1, z});
            look({x, y, z - 1});
            look({x, y, z + 1});
        }
    }

    std::uint32_t keyOf(Index3 n) const
    {
        const auto [begin, end] = pieces_.row(n.y, n.z);
        const auto runs = pieces_.runs().subspan(begin, end - begin);
        const auto run = std::ranges::lower_bound(runs, n.x, {}, &RowRun::last);
        const bool inPiece = run != runs.end() && run->first <= n.x;
        return inPiece && loose_[run->parent] != 0 ? firstPiece + run->parent : image_.values[image_.offset(n)];
    }

    // What can be told now: of those with most faces to a label, or (`anyFace`) of those with any. Nothing around: outside.
    std::map<std::uint32_t, std::uint16_t> decided(bool anyFace) const
    {
        std::map<std::uint32_t, std::uint16_t> out;
        const auto fewer = [](const auto& a, const auto& b) { return a.second < b.second; };
        for (const auto& [root, seen] : around_) {
            const auto most = std::max_element(seen.begin(), anyFace ? seen.lower_bound(firstPiece) : seen.end(), fewer);
            if (seen.empty()) {
                out[root] = 0;
            } else if (most != seen.end() && most->first < firstPiece) {
                out[root] = static_cast<std::uint16_t>(most->first);
            }
        }
        return out;
    }

    static void replace(Faces& seen, const std::map<std::uint32_t, std::uint16_t>& labels)
    {
        for (auto at = seen.lower_bound(firstPiece); at != seen.end();) {
            if (const auto label = labels.find(at->first - firstPiece); label != labels.end()) {
                seen[label->second] += at->second;
                at = seen.erase(at);
            } else {
                ++at;
            }
        }
    }

    const LabelImage& image_;
    const Pieces& pieces_;
    const std::vector<char>& loose_;                // by root
    std::map<std::uint32_t, Faces> around_;         // of those that are open, by root
    std::map<std::uint32_t, std::uint16_t> label_;  // of the others
};

// Marks with 1 the air that hangs together with the border of the volume.
std::vector<std::uint8_t> outsideOf(const LabelImage& image, const std::vector<std::uint8_t>& air)
{
    const std::vector<std::uint16_t> group(air.begin(), air.end());
    const Pieces pieces(image, group);
    std::vector<std::uint8_t> open(pieces.runs().size(), 0);  // at roots
    const Index3 last = image.size - 1;
    forEachRun(pieces, image.size, [&](std::uint32_t i, int y, int z) {
        const RowRun& run = pieces.runs()[i];
        const bool border = run.first == 0 || run.last == last.x || y == 0 || y == last.y || z == 0 || z == last.z;
        open[run.parent] |= border ? std::uint8_t{1} : std::uint8_t{0};
    });
    std::vector<std::uint8_t> outside(image.values.size(), 0);
    forEachRun(pieces, image.size, [&](std::uint32_t i, int y, int z) {
        const RowRun& run = pieces.runs()[i];
        if (open[run.parent] != 0) {
            const auto at = outside.begin() + static_cast<std::ptrdiff_t>(image.offset({run.first, y, z}));
            std::fill_n(at, run.last - run.first + 1, std::uint8_t{1});
        }
    });
    return outside;
}

// Gives `label` to the voxels of tissue for which wanted(offset) holds; returns what they were.
template <typename Wanted>
std::vector<Relabelled> relabel(LabelImage& image, const SkinLabels& labels, const Wanted& wanted)
{
    std::map<std::uint16_t, std::uint64_t> taken;
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        std::uint16_t& value = image.values[i];
        if (labels.air[value] == 0 && labels.isSkin[value] == 0 && wanted(i)) {
            ++taken[value];
            value = labels.skin;
        }
    }
    return base::mapped<Relabelled>(taken, [](const auto& one) { return Relabelled{one.first, one.second, 0}; });
}

// The tissue that has a face to the outside: 1 where it is no skin, 2 where it is.
LabelImage surfaceOf(const LabelImage& image, const SkinLabels& labels, const std::vector<std::uint8_t>& outside)
{
    LabelImage surface{image.size, image.affine, std::vector<std::uint16_t>(image.values.size(), 0)};
    forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const std::uint16_t value = image.values[image.offset(n)];
        const bool open = labels.air[value] == 0 && std::ranges::any_of(faces, [&](Index3 face) {
                              return base::holds(image.size, n + face) && outside[image.offset(n + face)] != 0;
                          });
        surface.values[image.offset(n)] = !open ? 0 : labels.isSkin[value] != 0 ? 2 : 1;
    });
    return surface;
}

// The mean of `distance`, to the outside, over the skin's innermost voxels: those with a face to other tissue that is
// deeper [m]. 0 where there are none. A voxel next to the outside is a voxel's edge away from it: its own thickness.
double meanThickness(const LabelImage& image, const SkinLabels& labels, const std::vector<float>& distance)
{
    double sum = 0;
    std::uint64_t innermost = 0;
    forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const std::size_t at = image.offset(n);
        if (labels.isSkin[image.values[at]] == 0 || !std::isfinite(distance[at])) {
            return;
        }
        const bool onTissue = std::ranges::any_of(faces, [&](Index3 face) {
            const std::size_t next = base::holds(image.size, n + face) ? image.offset(n + face) : at;
            const std::uint16_t value = image.values[next];
            return labels.air[value] == 0 && labels.isSkin[value] == 0 && distance[next] > distance[at];
        });
        sum += onTissue ? std::sqrt(static_cast<double>(distance[at])) : 0.0;
        innermost += onTissue ? 1 : 0;
    });
    return innermost > 0 ? sum / static_cast<double>(innermost) : 0.0;
}

// Squared, and a little more, so that rounding decides nothing.
float reachSquared(double reach)
{
    return static_cast<float>(reach * reach * (1 + 1e-5));
}

// Grows patches by edges and corners too: two voxels of a slanted hole often have no face in common.
class PatchFinder {
public:
    explicit PatchFinder(LabelImage& surface) : surface_(surface) {}

    // Voxels of the patch that `start` is in; unmarks them. `across`: diagonal of the box around them [m].
    std::vector<std::size_t> take(Index3 start, double& across)
    {
        Index3 low = start, high = start;
        std::vector<Index3> open{start};
        std::vector<std::size_t> patch;
        surface_.values[surface_.offset(start)] = 0;
        while (!open.empty()) {
            const Index3 n = open.back();
            open.pop_back();
            patch.push_back(surface_.offset(n));
            low = glm::min(low, n);
            high = glm::max(high, n);
            forEachIndex(Index3(-1), Index3(1), [&](Index3 step) {
                const Index3 next = n + step;
                if (base::holds(surface_.size, next) && surface_.values[surface_.offset(next)] == 1) {
                    surface_.values[surface_.offset(next)] = 0;
                    open.push_back(next);
                }
            });
        }
        across = glm::length(surface_.affine.spacing() * Vec3(high - low + 1));
        return patch;
    }

private:
    LabelImage& surface_;
};

}  // namespace

std::vector<Relabelled> keepLargestPieces(LabelImage& image, const std::vector<std::uint8_t>& wanted)
{
    std::vector<std::uint16_t> group(65536, 0);
    for (std::size_t v = 1; v < group.size(); ++v) {
        group[v] = wanted[v] != 0 ? static_cast<std::uint16_t>(v) : std::uint16_t{0};
    }
    const Pieces pieces(image, group);
    const std::vector<std::uint64_t> voxels = pieces.voxels();
    std::map<std::uint16_t, std::uint32_t> largest;  // label, root
    for (std::uint32_t i = 0; i < voxels.size(); ++i) {
        const auto [at, isNew] = largest.emplace(pieces.runs()[i].group, pieces.root(i));
        if (!isNew && voxels[i] > voxels[at->second]) {
            at->second = i;
        }
    }
    std::vector<char> loose(voxels.size(), 0);
    std::map<std::uint16_t, Relabelled> report;
    for (std::uint32_t i = 0; i < voxels.size(); ++i) {
        const std::uint16_t value = pieces.runs()[i].group;
        if (pieces.root(i) == i && largest.at(value) != i) {
            loose[i] = 1;
            Relabelled& line = report.emplace(value, Relabelled{value, 0, 0}).first->second;
            line.voxels += voxels[i];
            line.pieces += 1;
        }
    }
    const std::map<std::uint32_t, std::uint16_t> newLabel = LoosePieces(image, pieces, loose).resolve();
    forEachRun(pieces, image.size, [&](std::uint32_t i, int y, int z) {
        if (loose[pieces.root(i)] != 0) {
            const RowRun& run = pieces.runs()[i];
            const auto at = image.values.begin() + static_cast<std::ptrdiff_t>(image.offset({run.first, y, z}));
            std::fill_n(at, run.last - run.first + 1, newLabel.at(pieces.root(i)));
        }
    });
    return base::mapped<Relabelled>(report, [](const auto& entry) { return entry.second; });
}

AddedSkin addSkin(LabelImage& image, const SkinLabels& labels, double thickness)
{
    const std::vector<std::uint8_t> outside = outsideOf(image, labels.air);
    const Vec3 spacing = image.affine.spacing();
    const double reach = std::max({thickness, spacing.x, spacing.y, spacing.z});
    const std::vector<float> distance = squaredDistance({image.size, image.affine}, outside, reach);
    const LabelImage surface = surfaceOf(image, labels, outside);
    const float most = reachSquared(thickness);
    AddedSkin out;
    out.taken = relabel(image, labels, [&](std::size_t i) { return distance[i] <= most || surface.values[i] != 0; });
    out.thickness = meanThickness(image, labels, distance);
    return out;
}

ClosedHoles closeSkinHoles(LabelImage& image, const SkinLabels& labels, double across)
{
    const std::vector<std::uint8_t> outside = outsideOf(image, labels.air);
    LabelImage surface = surfaceOf(image, labels, outside);
    std::vector<std::uint8_t> others(image.values.size(), 0), holes(image.values.size(), 0);
    std::transform(surface.values.begin(), surface.values.end(), others.begin(),
                   [](std::uint16_t s) { return static_cast<std::uint8_t>(s == 2 ? 1 : 0); });
    ClosedHoles out;
    PatchFinder finder(surface);
    forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        if (surface.values[surface.offset(n)] != 1) {
            return;
        }
        double size = 0;
        const std::vector<std::size_t> patch = finder.take(n, size);
        const bool closes = size <= across;
        out.closed += closes ? 1 : 0;
        out.left += closes ? 0 : 1;
        out.largestLeft = closes ? out.largestLeft : std::max(out.largestLeft, size);
        for (const std::size_t at : patch) {
            (closes ? holes : others)[at] = 1;
        }
    });
    const VoxelGrid grid{image.size, image.affine};
    const Vec3 spacing = image.affine.spacing();
    const double voxel = std::min({spacing.x, spacing.y, spacing.z});
    std::vector<float> depth = squaredDistance(grid, outside, std::numeric_limits<double>::infinity());
    out.thickness = std::max(voxel, meanThickness(image, labels, depth));
    if (out.closed > 0) {
        const double deepest = out.thickness + 0.5 * voxel;
        const float most = reachSquared(deepest);
        std::vector<std::uint8_t> wanted(image.values.size());
        std::transform(depth.begin(), depth.end(), wanted.begin(),
                       [&](float d) { return static_cast<std::uint8_t>(d <= most ? 1 : 0); });
        depth = squaredDistance(grid, holes, deepest);
        const std::vector<float> beside = squaredDistance(grid, others, deepest);
        out.taken = relabel(image, labels, [&](std::size_t i) {
            return holes[i] != 0 || (wanted[i] != 0 && depth[i] <= most && depth[i] <= beside[i]);
        });
    }
    return out;
}

LabelImage cropped(const LabelImage& image, Index3 low, Index3 high)
{
    LabelImage out{high - low + 1, image.affine, {}};
    out.affine.origin = image.affine.toPatient(Vec3(low));
    out.values.reserve(out.offset({0, 0, out.size.z}));
    for (int z = low.z; z <= high.z; ++z) {
        for (int y = low.y; y <= high.y; ++y) {
            const auto row = image.values.begin() + static_cast<std::ptrdiff_t>(image.offset({low.x, y, z}));
            out.values.insert(out.values.end(), row, row + out.size.x);
        }
    }
    return out;
}

LabelImage padded(const LabelImage& image, Index3 by)
{
    LabelImage out{image.size + 2 * by, image.affine, {}};
    out.affine.origin = image.affine.toPatient(-Vec3(by));
    out.values.assign(out.offset({0, 0, out.size.z}), 0);
    for (int z = 0; z < image.size.z; ++z) {
        for (int y = 0; y < image.size.y; ++y) {
            const auto row = image.values.begin() + static_cast<std::ptrdiff_t>(image.offset({0, y, z}));
            std::copy_n(row, image.size.x,
                        out.values.begin() + static_cast<std::ptrdiff_t>(out.offset(Index3(0, y, z) + by)));
        }
    }
    return out;
}

}  // namespace palpate::volume
