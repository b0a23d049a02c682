#include <base/ct_number.h>
#include <base/png.h>
#include <ct/scanner.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <string_view>
#include <tuple>
#include <vector>

namespace palpate::ct {
namespace {

// A cube of fat, 100 mm, with a cube of muscle of 20 mm in its middle, on 1 mm voxels; air around.
struct Cube {
    static constexpr int side = 120;

    Cube()
    {
        s.labels = {{side, side, side}, 0, {-59.5e-3, -59.5e-3, -59.5e-3}, 1e-3};
        s.lattice = {{61, 61, 61}, 0, {-60e-3, -60e-3, -60e-3}, 2e-3};
        s.sound[1].density = 911;
        s.sound[2].density = 1090;
        s.tissues = 3;
        s.tool = channel::ToolKind::sphere;
        s.toolRadius = 1.05e-3;
        s.toolLength = 0.1;
        s.ctSlices = 3;
        s.ctWidth = 5e-3;
        s.ctDoseIndex = 10;
        labels.resize(static_cast<std::size_t>(side) * side * side);
        std::size_t at = 0;
        const auto in = [](int i, double half) { return std::abs(i - 59.5) < half; };
        for (int z = 0; z < side; ++z)
            for (int y = 0; y < side; ++y)
                for (int x = 0; x < side; ++x)
                    labels[at++] = in(x, 10) && in(y, 10) && in(z, 10) ? 2 : in(x, 50) && in(y, 50) && in(z, 50) ? 1 : 0;
        state.axis = {0, 1, 0};
    }

    Scan scan() const
    {
        channel::Deformation body(s, labels);
        return Scanner(s, {}).scan(state, body);
    }

