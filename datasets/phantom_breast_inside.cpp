#include <datasets/phantom_breast.h>

#include <base/error.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::datasets {

namespace {

constexpr double subcutaneous = 8;     // fat under the skin [mm]
constexpr double retromammary = 6;     // fat in front of the muscle [mm]
constexpr double sheet = 1.0;          // thickness of a Cooper's ligament [mm]
constexpr double lobule = 15;          // size of a lobule of fat [mm]
constexpr double tumourClearance = 3;  // to the muscle and to other tumours [mm]

Vec3 warp(std::uint64_t seed, Vec3 p, double length, double height) noexcept
{
    const Vec3 q = p / length;
    return p + height * Vec3(smoothNoise(seed, q), smoothNoise(seed + 1, q), smoothNoise(seed + 2, q));
}

double norm(Vec3 v) noexcept
{
    return std::sqrt(glm::dot(v, v));
}

// The skin's surface around a point, for exact depths [mm].
std::vector<Vec3> skinPatch(const BreastShape& shape, Vec3 around, double reach)
{
    std::vector<Vec3> patch;
    for (double z = around.z - reach; z <= around.z + reach; z += 1) {
        for (double x = around.x - reach; x <= around.x + reach; x += 1) {
            patch.emplace_back(x, shape.skinFront(x, z), z);
        }
    }
    return patch;
}

double nearest(const std::vector<Vec3>& points, Vec3 p)
{
    double best2 = std::numeric_limits<double>::max();
    for (const Vec3& q : points) {
        best2 = std::min(best2, glm::dot(q - p, q - p));
    }
    return std::sqrt(best2);
}

// Moves `lump` along `inward` until its nearest point is `depth` below the skin.
void sink(const BreastShape& shape, Lump& lump, Vec3 skinPoint, Vec3 inward, double depth)
{
    const std::vector<Vec3> surface = surfacePoints(lump, 250);
    const std::vector<Vec3> patch = skinPatch(shape, skinPoint, depth + 2 * lump.radius);
    lump.centre = skinPoint + (depth + lump.radius) * inward;
    for (int pass = 0; pass < 3; ++pass) {
        double top = std::numeric_limits<double>::max();
        for (const Vec3& p : surface) {
            // The far side cannot be the nearest.
            if (glm::dot(p, inward) < 0.2 * lump.radius) {
                top = std::min(top, nearest(patch, lump.centre + p));
            }
        }
        lump.centre += (depth - top) * inward;
    }
}

bool fits(const BreastShape& shape, const Lump& lump, const std::vector<Lump>& others)
{
    const double reach = lump.bound;
    for (const Lump& other : others) {
        if (norm(other.centre - lump.centre) < reach + other.bound) {
            return false;
        }
    }
    for (const Vec3& p : surfacePoints(lump, 250)) {
        const Vec3 q = lump.centre + p;
        if (shape.muscleFront(q.x, q.z) - q.y < tumourClearance ||
            surfaceColumn(shape, q.x, q.z).depth(q.y) < shape.skin + 1) {
            return false;
        }
    }
    return true;
}

// Tries one place for `lump`, drawn at random beside the nipple.
bool place(const BreastShape& shape, Lump& lump, double depth, const std::vector<Lump>& others, Random& random)
{
    const double reach = 0.8 * shape.radius;
    const double dx = random.between(-reach, reach), dz = random.between(-reach, reach);
    const double side = std::sqrt(dx * dx + dz * dz);
    if (side < 0.15 * shape.radius || side > reach) {
        return false;
    }
    const double x = shape.apex.x + dx, z = shape.apex.z + dz;
    const Vec3 skinPoint(x, shape.skinFront(x, z), z);
    constexpr double e = 0.5;
    const Vec3 inward = glm::normalize(Vec3(-(shape.skinFront(x + e, z) - shape.skinFront(x - e, z)) / (2 * e), 1,
                                            -(shape.skinFront(x, z + e) - shape.skinFront(x, z - e)) / (2 * e)));
    // A quick look at the middle before the exact depth, which costs more.
    const Vec3 middle = skinPoint + (depth + lump.radius) * inward;
    if (shape.muscleFront(middle.x, middle.z) - middle.y < lump.radius + tumourClearance) {
        return false;
    }
    sink(shape, lump, skinPoint, inward, depth);
    return fits(shape, lump, others);
}

using Allowed = std::function<bool(Vec3, double)>;

std::vector<Tube> growVessel(const BreastShape& shape, Vec3 foot, Random& random, const Allowed& clear, const char* name)
{
    constexpr int attempts = 60;
    const Vec3 goal = shape.apex + Vec3(0, 0.3 * shape.projection, 0);
    TreeShape tree{.radius = 1.6,
                   .smallest = 0.7,
                   .step = 3,
                   .branchLength = 0.45 * shape.radius,
                   .levels = 5,
                   .wander = 0.35,
                   .pull = 0.2};
    std::vector<Tube> longest;
    for (int attempt = 0; attempt < attempts && longest.size() < 20; ++attempt) {
        const double x = foot.x + random.between(-8, 8), z = foot.z + random.between(-8, 8);
        const Vec3 root(x, shape.muscleFront(x, z) - 2.5, z);
        std::vector<Tube> tubes;
        if (clear(root, tree.radius)) {
            tubes = growTree(tree, root, goal - root, goal, random, clear);
            // The perforating piece, out of the muscle.
            tubes.push_back({root + Vec3(0, 6, 0), root, tree.radius, tree.radius});
        }
        if (tubes.size() > longest.size()) {
            longest = std::move(tubes);
        }
    }
    base::failIf(longest.size() < 5,
                 "phantom 'breast': no room for the {} beside the tumours: make them smaller or fewer, or set vessels = 0",
                 name);
    return longest;
}

}  // namespace

