#include <base/units.h>
#include <datasets/scene.h>
#include <render/palette.h>
#include <tests/render/body.h>
#include <volume/tissue.h>

#include <gtest/gtest.h>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace palpate::render {
namespace {

using glm::dmat3;
using glm::dvec3;

using units::degree;

// Of linear RGB, rows as printed. Source: G. M. Machado, M. M. Oliveira and L. A. F. Fernandes, "A Physiologically-based
// Model for Simulation of Color Vision Deficiency", IEEE TVCG 15(6), 2009, severity 1.0.
const std::map<std::string, dmat3> visions{
    {"none", dmat3(1)},
    {"protanopia",
     glm::transpose(dmat3(0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998))},
    {"deuteranopia",
     glm::transpose(dmat3(0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881))},
    {"tritanopia",
     glm::transpose(dmat3(1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.303900))}};

// CIE L*a*b* of sRGB (IEC 61966-2-1) under D65, as somebody with this vision has it.
dvec3 labOf(dvec3 rgb, const dmat3& vision)
{
    for (int k = 0; k < 3; ++k)
        rgb[k] = rgb[k] <= 0.04045 ? rgb[k] / 12.92 : std::pow((rgb[k] + 0.055) / 1.055, 2.4);
    const dvec3 seen = glm::clamp(vision * rgb, 0.0, 1.0);
    const dmat3 toXyz = glm::transpose(
        dmat3(0.4124564, 0.3575761, 0.1804375, 0.2126729, 0.7151522, 0.0721750, 0.0193339, 0.1191920, 0.9503041));
    dvec3 f = toXyz * seen / dvec3(0.95047, 1, 1.08883);
    for (int k = 0; k < 3; ++k)
        f[k] = f[k] > 216.0 / 24389 ? std::cbrt(f[k]) : (24389.0 / 27 * f[k] + 16) / 116;
    return {116 * f.y - 16, 500 * (f.x - f.y), 200 * (f.y - f.z)};
}

// CIEDE2000. Source: G. Sharma, W. Wu and E. N. Dalal, "The CIEDE2000 color-difference formula: Implementation notes,
// supplementary test data, and mathematical observations", Color Research and Application 30(1), 2005.
double difference(dvec3 p, dvec3 q)
{
    const auto seventh = [](double c) { return std::sqrt(std::pow(c, 7) / (std::pow(c, 7) + std::pow(25, 7))); };
    const double g = 1.5 - 0.5 * seventh((std::hypot(p.y, p.z) + std::hypot(q.y, q.z)) / 2);
    p.y *= g;
    q.y *= g;
    const double c1 = std::hypot(p.y, p.z), c2 = std::hypot(q.y, q.z);
    const auto hue = [](dvec3 v) { return std::fmod(std::atan2(v.z, v.y) / degree + 360, 360); };
    const double h1 = hue(p), h2 = hue(q);
    const bool grey = c1 * c2 == 0;
    const double turn = grey ? 0 : std::fmod(h2 - h1 + 540, 360) - 180;
    const double dh = 2 * std::sqrt(c1 * c2) * std::sin(turn / 2 * degree), dl = q.x - p.x, dc = c2 - c1;
    const double l = (p.x + q.x) / 2, c = (c1 + c2) / 2;
    const double h = grey                       ? h1 + h2
                     : std::abs(h1 - h2) <= 180 ? (h1 + h2) / 2
                     : h1 + h2 < 360            ? (h1 + h2 + 360) / 2
                                                : (h1 + h2 - 360) / 2;
    const double t = 1 - 0.17 * std::cos((h - 30) * degree) + 0.24 * std::cos(2 * h * degree) +
                     0.32 * std::cos((3 * h + 6) * degree) - 0.20 * std::cos((4 * h - 63) * degree);
    const double sl = 1 + 0.015 * (l - 50) * (l - 50) / std::sqrt(20 + (l - 50) * (l - 50)), sc = 1 + 0.045 * c,
                 sh = 1 + 0.015 * c * t;
    const double rt = -std::sin(60 * std::exp(-std::pow((h - 275) / 25, 2)) * degree) * 2 * seventh(c);
    return std::sqrt(std::pow(dl / sl, 2) + std::pow(dc / sc, 2) + std::pow(dh / sh, 2) + rt * dc / sc * dh / sh);
}

TEST(Palette, TheColourDifferenceIsThatOfThePublishedPairs)
{
    // Pairs 1, 7, 13 and 17 of Sharma's table 1.
    EXPECT_NEAR(difference({50, 2.6772, -79.7751}, {50, 0, -82.7485}), 2.0425, 5e-5);
    EXPECT_NEAR(difference({50, 0, 0}, {50, -1, 2}), 2.3669, 5e-5);
    EXPECT_NEAR(difference({50, -0.001, 2.49}, {50, 0.0009, -2.49}), 4.8045, 5e-5);
    EXPECT_NEAR(difference({50, 2.5, 0}, {73, 25, -18}), 27.1492, 5e-5);
}

// Names of tissues that touch in a body: neighbours along the axes, air left out.
std::set<std::pair<std::string, std::string>> touching(const volume::Tissue& tissue)
{
    constexpr double spacing = 1.5e-3;  // [m]
    const auto grid = volume::affordableGrid(tissue.box(), spacing, 4'000'000);
    const auto rows = tissue.tissueOn(grid);
    std::set<std::pair<std::string, std::string>> pairs;
    const auto add = [&](std::uint8_t a, std::uint8_t b) {
        if (a != b && a != 0 && b != 0)
            pairs.insert(std::minmax(tissue.table().rows[a].name, tissue.table().rows[b].name));
    };
    const std::ptrdiff_t across = grid.size.x, along = across * grid.size.y;
    for (std::ptrdiff_t i = 0; i + along < static_cast<std::ptrdiff_t>(rows.size()); ++i)
        for (const std::ptrdiff_t next : {std::ptrdiff_t(1), across, along})
            add(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(i + next)]);
    return pairs;
}

