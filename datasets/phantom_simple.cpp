#include <datasets/phantom_parts.h>

#include <base/error.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>

namespace palpate::datasets {

namespace {

constexpr std::uint16_t tumourLabel = 6;
constexpr std::uint16_t secondTumourLabel = 7;

struct Layer {
    std::uint16_t label;
    double depth;  // where it ends, below the front of the body [mm]
};

void requireRoom(bool room, const char* phantom, const PhantomValues& values)
{
    base::failIf(!room,
                 "phantom '{}': a tumour of tumour_diameter_mm = {:g} mm finds no room there: make it smaller, or "
                 "the body larger",
                 phantom, values.number("tumour_diameter_mm"));
}

// The label of the layer at `depth`; the last layer goes on.
template <std::size_t N>
std::uint16_t layerAt(const std::array<Layer, N>& layers, double depth)
{
    const auto layer = std::ranges::upper_bound(layers, depth, {}, &Layer::depth);
    return layer == layers.end() ? layers.back().label : layer->label;
}

}  // namespace

std::vector<PhantomParameter> layeredParameters()
{
    return {{"width_mm", "mm", "width and height of the slab", 30, 200, 80, ""},
            {"skin_mm", "mm", "thickness of the skin", 0.5, 5, 2, ""},
            {"fat_mm", "mm", "thickness of the fat", 0, 80, 15, ""},
            {"gland_mm", "mm", "thickness of the gland", 0, 80, 25, ""},
            {"muscle_mm", "mm", "thickness of the muscle", 0, 60, 10, ""},
            {"bone_mm", "mm", "thickness of the bone behind", 1, 30, 6, ""},
            {"tumours", "", "how many: none or one in the middle", 0, 1, 1, "", true},
            {"tumour_diameter_mm", "mm", "diameter of the sphere of the tumour's volume", 4, 50, 12, ""},
            {"tumour_depth_mm", "mm", "from the outside of the skin to the nearest point of the tumour", 3, 80, 20, ""},
            {"tumour_kind", "", "a tissue of the table", 0, 0, 0, "idc_high_grade"}};
}

PhantomLabels layeredPhantom(const PhantomValues& values)
{
    constexpr double airInFront = 12;
    const double half = values.number("width_mm") / 2;
    std::array<Layer, 5> layers{{{1, values.number("skin_mm")},
                                 {2, values.number("fat_mm")},
                                 {3, values.number("gland_mm")},
                                 {4, values.number("muscle_mm")},
                                 {5, values.number("bone_mm")}}};
    for (std::size_t l = 1; l < layers.size(); ++l) {
        layers[l].depth += layers[l - 1].depth;
    }
    const double thickness = layers.back().depth;
    PhantomLabels out;
    for (const PhantomPart& layer : std::initializer_list<PhantomPart>{
             {1, "skin_mm"}, {2, "fat_mm"}, {3, "gland_mm"}, {4, "muscle_mm"}, {5, "bone_mm"}}) {
        if (values.number(layer.parameter) > 0) {
            out.parts.push_back(layer);
        }
    }
    out.image = phantomImage(values, Vec3(-half, -airInFront, -half), Vec3(half, thickness, half));
    forEachRow(out.image, [&](int j, int k) {
        for (int i = 0; i < out.image.size.x; ++i) {
            const Vec3 p = voxelCentre(out.image, {i, j, k});
            const bool inside = p.y > 0 && std::abs(p.x) < half && std::abs(p.z) < half;
            out.image.values[out.image.offset({i, j, k})] = inside ? layerAt(layers, p.y) : std::uint16_t{0};
        }
    });
    if (values.number("tumours") >= 1) {
        Random random(values.seed);
        Lump lump = makeLump(values.word("tumour_kind"), values.number("tumour_diameter_mm"), random);
        Vec3 low(0), high(0);
        for (const Vec3& p : surfacePoints(lump, 4000)) {
            low = glm::min(low, p);
            high = glm::max(high, p);
        }
        lump.centre = Vec3(0, values.number("tumour_depth_mm") - low.y, 0);
        const double across = std::max({-low.x, -low.z, high.x, high.z});
        requireRoom(lump.centre.y + high.y < layers[3].depth && across < half, "layered", values);
        drawLump(out.image, lump, tumourLabel);
        out.parts.push_back({tumourLabel, "tumour_diameter_mm"});
    }
    out.names = {{0, "air", "air"},
                 {1, "skin", "skin"},
                 {2, "fat", "fat"},
                 {3, "gland", "gland"},
                 {4, "muscle", "muscle"},
                 {5, "bone", "bone"},
                 {tumourLabel, "tumour", values.word("tumour_kind")}};
    return out;
}

std::vector<PhantomParameter> blockParameters()
{
    return {{"width_mm", "mm", "width and height", 20, 300, 100, ""},
            {"thickness_mm", "mm", "from the free front to the base", 10, 200, 60, ""},
            {"base_mm", "mm", "thickness of the bone that holds the back", 1, 20, 4, ""},
            {"tumours", "", "none, one in the middle, or two side by side along x", 0, 2, 1, "", true},
            {"tumour_diameter_mm", "mm", "diameter of a tumour, a sphere", 2, 100, 20, ""},
            {"tumour_centre_mm", "mm", "depth of a tumour's centre below the front", 2, 150, 25, ""},
            {"gap_mm", "mm", "between the nearest points of two tumours", 0, 100, 3, ""},
            {"tissue", "", "what the block is made of, a tissue of the table", 0, 0, 0, "fat"},
            {"tumour_kind", "", "a tissue of the table", 0, 0, 0, "idc_high_grade"}};
}

PhantomLabels blockPhantom(const PhantomValues& values)
{
    constexpr double air = 5;  // around the block, so that its sides are free
    const double half = values.number("width_mm") / 2;
    const double thickness = values.number("thickness_mm");
    const double back = thickness + values.number("base_mm");
    const double radius = values.number("tumours") >= 1 ? values.number("tumour_diameter_mm") / 2 : 0.0;
    const bool two = values.number("tumours") >= 2;
    // Two tumours mirror each other in the plane x = 0.
    const Vec3 centre(two ? values.number("gap_mm") / 2 + radius : 0.0, values.number("tumour_centre_mm"), 0);
    requireRoom(radius == 0 || (centre.y >= radius && centre.y + radius <= thickness && centre.x + radius <= half), "block",
                values);

    PhantomLabels out;
    out.image = phantomImage(values, Vec3(-half - air, -air, -half - air), Vec3(half + air, back + air, half + air));
    forEachRow(out.image, [&](int j, int k) {
        for (int i = 0; i < out.image.size.x; ++i) {
            const Vec3 p = voxelCentre(out.image, {i, j, k});
            const bool inside = p.y > 0 && p.y < back && std::abs(p.x) < half && std::abs(p.z) < half;
            const Vec3 away = Vec3(std::abs(p.x), p.y, p.z) - centre;
            const bool tumour = glm::dot(away, away) < radius * radius && p.y < thickness;
            const std::uint16_t lump = two && p.x > 0 ? secondTumourLabel : tumourLabel;
            const std::uint16_t tissue = p.y > thickness ? 5 : tumour ? lump : 2;
            out.image.values[out.image.offset({i, j, k})] = inside ? tissue : std::uint16_t{0};
        }
    });
    out.names = {{0, "air", "air"},
                 {2, values.word("tissue"), values.word("tissue")},
                 {5, "base", "bone"},
                 {tumourLabel, "tumour", values.word("tumour_kind")}};
    out.parts = {{5, "base_mm"}};
    if (radius > 0) {
        out.parts.push_back({tumourLabel, "tumour_diameter_mm"});
    }
    if (two) {
        out.parts.push_back({secondTumourLabel, "tumour_diameter_mm"});
        out.names.push_back({secondTumourLabel, "tumour_2", values.word("tumour_kind")});
    }
    return out;
}

}  // namespace palpate::datasets
