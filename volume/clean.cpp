#include <volume/clean.h>

#include <base/mapped.h>
#include <volume/pieces.h>
#include <volume/voxel_distance.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <map>

namespace palpate::volume {

namespace {

constexpr std::array<Index3, 6> faces{Index3(-1, 0, 0), Index3(1, 0, 0),  Index3(0, -1, 0),
                                      Index3(0, 1, 0),  Index3(0, 0, -1), Index3(0, 0, 1)};

std::size_t countOf(const LabelImage& image)
{
    return image.values.size();
}

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

// Adds the labels of the faces around a run to `seen`; its own piece is of label `own` and its other runs have that too, so
// faces to that label are inside the piece.
void addFaces(const LabelImage& image, const RowRun& run, int y, int z, std::map<std::uint16_t, std::uint64_t>& seen)
{
    const std::uint16_t own = image.values[image.offset({run.first, y, z})];
    const auto look = [&](Index3 n) {
        if (base::holds(image.size, n) && image.values[image.offset(n)] != own) {
            ++seen[image.values[image.offset(n)]];
        }
    };
    look({run.first - 1, y, z});
    look({run.last + 1, y, z});
    for (int x = run.first; x <= run.last; ++x) {
        look({x, y - 1, z});
        look({x, y + 1, z});
        look({x, y, z - 1});
        look({x, y, z + 1});
    }
}

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
    std::vector<std::uint8_t> outside(countOf(image), 0);
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

// The tissue that has a face to the outside: 1 where it is no skin, 2 where it is; and the area of the skin [m^2].
double findSurface(const LabelImage& image, const SkinLabels& labels, const std::vector<std::uint8_t>& outside,
                   LabelImage& surface)
{
    const Vec3 s = image.affine.spacing();
    const Vec3 area(s.y * s.z, s.x * s.z, s.x * s.y);
    double skin = 0;
    forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        const std::size_t at = image.offset(n);
        if (labels.air[image.values[at]] != 0) {
            return;
        }
        const bool isSkin = labels.isSkin[image.values[at]] != 0;
        for (std::size_t f = 0; f < faces.size(); ++f) {
            const Index3 next = n + faces[f];
            if (base::holds(image.size, next) && outside[image.offset(next)] != 0) {
                surface.values[at] = isSkin ? 2 : 1;
                skin += isSkin ? area[static_cast<int>(f / 2)] : 0.0;
            }
        }
    });
    return skin;
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
    const auto dropped = [&](std::uint32_t run) { return largest.at(pieces.runs()[run].group) != pieces.root(run); };
    std::map<std::uint32_t, std::map<std::uint16_t, std::uint64_t>> around;  // root, label of a face, faces
    forEachRun(pieces, image.size, [&](std::uint32_t i, int y, int z) {
        if (dropped(i)) {
            addFaces(image, pieces.runs()[i], y, z, around[pieces.root(i)]);
        }
    });
    std::map<std::uint16_t, Relabelled> report;
    std::map<std::uint32_t, std::uint16_t> newLabel;
    for (const auto& [root, seen] : around) {
        const auto most =
            std::max_element(seen.begin(), seen.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
        newLabel[root] = most != seen.end() ? most->first : std::uint16_t{0};
        const std::uint16_t value = pieces.runs()[root].group;
        Relabelled& line = report.emplace(value, Relabelled{value, 0, 0}).first->second;
        line.voxels += voxels[root];
        line.pieces += 1;
    }
    forEachRun(pieces, image.size, [&](std::uint32_t i, int y, int z) {
        if (dropped(i)) {
            const RowRun& run = pieces.runs()[i];
            const auto at = image.values.begin() + static_cast<std::ptrdiff_t>(image.offset({run.first, y, z}));
            std::fill_n(at, run.last - run.first + 1, newLabel.at(pieces.root(i)));
        }
    });
    return base::mapped<Relabelled>(report, [](const auto& entry) { return entry.second; });
}

std::vector<Relabelled> addSkin(LabelImage& image, const SkinLabels& labels, double thickness)
{
    const std::vector<std::uint8_t> outside = outsideOf(image, labels.air);
    const std::vector<float> distance = squaredDistance({image.size, image.affine}, outside, thickness);
    const auto most = static_cast<float>(thickness * thickness * (1 + 1e-5));
    return relabel(image, labels, [&](std::size_t i) { return distance[i] <= most; });
}

ClosedHoles closeSkinHoles(LabelImage& image, const SkinLabels& labels, double across)
{
    const std::vector<std::uint8_t> outside = outsideOf(image, labels.air);
    LabelImage surface{image.size, image.affine, std::vector<std::uint16_t>(countOf(image), 0)};
    const double area = findSurface(image, labels, outside, surface);
    const auto skin = static_cast<double>(
        std::count_if(image.values.begin(), image.values.end(), [&](std::uint16_t v) { return labels.isSkin[v] != 0; }));
    ClosedHoles out;
    const Vec3 spacing = image.affine.spacing();
    const double voxel = std::min({spacing.x, spacing.y, spacing.z});
    out.thickness = std::max(voxel, area > 0 ? skin * image.affine.voxelVolume() / area : 0.0);
    std::vector<std::uint8_t> holes(countOf(image), 0);
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
        for (const std::size_t at : closes ? patch : std::vector<std::size_t>{}) {
            holes[at] = 1;
        }
    });
    if (out.closed > 0) {
        // From the hole's own voxels inwards, less the voxel that they are themselves.
        const double depth = std::max(0.0, out.thickness - voxel);
        const std::vector<float> distance = squaredDistance({image.size, image.affine}, holes, depth);
        const auto most = static_cast<float>(depth * depth * (1 + 1e-5));
        out.taken = relabel(image, labels, [&](std::size_t i) { return distance[i] <= most; });
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