    channel::Scenery s;
    std::vector<std::uint8_t> labels;
    channel::State state;
};

struct Sample {
    double mean = 0, deviation = 0;
    std::size_t count = 0;
};

// Of the pixels of a slice whose places lie within `half` of (x, y) [m].
Sample sampleOf(const Scan& scan, std::size_t slice, double x, double y, double half)
{
    Sample s;
    double squares = 0;
    for (int j = 0; j < scan.side; ++j)
        for (int i = 0; i < scan.side; ++i)
            if (std::abs(scan.corner.x + i * scan.pixel - x) < half &&
                std::abs(scan.corner.y + j * scan.pixel - y) < half) {
                const double hu = scan.at(slice, i, j);
                s.mean += hu;
                squares += hu * hu;
                ++s.count;
            }
    const auto n = static_cast<double>(s.count);
    s.mean /= n;
    s.deviation = std::sqrt(std::max(0.0, squares / n - s.mean * s.mean));
    return s;
}

// Within 12 HU of the published lines, which have steps of their own of up to 10 HU.
TEST(CtNumber, FollowsThePublishedRelationOfDensity)
{
    const auto published = [](double rho) {
        return rho < 0.93   ? (rho - 1.03091) / 1.0297e-3
               : rho < 1.03 ? (rho - 1.018) / 0.893e-3
               : rho < 1.12 ? (rho - 1.003) / 1.169e-3
                            : (rho - 1.017) / 0.592e-3;
    };
    float before = -2000;
    for (double rho = 0.26; rho < 1.9; rho += 0.01) {
        const float here = base::ctNumberOf(1000 * rho);
        EXPECT_GT(here, before);
        // What lies between soft tissue and bone the lines step over, by 74 HU.
        if (rho < 1.105 || rho > 1.165) {
            EXPECT_NEAR(here, published(rho), 12) << rho;
        }
        before = here;
    }
    EXPECT_FLOAT_EQ(base::ctNumberOf(1.21), -1000);
    EXPECT_FLOAT_EQ(base::ctNumberOf(0), -1000);
    EXPECT_GT(base::ctNumberOf(9000), 10000);
}

TEST(CtScan, TissueHasItsNumberAndTheNoiseOfTheDose)
{
    Cube cube;
    for (const double dose : {2.5, 10.0, 40.0}) {
        cube.s.ctDoseIndex = dose;
        const Scan scan = cube.scan();
        ASSERT_EQ(scan.hu.size(), 3U);
        const double noise = noiseOf(cube.s.ctWidth, dose);
        EXPECT_NEAR(noise, 12 * std::sqrt(10 / dose), 1e-9);
        for (std::size_t k = 0; k < 3; ++k) {
            const Sample fat = sampleOf(scan, k, 30e-3, 0, 15e-3), muscle = sampleOf(scan, k, 0, 0, 8e-3);
            EXPECT_NEAR(fat.deviation, noise, 0.06 * noise);
            // Noise is alike over some pixels: as if there were a tenth of them.
            EXPECT_NEAR(fat.mean, base::ctNumberOf(911), 4 * noise / std::sqrt(0.1 * static_cast<double>(fat.count)));
            EXPECT_NEAR(muscle.mean, base::ctNumberOf(1090),
                        4 * noise / std::sqrt(0.1 * static_cast<double>(muscle.count)));
        }
    }
}

TEST(CtScan, TheSameTickIsTheSamePicture)
{
    Cube cube;
    const Scan first = cube.scan(), second = cube.scan();
    EXPECT_EQ(first.hu, second.hu);
    cube.state.tick = 1;
    EXPECT_NE(cube.scan().hu, first.hu);
}

TEST(CtScan, SlicesLieAtTheTipAndBesideIt)
{
    Cube cube;
    cube.state.tip = {0.01, 0.02, 0.013};
    const Scan scan = cube.scan();
    ASSERT_EQ(scan.height.size(), 3U);
    for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(scan.height[static_cast<std::size_t>(k)], 0.013 + (k - 1) * 5e-3, 1e-12);
    // z 8 mm has muscle in all its planes; of 15.5 to 20.5 mm and of 10.5 to 15.5 mm there is none.
    EXPECT_GT(sampleOf(scan, 0, 0, 0, 6e-3).mean, 40);
    EXPECT_LT(sampleOf(scan, 1, 0, 0, 6e-3).mean, -60);
    EXPECT_LT(sampleOf(scan, 2, 0, 0, 6e-3).mean, -60);
}

// All tissue goes 4 mm to the patient's left: so does its picture.
TEST(CtScan, ShowsTheBodyAsItIsDeformed)
{
    Cube cube;
    cube.s.ctDoseIndex = 100;
    channel::Deformation body(cube.s, cube.labels);
    auto displaced = std::make_unique<channel::Displaced>();
    for (std::uint32_t z = 22; z < 39; ++z)
        for (std::uint32_t y = 12; y < 49; ++y)
            for (std::uint32_t x = 12; x < 49; ++x)
                displaced->nodes[displaced->count++] = {(z * 61 + y) * 61 + x, {4e-3F, 0, 0}};
    const Scanner scanner(cube.s, {});
    const auto middleOf = [&](const Scan& scan) {
        double sum = 0, weight = 0;
        for (int i = 0; i < scan.side; ++i) {
            const double x = scan.corner.x + i * scan.pixel;
            if (std::abs(x) > 20e-3)
                continue;
            const double over = scan.at(1, i, scan.side / 2) - static_cast<double>(base::ctNumberOf(911));
            sum += over > 90 ? x : 0;
            weight += over > 90 ? 1 : 0;
        }
        return sum / weight;
    };
    const double before = middleOf(scanner.scan(cube.state, body));
    body.apply(*displaced);
    EXPECT_NEAR(middleOf(scanner.scan(cube.state, body)) - before, 4e-3, 0.5e-3);
}

// Along its axis the needle ends where it ends, but for the blooming of metal, and is as wide as it is.
TEST(CtScan, TheNeedleIsMetalToItsTip)
{
    Cube cube;
    cube.s.tool = channel::ToolKind::needle;
    cube.state.tip = {0.005, 0.01, 0.0};
    cube.state.inserted = 0.06;
    const Scan scan = cube.scan();
    const auto column = static_cast<int>(std::lround((0.005 - scan.corner.x) / scan.pixel));
    int last = -1;
    for (int j = 0; j < scan.side; ++j)
        last = scan.at(1, column, j) > 1500 ? j : last;
    const double end = scan.corner.y + last * scan.pixel;
    EXPECT_NEAR(end, 0.01 + 0.5 * 1.05e-3 + 0.5e-3, 1.2e-3);
    const auto row = static_cast<int>(std::lround((-0.01 - scan.corner.y) / scan.pixel));
    int wide = 0;
    for (int i = 0; i < scan.side; ++i)
        wide += scan.at(1, i, row) > 1500 ? 1 : 0;
    EXPECT_NEAR(wide * scan.pixel, 2.1e-3, 1.3e-3);
    EXPECT_EQ(scan.at(1, column, row), 3071);
    EXPECT_LT(scan.at(2, column, row), 200) << "5 mm beside it there is no metal";
}

// The trainee sees where a core came from: over the notch's length and width, and nowhere else.
TEST(CtScan, ACoreLeavesItsHole)
{
    Cube cube;
    cube.state.tip = {0.0, 0.03, 0.0};
    const Scan before = cube.scan();
    cube.s.holeRadius = 1.5e-3;
    cube.state.holes = 1;
    cube.state.hole[0] = {{0.002F, -0.03F, 0.0F}, {0.002F, -0.015F, 0.0F}};
    const Scan after = cube.scan();
    const auto numberAt = [](const Scan& scan, std::size_t slice, double x, double y) {
        return scan.at(slice, static_cast<int>(std::lround((x - scan.corner.x) / scan.pixel)),
                       static_cast<int>(std::lround((y - scan.corner.y) / scan.pixel)));
    };
    EXPECT_LT(numberAt(after, 1, 0.002, -0.022), numberAt(before, 1, 0.002, -0.022) - 100);
    for (const auto& [slice, x, y] :
         {std::tuple{1U, 0.002, -0.011}, {1U, 0.002, -0.034}, {1U, 0.009, -0.022}, {2U, 0.002, -0.022}})
        EXPECT_EQ(numberAt(after, slice, x, y), numberAt(before, slice, x, y)) << slice << ' ' << x << ' ' << y;
}

TEST(CtScan, ABodyThatCameWithCtHasItsNumbers)
{
    Cube cube;
    std::strcpy(cube.s.imageUnit.data(), "HU");
    cube.s.windows = 1;
    cube.s.imageLow = -1000;
    cube.s.imageStep = 0.5;
    const std::vector<std::uint16_t> image(cube.labels.size(), 2600);  // 300 HU everywhere
    channel::Deformation body(cube.s, cube.labels);
    EXPECT_NEAR(sampleOf(Scanner(cube.s, image).scan(cube.state, body), 1, 0, 0, 20e-3).mean, 300, 3);
    std::strcpy(cube.s.imageUnit.data(), "");
    EXPECT_NEAR(sampleOf(Scanner(cube.s, image).scan(cube.state, body), 1, 30e-3, 0, 10e-3).mean, base::ctNumberOf(911), 3);
}

// The image of a body goes on by a voxel of tissue beside it, for viewers to interpolate; the scanned body ends where its
// labels do. What the image has further outside is there: a bar without a label, 10 mm wide and 10 mm beside the body.
TEST(CtScan, ABodyWithCtIsAsLargeAsItsLabels)
{
    Cube cube;
    std::strcpy(cube.s.imageUnit.data(), "HU");
    cube.s.windows = 1;
    cube.s.imageLow = -1024;
    cube.s.imageStep = 1;
    cube.s.ctDoseIndex = 1e6;
    cube.s.lattice = {{61, 61, 61}, 0, {-60e-3, -60e-3, -60e-3}, 2e-3};
    const auto centre = [](int i) { return i - 59.5; };  // [mm]
    std::vector<std::uint16_t> image;
    for (int z = 0; z < Cube::side; ++z)
        for (int y = 0; y < Cube::side; ++y)
            for (int x = 0; x < Cube::side; ++x) {
                const double far = std::max({std::abs(centre(x)), std::abs(centre(y)), std::abs(centre(z))});
                // The body is smaller by 10 mm to each side than its cube.
                auto& label = cube.labels[static_cast<std::size_t>((z * Cube::side + y) * Cube::side + x)];
                label = far < 40 ? 1 : 0;
                image.push_back(far < 41 ? 1064 : centre(x) > 50 ? 1124 : 24);
            }
    channel::Deformation body(cube.s, cube.labels);
    const Scan scan = Scanner(cube.s, image).scan(cube.state, body);
    const int middle = scan.side / 2;
    int wide = 0, high = 0;
    for (int i = 0; i < scan.side; ++i) {
        wide += scan.at(1, i, middle) > -480 && scan.corner.x + i * scan.pixel < 45e-3 ? 1 : 0;
        high += scan.at(1, middle, i) > -480 ? 1 : 0;
    }
    EXPECT_NEAR(wide * scan.pixel, 80e-3, 0.5e-3);
    EXPECT_NEAR(high * scan.pixel, 80e-3, 0.5e-3);
    EXPECT_NEAR(sampleOf(scan, 1, 0, 0, 20e-3).mean, 40, 1);
    EXPECT_NEAR(sampleOf(scan, 1, 55e-3, 0, 2e-3).mean, 100, 1);
    EXPECT_NEAR(sampleOf(scan, 1, 45e-3, 0, 2e-3).mean, -1000, 1);
}

// Its first pixel begins where the scan's does, whatever its size.
TEST(CtScan, APictureSaysWhereItLies)
{
    Cube cube;
    const Scan scan = cube.scan();
    for (const int side : {100, 320, 1000}) {
        const auto text = nlohmann::json::parse(base::textInPng(scanPng(scan, 7, 7.5, windows[0], side), "palpate-ct"));
        const double pixel = text.at("pixel_m").get<double>();
        EXPECT_NEAR(pixel * side, scan.pixel * scan.side, 1e-12);
        EXPECT_NEAR(text.at("corner_m").at(0).get<double>() - 0.5 * pixel, scan.corner.x - 0.5 * scan.pixel, 1e-12);
        EXPECT_NEAR(text.at("corner_m").at(1).get<double>() - 0.5 * pixel, scan.corner.y - 0.5 * scan.pixel, 1e-12);
    }
}

TEST(CtScan, AWindowGoesFromBlackToWhite)
{
    EXPECT_EQ(windows[0].grey(-160), 0);
    EXPECT_EQ(windows[0].grey(-2000), 0);
    EXPECT_EQ(windows[0].grey(240), 255);
    EXPECT_EQ(windows[0].grey(40), 128);
    Cube cube;
    const Scan scan = cube.scan();
    const auto picture = shown(scan, 1, windows[0], 128);
    EXPECT_EQ(picture.size(), 128U * 128U);
    EXPECT_EQ(picture[0], 0) << "air";
    const std::string png = scanPng(scan, 7, 7.5, windows[0], 128);
    EXPECT_NE(base::textInPng(png, "palpate-ct").find("\"dose_mgy_cm\":7.5"), std::string::npos);
    EXPECT_TRUE(base::textInPng(png, "palpate").empty());
}

}  // namespace
}  // namespace palpate::ct
