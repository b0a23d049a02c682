#include <datasets/phantom_parts.h>

#include <base/error.h>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::datasets {

constexpr double maxVoxels = 1024.0 * 1024.0 * 1024.0;
constexpr double perVoxel = 4.2;  // of a session's memory at its peak, measured from 60 to 450 million voxels [bytes]
constexpr double giga = 1e9;

volume::LabelImage phantomImage(const PhantomValues& values, Vec3 low, Vec3 high)
{
    const int perSide = static_cast<int>(values.number("voxels_per_side"));
    double edge = values.voxel;
    volume::LabelImage image;
    if (perSide > 0) {
        const Vec3 extent = high - low;
        const double side = std::max({extent.x, extent.y, extent.z});
        edge = side / perSide;
        low = Vec3((low.x + high.x - side) / 2, high.y - side, (low.z + high.z - side) / 2);
        image.size = Index3(perSide);
    } else {
        // Faces of voxels pass through the planes of the axes, where flat phantoms have their surface. The small share
        // keeps a rounding error from adding an empty slice.
        low = edge * glm::floor(low / edge + 1e-6);
        for (int axis = 0; axis < 3; ++axis) {
            image.size[axis] = static_cast<int>(std::ceil((high[axis] - low[axis]) / edge - 1e-6));
        }
    }
    const double count = static_cast<double>(image.size.x) * image.size.y * image.size.z;
    base::failIf(count > maxVoxels, "a phantom of {} x {} x {} voxels is too large: choose a larger voxel", image.size.x,
                 image.size.y, image.size.z);
    base::failIf(count * perVoxel > values.memory,
                 "a phantom of {} x {} x {} voxels takes some {:.1f} GB of memory, and {:.1f} GB are free: choose a "
                 "larger voxel, or go on with --anyway",
                 image.size.x, image.size.y, image.size.z, count * perVoxel / giga, values.memory / giga);
    image.affine.linear = Mat3(edge * 1e-3);
    image.affine.origin = (low + Vec3(edge / 2)) * 1e-3;
    image.values.assign(image.offset(Index3(0, 0, image.size.z)), 0);
    return image;
}

Vec3 voxelCentre(const volume::LabelImage& image, Index3 n)
{
    return (image.affine.origin + image.affine.linear[0][0] * Vec3(n)) * 1e3;
}

double voxelEdge(const volume::LabelImage& image)
{
    return image.affine.linear[0][0] * 1e3;
}

void forEachRow(const volume::LabelImage& image, const std::function<void(int, int)>& row)
{
    tbb::parallel_for(tbb::blocked_range<int>(0, image.size.z), [&](const tbb::blocked_range<int>& slab) {
        for (int k = slab.begin(); k < slab.end(); ++k) {
            for (int j = 0; j < image.size.y; ++j) {
                row(j, k);
            }
        }
    });
}

void forEachVoxel(const volume::LabelImage& image, Vec3 low, Vec3 high, double reach,
                  const std::function<void(Index3, Vec3)>& visit)
{
    const double edge = voxelEdge(image);
    const Vec3 origin = image.affine.origin * 1e3;
    const Vec3 most = Vec3(image.size - Index3(1));
    const Index3 first(glm::clamp(glm::floor((low - reach - origin) / edge), Vec3(0.0), most));
    const Index3 last(glm::clamp(glm::ceil((high + reach - origin) / edge), Vec3(0.0), most));
    for (int k = first.z; k <= last.z; ++k) {
        for (int j = first.y; j <= last.y; ++j) {
            for (int i = first.x; i <= last.x; ++i) {
                visit({i, j, k}, voxelCentre(image, {i, j, k}));
            }
        }
    }
}

namespace {

// A spicule narrows from a cone of about 23 degrees (cosine 0.92) to its tip.
constexpr double spiculeCosine = 0.92;
constexpr double lobeFrequency = 1.9;

// By Newton's method: std::cbrt() is not the same on every machine.
double cubeRoot(double x)
{
    double y = std::max(1.0, x);
    for (int i = 0; i < 60; ++i) {
        y -= (y * y * y - x) / (3.0 * y * y);
    }
    return y;
}

// Directions over the sphere from an integer hash: the same on every machine.
std::vector<Vec3> directions(int count)
{
    Random random(0x5EED);
    std::vector<Vec3> out(static_cast<std::size_t>(count));
    std::generate(out.begin(), out.end(), [&] { return random.direction(); });
    return out;
}

struct Branch {
    Vec3 at{0.0}, direction{0.0};
    double radius = 0, length = 0;
    int level = 0;
};

// A unit vector across `direction`.
Vec3 across(Vec3 direction, Random& random)
{
    for (;;) {
        const Vec3 r = random.direction();
        const Vec3 side = r - glm::dot(r, direction) * direction;
        const double length2 = glm::dot(side, side);
        if (length2 > 0.05) {
            return side / std::sqrt(length2);
        }
    }
}

}  // namespace

double Lump::reach(Vec3 direction) const noexcept
{
    double fraction = 1.0 + lobes * smoothNoise(seed, lobeFrequency * direction);
    for (std::size_t s = 0; s < spicules.size(); ++s) {
        const double t = (glm::dot(direction, spicules[s]) - spiculeCosine) / (1.0 - spiculeCosine);
        if (t > 0) {
            fraction += spiculeHeight[s] * t * t;
        }
    }
    return radius * scale * fraction;
}