channel::Scenery sceneryOf(const volume::TissueTable& table)
{
    channel::Scenery scenery;
    scenery.tissues = static_cast<std::uint32_t>(table.rows.size());
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
        std::strncpy(scenery.tissue[i].name.data(), table.rows[i].name.c_str(), channel::nameLength - 1);
        scenery.tissue[i].colour = {table.rows[i].colour.x, table.rows[i].colour.y, table.rows[i].colour.z};
    }
    return scenery;
}

dvec3 colourOf(const channel::Scenery& scenery, const std::string& tissue)
{
    for (const channel::TissueLook& look : scenery.tissue)
        if (tissue == look.name.data())
            return {look.colour[0], look.colour[1], look.colour[2]};
    ADD_FAILURE() << tissue;
    return {};
}

double minDifference(const channel::Scenery& scenery, const std::pair<std::string, std::string>& pair)
{
    double least = 1000;
    for (const auto& [name, vision] : visions)
        least = std::min(
            least, difference(labOf(colourOf(scenery, pair.first), vision), labOf(colourOf(scenery, pair.second), vision)));
    return least;
}

// Ten is seen at a glance (2.3 can just be told apart side by side). Where colours are nearer the patterns differ.
TEST(Palette, TissuesThatTouchInTheBuiltInScenesAreToldApartWithEveryKindOfColourBlindness)
{
    std::size_t pairs = 0, near = 0, byPattern = 0;
    for (const std::string& name : datasets::builtInScenes()) {
        const volume::Tissue tissue = datasets::sceneVolume(*datasets::builtInScene(name));
        channel::Scenery asInBody = sceneryOf(tissue.table()), safe = asInBody;
        paint(Palette::standard, asInBody);
        paint(Palette::colourBlind, safe);
        for (const auto& pair : touching(tissue)) {
            ++pairs;
            near += minDifference(asInBody, pair) < 10 ? 1 : 0;
            const bool patterns =
                patternOf(Palette::colourBlind, named(pair.first)) != patternOf(Palette::colourBlind, named(pair.second));
            const double apart = minDifference(safe, pair);
            byPattern += apart < 10 ? 1 : 0;
            EXPECT_TRUE(apart >= 10 || patterns) << name << ": " << pair.first << ", " << pair.second << ": " << apart;
        }
    }
    EXPECT_GT(pairs, 15U);
    EXPECT_GT(near, 0U) << "the standard palette would do";
    EXPECT_LE(byPattern, 2U) << "patterns are for exceptions";
}

// What must not be taken for anything else has a pattern as well, and each its own.
TEST(Palette, VesselsNervesAndLesionsHavePatterns)
{
    std::set<Pattern> seen;
    for (const char* tissue : {"artery", "vein", "nerve", "idc_high_grade"}) {
        const Pattern pattern = patternOf(Palette::colourBlind, named(tissue));
        EXPECT_NE(pattern, Pattern::none) << tissue;
        EXPECT_TRUE(seen.insert(pattern).second) << tissue;
        EXPECT_EQ(patternOf(Palette::standard, named(tissue)), Pattern::none);
    }
    EXPECT_EQ(patternOf(Palette::colourBlind, named("fat")), Pattern::none);
    for (const Pattern pattern : seen) {
        int marked = 0;
        for (int i = 0; i < 36; ++i)
            marked += isMarked(pattern, i % 6, i / 6) ? 1 : 0;
        EXPECT_GT(marked, 3);
        EXPECT_LT(marked, 24);
    }
}

}  // namespace
}  // namespace palpate::render