BreastInterior::BreastInterior(const BreastShape& shape, double density) : shape_(shape)
{
    Random random(shape.seed + 21);
    const int count = 11 + static_cast<int>(random.bits() % 5U);
    while (static_cast<int>(lobes_.size()) < count) {
        const double x = random.between(-1, 1), z = random.between(-1, 1);
        const double length = std::sqrt(x * x + z * z);
        if (length > 0.2 && length <= 1) {
            lobes_.emplace_back(x / length, 0, z / length);
        }
    }
    // The threshold is a quantile of the score over a fixed 3 mm sampling: it does not depend on the voxels.
    std::vector<double> scores;
    const auto sample = [&](double x, double z) {
        const SurfaceColumn column = surfaceColumn(shape, x, z);
        for (double y = column.skinFront + 1; y < column.muscleFront; y += 3) {
            if (column.depth(y) > shape.skin) {
                scores.push_back(glandScore({x, y, z}, column));
            }
        }
    };
    for (double z = -shape.radius; z < shape.radius; z += 3) {
        for (double x = -shape.radius; x < shape.radius; x += 3) {
            if (x * x + z * z <= shape.radius * shape.radius) {
                sample(x, z);
            }
        }
    }
    const double rank = (1.0 - density) * static_cast<double>(scores.size() - 1);
    const auto nth = scores.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(scores.begin(), nth, scores.end());
    threshold_ = *nth;
}

// How much a point belongs to the gland: inside an envelope under the skin and in front of the muscle, in lobes that run
// from the nipple, ragged by noise. The gland reaches up to the nipple and thins out towards the breast's foot.
double BreastInterior::glandScore(Vec3 p, const SurfaceColumn& column) const noexcept
{
    const Vec3 fromApex = p - shape_.apex;
    const double side = std::sqrt(fromApex.x * fromApex.x + fromApex.z * fromApex.z);
    const double under = subcutaneous * std::min(1.0, 0.15 + side / 22);
    const double envelope = std::min(column.depth(p.y) - under, column.muscleFront - p.y - retromammary);
    if (envelope < -6) {
        return -10;  // far outside; spares the noise
    }
    double best = -1, second = -1;
    if (side > 1e-6) {
        const Vec3 warped = warp(shape_.seed + 40, fromApex, 18, 4);
        const double length = std::sqrt(warped.x * warped.x + warped.z * warped.z) + 1e-6;
        for (const Vec3& lobe : lobes_) {
            const double along = (lobe.x * warped.x + lobe.z * warped.z) / length;
            second = std::max(second, std::min(best, along));
            best = std::max(best, along);
        }
    }
    // Clefts of fat between the lobes widen with the distance from the nipple.
    const double cleft = std::min(1.0, (best - second) * side / 5.0) * std::min(1.0, side / 15);
    const double coarse = smoothNoise(shape_.seed + 50, p / 13.0);
    const double fine = smoothNoise(shape_.seed + 51, p / 5.5);
    const double far = norm(fromApex) / shape_.radius;
    return std::min(0.9, envelope / 7) + 0.7 * cleft + 1.1 * coarse + 0.6 * fine - 0.7 * far * far;
}