Lump makeLump(const std::string& kind, double diameter, Random& random)
{
    const bool benign = kind == "fibroadenoma" || kind == "fibrocystic" || kind == "cyst";
    Lump lump;
    lump.radius = diameter / 2;
    lump.lobes = benign ? 0.35 : 0.3;
    lump.seed = random.bits();
    const int spicules = benign ? 0 : 14;
    for (int s = 0; s < spicules; ++s) {
        lump.spicules.push_back(random.direction());
        lump.spiculeHeight.push_back(random.between(0.3, 0.65));
    }
    // Volume of a star-shaped body: the mean of reach^3 over all directions, times 4/3 pi.
    double cubes = 0;
    const std::vector<Vec3> all = directions(4000);
    for (const Vec3& d : all) {
        const double r = lump.reach(d) / lump.radius;
        cubes += r * r * r;
    }
    lump.scale = 1.0 / cubeRoot(cubes / static_cast<double>(all.size()));
    for (const Vec3& p : surfacePoints(lump, 4000)) {
        // Between the samples the surface may rise a little more.
        lump.bound = std::max(lump.bound, 1.05 * std::sqrt(glm::dot(p, p)));
    }
    return lump;
}

std::vector<Vec3> surfacePoints(const Lump& lump, int count)
{
    std::vector<Vec3> points = directions(count);
    points.insert(points.end(), lump.spicules.begin(), lump.spicules.end());
    for (Vec3& p : points) {
        p *= lump.reach(p);
    }
    return points;
}

void drawLump(volume::LabelImage& image, const Lump& lump, std::uint16_t label)
{
    const double half = voxelEdge(image) / 2;
    forEachVoxel(image, lump.centre, lump.centre, std::max(lump.bound, half), [&](Index3 n, Vec3 centre) {
        const Vec3 d = centre - lump.centre;
        const double distance = std::sqrt(glm::dot(d, d));
        // The voxel around the centre belongs to the lump however coarse the grid.
        const bool middle = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}) <= half;
        if (middle || (distance < lump.bound && distance < lump.reach(d / distance))) {
            image.values[image.offset(n)] = label;
        }
    });
}

double distanceToTube(Vec3 p, const Tube& tube) noexcept
{
    const Vec3 along = tube.to - tube.from;
    const double length2 = glm::dot(along, along);
    const double t = length2 > 0 ? std::clamp(glm::dot(p - tube.from, along) / length2, 0.0, 1.0) : 0.0;
    const Vec3 d = p - (tube.from + t * along);
    return std::sqrt(glm::dot(d, d)) - (tube.fromRadius + t * (tube.toRadius - tube.fromRadius));
}

std::vector<Tube> growTree(const TreeShape& shape, Vec3 root, Vec3 direction, Vec3 goal, Random& random,
                           const std::function<bool(Vec3, double)>& allowed)
{
    constexpr int attempts = 12;
    constexpr double murray = 0.7937;  // cube root of 1/2
    std::vector<Tube> tubes;
    std::vector<Branch> open{{root, glm::normalize(direction), shape.radius, shape.branchLength, 0}};
    for (std::size_t b = 0; b < open.size(); ++b) {
        Branch branch = open[b];
        const double endRadius = std::max(branch.radius * 0.85, shape.smallest);
        const int steps = std::max(1, static_cast<int>(branch.length / shape.step));
        const auto advance = [&](int s, int attempt) {
            const double wander = shape.wander * (1.0 + attempt / 4.0);
            const Vec3 way = branch.level == 0 ? glm::normalize(goal - branch.at) : branch.direction;
            const Vec3 d = glm::normalize(branch.direction + shape.pull * way + wander * random.direction());
            const double radius = branch.radius + (endRadius - branch.radius) / (steps - s);
            const Vec3 to = branch.at + shape.step * d;
            if (!allowed(to, radius) || !allowed((branch.at + to) * 0.5, radius)) {
                return false;
            }
            tubes.push_back({branch.at, to, branch.radius, radius});
            branch = {to, d, radius, branch.length, branch.level};
            return true;
        };
        bool blocked = false;
        for (int s = 0; s < steps && !blocked; ++s) {
            blocked = true;
            for (int attempt = 0; attempt < attempts && blocked; ++attempt) {
                blocked = !advance(s, attempt);
            }
        }
        if (branch.level + 1 < shape.levels && branch.radius * murray >= shape.smallest) {
            const Vec3 side = across(branch.direction, random);
            for (const double sign : {1.0, -1.0}) {
                const Vec3 d = glm::normalize(branch.direction + sign * random.between(0.35, 0.8) * side);
                open.push_back({branch.at, d, branch.radius * murray, branch.length * 0.8, branch.level + 1});
            }
        }
    }
    return tubes;
}

void drawTubes(volume::LabelImage& image, const std::vector<Tube>& tubes, double minRadius, std::uint16_t label,
               const std::function<bool(std::uint16_t)>& over)
{
    for (Tube tube : tubes) {
        tube.fromRadius = std::max(tube.fromRadius, minRadius);
        tube.toRadius = std::max(tube.toRadius, minRadius);
        const double reach = std::max(tube.fromRadius, tube.toRadius);
        forEachVoxel(image, glm::min(tube.from, tube.to), glm::max(tube.from, tube.to), reach, [&](Index3 n, Vec3 centre) {
            std::uint16_t& value = image.values[image.offset(n)];
            if (over(value) && distanceToTube(centre, tube) <= 0) {
                value = label;
            }
        });
    }
}

}  // namespace palpate::datasets
