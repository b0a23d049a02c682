#include <datasets/phantom_breast.h>

#include <algorithm>
#include <cmath>

namespace palpate::datasets {

namespace {

enum Label : std::uint16_t { air, skin, fat, gland, ligament, duct, nipple, artery, vein, muscle, rib, chestWall, tumour };

constexpr double margin = 8;            // of chest around the breast
constexpr double chestCurvature = 320;  // twice the radius of the chest's curve across
constexpr double chestFat = 8;          // between skin and muscle beside the breast
constexpr double pectoral = 9;          // thickness of the muscle in front of the ribs
constexpr double ribRoom = 9;           // thickness of ribs and of the muscle between them
constexpr double behindRibs = 4;
constexpr double nippleRadius = 5, nippleHeight = 7, nippleRoot = 3;

bool inNipple(const BreastShape& shape, Vec3 p) noexcept
{
    const double height = shape.apex.y - p.y;
    if (height < -nippleRoot || height > nippleHeight) {
        return false;
    }
    const double x = (p.x - shape.apex.x) / nippleRadius, z = (p.z - shape.apex.z) / nippleRadius;
    const double top = std::max(0.0, (height - nippleHeight / 2) / (nippleHeight / 2));
    return x * x + z * z + top * top < 1.0;
}

// Ribs run across, rise towards the side and bend back at their ends; `behind` is the depth behind the muscle's front.
bool inRib(const BreastShape& shape, Vec3 p, double behind) noexcept
{
    constexpr double spacing = 27, halfHeight = 6.5, halfThickness = 4;
    const double rise = 0.18 * p.x + p.x * p.x / 700 + 1.5 * smoothNoise(shape.seed + 31, Vec3(p.x, 0, p.z) / 30.0);
    const double z = (p.z - rise) / spacing;
    const double across = (z - std::floor(z) - 0.5) * spacing / halfHeight;
    const double through = (behind - pectoral - ribRoom / 2) / halfThickness;
    return across * across + through * through < 1.0;
}

std::uint16_t labelAt(const BreastShape& shape, const BreastInterior& interior, Vec3 p, const SurfaceColumn& column)
{
    if (inNipple(shape, p)) {
        return nipple;
    }
    const double depth = column.depth(p.y);
    if (depth < shape.skin) {
        return depth < 0 ? air : skin;
    }
    const double behind = p.y - column.muscleFront;
    if (behind >= 0) {
        const bool deep = behind > pectoral + ribRoom;
        return inRib(shape, p, behind) ? rib : deep ? chestWall : muscle;
    }
    return interior.gland(p, column) ? gland : interior.ligament(p, column) ? ligament : fat;
}

// On a coarse grid a thin or steep skin has holes: whatever touches air becomes skin.
void closeSkin(volume::LabelImage& image)
{
    const std::vector<std::uint16_t> before = image.values;
    const auto touchesAir = [&](Index3 n) {
        for (int side = 0; side < 6; ++side) {
            Index3 next = n;
            next[side / 2] += side % 2 == 0 ? 1 : -1;
            const bool inside = next[side / 2] >= 0 && next[side / 2] < image.size[side / 2];
            if (inside && before[image.offset(next)] == air) {
                return true;
            }
        }
        return false;
    };
    forEachRow(image, [&](int j, int k) {
        for (int i = 0; i < image.size.x; ++i) {
            const std::size_t at = image.offset({i, j, k});
            if (before[at] != air && before[at] != skin && before[at] != nipple && touchesAir({i, j, k})) {
                image.values[at] = skin;
            }
        }
    });
}

void drawTrees(volume::LabelImage& image, const BreastTrees& trees)
{
    const auto soft = [](std::uint16_t l) { return l == fat || l == gland || l == ligament || l == muscle; };
    const double edge = voxelEdge(image);
    drawTubes(image, trees.ducts, 0.6 * edge, duct, soft);
    // 0.9 voxels of radius always hold a voxel's centre (half a diagonal is 0.87), so a vessel stays in one piece.
    const auto softOrDuct = [&](std::uint16_t l) { return soft(l) || l == duct; };
    drawTubes(image, trees.vein, 0.9 * edge, vein, softOrDuct);
    drawTubes(image, trees.artery, 0.9 * edge, artery, softOrDuct);
}

std::vector<volume::LabelName> labelNames(std::size_t tumours, const std::string& kind)
{
    std::vector<volume::LabelName> names{{air, "air", "air"},
                                         {skin, "skin", "skin"},
                                         {fat, "fat", "fat"},
                                         {gland, "gland", "gland"},
                                         {ligament, "ligament", "ligament"},
                                         {duct, "duct", "duct"},
                                         {nipple, "nipple", "nipple"},
                                         {artery, "artery", "artery"},
                                         {vein, "vein", "vein"},
                                         {muscle, "muscle", "muscle"},
                                         {rib, "rib", "rib"},
                                         {chestWall, "chest_wall", "chest_wall"}};
    for (std::size_t t = 0; t < tumours; ++t) {
        const std::string name = t == 0 ? "tumour" : "tumour_" + std::to_string(t + 1);
        names.push_back({static_cast<std::uint16_t>(tumour + t), name, kind});
    }
    return names;
}

}  // namespace

double BreastShape::muscleFront(double x, double z) const noexcept
{
    return x * x / chestCurvature + 1.2 * smoothNoise(seed + 11, Vec3(x, 0, z) / 25.0);
}

double BreastShape::skinFront(double x, double z) const noexcept
{
    // The apex hangs a little under the middle, so the breast is steeper below than above.
    const double wobble = 1.0 + 0.06 * smoothNoise(seed + 12, Vec3(x, 0, z) / (0.8 * radius));
    const double upright = std::max(0.0, 1.0 - (x * x + z * z) / (radius * radius));
    const double hung = z + 0.15 * radius * upright;
    const double rest = std::max(0.0, 1.0 - wobble * (x * x + hung * hung) / (radius * radius));
    // A dome that runs out into the chest without a crease.
    return x * x / chestCurvature - chestFat - projection * rest * std::sqrt(rest) * (1.5 - 0.5 * rest);
}

BreastShape makeBreastShape(const PhantomValues& values)
{
    BreastShape shape;
    shape.radius = values.number("radius_mm");
    shape.projection = 0.8 * shape.radius;
    shape.skin = values.number("skin_mm");
    shape.seed = mixBits(values.seed);
    for (double z = -shape.radius / 2; z <= shape.radius / 2; z += 0.5) {
        for (double x = -shape.radius / 2; x <= shape.radius / 2; x += 0.5) {
            const Vec3 p(x, shape.skinFront(x, z), z);
            shape.apex = p.y < shape.apex.y ? p : shape.apex;
        }
    }
    return shape;
}

SurfaceColumn surfaceColumn(const BreastShape& shape, double x, double z) noexcept
{
    constexpr double e = 0.25;
    SurfaceColumn column;
    column.skinFront = shape.skinFront(x, z);
    column.muscleFront = shape.muscleFront(x, z);
    const double dx = (shape.skinFront(x + e, z) - shape.skinFront(x - e, z)) / (2 * e);
    const double dz = (shape.skinFront(x, z + e) - shape.skinFront(x, z - e)) / (2 * e);
    column.steepness = 1.0 / std::sqrt(1.0 + dx * dx + dz * dz);
    return column;
}

std::vector<PhantomParameter> breastParameters()
{
    return {{"radius_mm", "mm", "radius of the breast on the chest wall", 35, 90, 56, ""},
            {"skin_mm", "mm", "thickness of the skin", 1, 4, 1.75, ""},
            {"density", "", "share of gland in the breast", 0.05, 0.7, 0.25, ""},
            {"vessels", "", "1 with artery and vein, 0 without", 0, 1, 1, "", true},
            {"tumours", "", "how many", 0, 6, 1, "", true},
            {"tumour_diameter_mm", "mm", "diameter of the sphere of the tumour's volume", 4, 40, 15, ""},
            {"tumour_depth_mm", "mm",
             "along the normal of the skin in front of the first tumour, to its nearest point (the shortest way to curved "
             "skin is up to a tenth less); the others lie up to so deep",
             4, 50, 15, ""},
            {"tumour_kind", "", "a tissue of the table", 0, 0, 0, "idc_high_grade"}};
}

PhantomLabels breastPhantom(const PhantomValues& values)
{
    const BreastShape shape = makeBreastShape(values);
    const BreastInterior interior(shape, values.number("density"));
    const std::vector<Lump> tumours = placeTumours(shape, values);
    const BreastTrees trees = growBreastTrees(shape, interior, tumours, values.number("vessels") >= 0.5);

    const double half = shape.radius + margin;
    const double front = -(chestFat + shape.projection + nippleHeight + 5);
    const double back = half * half / chestCurvature + pectoral + ribRoom + behindRibs;
    PhantomLabels out;
    out.image = phantomImage(values, Vec3(-half, front, -half), Vec3(half, back, half));
    volume::LabelImage& image = out.image;

    std::vector<SurfaceColumn> columns(image.offset({0, 0, 1}) / static_cast<std::size_t>(image.size.y) *
                                       static_cast<std::size_t>(image.size.z));
    const auto columnOf = [&](int i, int k) -> SurfaceColumn& {
        return columns[static_cast<std::size_t>(k) * static_cast<std::size_t>(image.size.x) + static_cast<std::size_t>(i)];
    };
    forEachRow(image, [&](int j, int k) {
        for (int i = 0; j == 0 && i < image.size.x; ++i) {
            const Vec3 p = voxelCentre(image, {i, 0, k});
            columnOf(i, k) = surfaceColumn(shape, p.x, p.z);
        }
    });
    forEachRow(image, [&](int j, int k) {
        for (int i = 0; i < image.size.x; ++i) {
            image.values[image.offset({i, j, k})] = labelAt(shape, interior, voxelCentre(image, {i, j, k}), columnOf(i, k));
        }
    });
    drawTrees(image, trees);
    out.parts = {{skin, "skin_mm"}};
    for (std::size_t t = 0; t < tumours.size(); ++t) {
        const auto label = static_cast<std::uint16_t>(tumour + t);
        drawLump(image, tumours[t], label);
        out.parts.push_back({label, "tumour_diameter_mm"});
    }
    closeSkin(image);
    out.names = labelNames(tumours.size(), values.word("tumour_kind"));
    return out;
}

}  // namespace palpate::datasets