// Sheets between lobules of fat: where two cells of a warped Worley pattern meet. Holes come from a mask of noise.
bool BreastInterior::ligament(Vec3 p, const SurfaceColumn& column) const noexcept
{
    const double fade = std::min(1.0, column.depth(p.y) / 6);
    if (smoothNoise(shape_.seed + 60, p / 12.0) > 0.25 + 0.2 * fade) {
        return false;
    }
    const Vec3 q = warp(shape_.seed + 70, p, 14, 4) / lobule;
    return cellWallDistance(shape_.seed + 61, q) * lobule < sheet / 2;
}

std::vector<Lump> placeTumours(const BreastShape& shape, const PhantomValues& values)
{
    // The first ones can stand in the way of the last: begin again a few times.
    constexpr int rounds = 12, attempts = 100;
    Random random(shape.seed + 80);
    const double depth = values.number("tumour_depth_mm");
    const double diameter = values.number("tumour_diameter_mm");
    const auto wanted = static_cast<std::size_t>(values.number("tumours"));
    for (int round = 0; round < rounds; ++round) {
        std::vector<Lump> tumours;
        bool room = true;
        while (room && tumours.size() < wanted) {
            Lump lump = makeLump(values.word("tumour_kind"), diameter, random);
            // The first lies as deep as asked, the others up to so deep.
            const double top = tumours.empty() ? depth : random.between(std::min(depth, std::max(4.0, depth / 3)), depth);
            room = false;
            for (int attempt = 0; attempt < attempts && !room; ++attempt) {
                room = place(shape, lump, top, tumours, random);
            }
            if (room) {
                tumours.push_back(std::move(lump));
            }
        }
        if (room) {
            return tumours;
        }
    }
    throw base::error(
        "phantom 'breast': {:d} of tumour_diameter_mm = {:g} mm, tumour_depth_mm = {:g} mm find no room in a breast of "
        "radius_mm = {:g} mm: make them smaller, less deep or fewer, or the breast larger",
        wanted, diameter, depth, shape.radius);
}

BreastTrees growBreastTrees(const BreastShape& shape, const BreastInterior& interior, const std::vector<Lump>& tumours,
                            bool vessels)
{
    BreastTrees trees;
    Random random(shape.seed + 90);
    const auto inBreast = [&](Vec3 p, double underSkin, double beforeMuscle) {
        const SurfaceColumn column = surfaceColumn(shape, p.x, p.z);
        return column.depth(p.y) > underSkin && column.muscleFront - p.y > beforeMuscle;
    };
    const auto clearOfTumours = [&](Vec3 p, double distance) {
        return std::none_of(tumours.begin(), tumours.end(),
                            [&](const Lump& t) { return norm(p - t.centre) < t.bound + distance; });
    };
    if (vessels) {
        // The artery comes from the breastbone's side (internal thoracic), the vein from the armpit's (lateral thoracic).
        const Allowed clear = [&](Vec3 p, double radius) {
            return inBreast(p, 5, radius + 0.5) && clearOfTumours(p, radius + 2.5);
        };
        trees.artery = growVessel(shape, Vec3(-0.55, 0, 0.25) * shape.radius, random, clear, "artery");
        const Allowed clearOfArtery = [&](Vec3 p, double radius) {
            return clear(p, radius) && std::none_of(trees.artery.begin(), trees.artery.end(),
                                                    [&](const Tube& tube) { return distanceToTube(p, tube) < radius + 4; });
        };
        trees.vein = growVessel(shape, Vec3(0.5, 0, 0.35) * shape.radius, random, clearOfArtery, "vein");
    }
    const Allowed room = [&](Vec3 p, double radius) { return inBreast(p, 3, 4) && clearOfTumours(p, radius + 1); };
    const TreeShape ductShape{.radius = 0.9,
                              .smallest = 0.45,
                              .step = 2.5,
                              .branchLength = 0.4 * shape.radius,
                              .levels = 3,
                              .wander = 0.3,
                              .pull = 0.2};
    for (const Vec3& lobe : interior.lobes()) {
        const Vec3 goal = shape.apex + shape.projection * Vec3(0.8 * lobe.x, 0.55, 0.8 * lobe.z);
        const Vec3 mouth = shape.apex + Vec3(1.8 * lobe.x, -1, 1.8 * lobe.z);
        const Vec3 root = shape.apex + Vec3(3.0 * lobe.x, 5, 3.0 * lobe.z);
        std::vector<Tube> tubes = growTree(ductShape, root, Vec3(lobe.x, 1.2, lobe.z), goal, random, room);
        trees.ducts.insert(trees.ducts.end(), tubes.begin(), tubes.end());
        trees.ducts.push_back({mouth, root, ductShape.radius, ductShape.radius});
    }
    return trees;
}

}  // namespace palpate::datasets
