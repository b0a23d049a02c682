#include <render/grey_image.h>

#include <render/slice_picture.h>
#include <render/tool_picture.h>
#include <render/volume_picture.h>
#include <tests/render/body.h>
#include <tests/render/studio.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <vtkActor2D.h>
#include <vtkCellData.h>
#include <vtkImageData.h>
#include <vtkImageMapper.h>
#include <vtkNew.h>
#include <vtkPolyData.h>
#include <vtkPolyDataMapper2D.h>
#include <vtkPropCollection.h>
#include <vtkRenderer.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

namespace palpate::render {
namespace {

constexpr int cubeSide = 40;
constexpr double voxel = 1e-3, node = 2e-3;
constexpr double low = -100, perMetre = 1.5e4;  // of the ramp along x

// A cube of tissue 1 in front (y < 20 mm) and 2 behind, with air on both sides of z, a shell in tissue 1, and an image that
// rises along x.
struct Block {
    Block()
    {
        scenery.labels = {{cubeSide, cubeSide, cubeSide}, 0, {0, 0, 0}, voxel};
        scenery.lattice = {{cubeSide / 2, cubeSide / 2, cubeSide / 2}, 0, {0, 0, 0}, node};
        scenery.tissues = 3;
        scenery.tissue[1] = {named("fat"), {0.95F, 0.85F, 0.50F}, 0.0F};
        scenery.tissue[2] = {named("artery"), {0.85F, 0.10F, 0.10F}, 1.0F};
        scenery.windows = 2;
        scenery.window[0] = {named("wide"), low, low + perMetre * 40e-3};
        scenery.window[1] = {named("narrow"), 0, 300};
        scenery.imageUnit = named("HU");
        scenery.imageLow = low;
        scenery.imageStep = perMetre * voxel / 100;
        for (int i = 0; i < cubeSide * cubeSide * cubeSide; ++i) {
            const int x = i % cubeSide, y = i / cubeSide % cubeSide, z = i / cubeSide / cubeSide;
            const bool air = z < 5 || z >= cubeSide - 5;
            const std::uint8_t shell = y == 10 ? channel::shellBit : 0;
            labels.push_back(air ? 0 : static_cast<std::uint8_t>((y < 20 ? 1 : 2) | shell));
            codes.push_back(static_cast<std::uint16_t>(100 * x));
        }
    }
    static double valueAt(double x) { return low + perMetre * x; }
    double greyAt(double x, std::uint32_t window) const
    {
        const channel::GreyWindow& w = scenery.window[window];
        return 255 * glm::clamp((valueAt(x) - w.low) / (w.high - w.low), 0.0, 1.0);
    }

    channel::Scenery scenery;
    std::vector<std::uint8_t> labels;
    std::vector<std::uint16_t> codes;
};

TEST(GreyImage, IsExactOnARampAndClipsAtTheWindow)
{
    const Block block;
    GreyImage image(block.scenery, block.codes);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> any(0.1e-3, (cubeSide - 1.1) * voxel);
    for (const std::uint32_t window : {0U, 1U, 0U}) {
        ASSERT_EQ(image.window(), window);
        int black = 0, white = 0;
        for (int k = 0; k < 2000; ++k) {
            const glm::dvec3 p(any(random), any(random), any(random));
            const double expected = block.greyAt(p.x, window);
            ASSERT_NEAR(static_cast<double>(image.at(p)), expected, 0.02);
            black += expected == 0 ? 1 : 0;
            white += expected == 255 ? 1 : 0;
        }
        EXPECT_EQ(black > 100 && white > 100, window == 1);
        image.nextWindow();
    }
    EXPECT_EQ(image.windowName(), "narrow");
    EXPECT_EQ(image.windowRange(), "0 to 300 HU");
    for (const double beyond : {-1e-3, cubeSide * voxel})
        EXPECT_EQ(image.at({0.01, beyond, 0.01}), 0);
}

// A slice of the block across z, one pixel for each `1 / zoom` voxels.
struct Slice {
    explicit Slice(const Block& shown, bool withImage = true, const channel::Displaced* displaced = nullptr)
        : block(shown),
          deformation(shown.scenery, shown.labels),
          grey(shown.scenery, withImage ? std::span<const std::uint16_t>(shown.codes) : std::span<const std::uint16_t>()),
          picture(*renderer)
    {
        if (displaced != nullptr)
            deformation.apply(*displaced);
    }
    void draw(SliceLook look)
    {
        const Anatomy anatomy{block.scenery, deformation, grey, look};
        picture.update(anatomy, frame(), {0, 0, pixels, pixels}, {}, 1);
        picture.paint(anatomy);
    }
    static ViewFrame frame() { return {{1, 0, 0}, {0, -1, 0}, {0, 0, -1}, glm::dvec3(centre, centre, 20e-3), 30e-3}; }
    static glm::dvec3 at(int column, int row)
    {
        const double metres = 30e-3 / pixels;
        return {centre + (column + 0.5 - 0.5 * pixels) * metres, centre - (row + 0.5 - 0.5 * pixels) * metres, 20e-3};
    }
    using Pixel = std::array<std::uint8_t, 3>;
    std::vector<Pixel> image() const
    {
        auto* actor = vtkActor2D::SafeDownCast(renderer->GetViewProps()->GetItemAsObject(0));
        auto* data = static_cast<vtkImageMapper*>(actor->GetMapper())->GetInput();
        const auto* first = static_cast<const Pixel*>(data->GetScalarPointer());
        return {first, first + pixels * pixels};
    }
    Pixel pixelAt(int column, int row) const { return image()[static_cast<std::size_t>(row * pixels + column)]; }

    static constexpr int pixels = 120;
    static constexpr double centre = 19.5e-3;
    const Block& block;
    Deformation deformation;
    GreyImage grey;
    vtkNew<vtkRenderer> renderer;
    SlicePicture picture;
};

void expectGrey(const Slice& slice, const std::vector<Slice::Pixel>& image, double stretch, double levels)
{
    for (int row = 0; row < Slice::pixels; ++row)
        for (int column = 0; column < Slice::pixels; ++column) {
            const auto& pixel = image[static_cast<std::size_t>(row * Slice::pixels + column)];
            ASSERT_TRUE(pixel[0] == pixel[1] && pixel[1] == pixel[2]);
            const double x = Slice::at(column, row).x / (1 + stretch);
            ASSERT_NEAR(pixel[0], slice.block.greyAt(x, slice.grey.window()), levels) << column << " " << row;
        }
}

TEST(SliceOfAnImage, FollowsTheRampToAGreyLevel)
{
    const Block block;
    Slice slice(block);
    slice.draw(SliceLook::image);
    expectGrey(slice, slice.image(), 0, 1);
    const auto before = slice.image();
    slice.grey.nextWindow();
    slice.draw(SliceLook::image);
    EXPECT_NE(slice.image(), before) << "another window is another picture";
    expectGrey(slice, slice.image(), 0, 1);
}

// x = X + g X in the whole block: what is seen at x is the image at x / (1 + g). The fixed point that looks for X ends
// within 3 % of a lattice spacing, here under half a grey level.
TEST(SliceOfAnImage, MovesWithTheTissue)
{
    const Block block;
    for (const double stretch : {-0.05, 0.15}) {
        auto displaced = std::make_unique<channel::Displaced>();
        constexpr std::uint32_t n = cubeSide / 2;
        for (std::uint32_t i = 0; i < n * n * n; ++i)
            displaced->nodes[displaced->count++] = {i, {static_cast<float>(stretch * node * (i % n)), 0, 0}};
        Slice slice(block, true, displaced.get());
        slice.draw(SliceLook::image);
        expectGrey(slice, slice.image(), stretch, 1.5);
    }
}

// The grey under a tint and the tissue's colour are mixed in one proportion for all pixels of a tissue, of the opaque one
// more of its colour than of the clear one, and never all of it.
TEST(SliceOfAnImage, IsTintedByTheTissueAsMuchAsThatIsOpaque)
{
    const Block block;
    Slice slice(block);
    slice.draw(SliceLook::tinted);
    const auto tinted = slice.image();
    slice.draw(SliceLook::tissue);
    const auto tissue = slice.image();
    slice.draw(SliceLook::image);
    const auto grey = slice.image();
    std::array<std::array<double, 2>, 3> fraction{};  // per tissue: least and largest
    fraction.fill({1, 0});
    for (std::size_t i = 0; i < grey.size(); ++i) {
        const glm::dvec3 p = Slice::at(static_cast<int>(i) % Slice::pixels, static_cast<int>(i) / Slice::pixels);
        if (std::abs(p.y - 10e-3) < 1.6e-3 || std::abs(p.y - 19.5e-3) < 1.1e-3)  // shell, border
            continue;
        for (std::size_t k = 0; k < 3; ++k) {
            const int apart = tissue[i][k] - grey[i][k];
            if (std::abs(apart) < 60)
                continue;
            auto& [least, most] = fraction[p.y < 19.5e-3 ? 1 : 2];
            const double part = static_cast<double>(tinted[i][k] - grey[i][k]) / apart;
            least = std::min(least, part);
            most = std::max(most, part);
        }
    }
    constexpr double rounding = 2.0 / 60;
    EXPECT_LT(fraction[1][1] - fraction[1][0], rounding);
    EXPECT_LT(fraction[2][1] - fraction[2][0], rounding);
    EXPECT_GT(fraction[1][0], 0.05);
    EXPECT_GT(fraction[2][0], fraction[1][1] + 0.2);
    EXPECT_LT(fraction[2][1], 0.8);
}

TEST(SliceOfAnImage, KeepsTheShellsUnlessTheImageIsAlone)
{
    const Block block;
    Slice slice(block);
    const int row = static_cast<int>((Slice::centre - 10e-3) / (30e-3 / Slice::pixels) + 0.5 * Slice::pixels);
    const auto isShell = [&] {
        const Slice::Pixel pixel = slice.pixelAt(60, row);
        bool same = true;
        for (std::size_t k = 0; k < 3; ++k)
            same = same && std::abs(pixel[k] - 255 * shellColour[k]) < 1;
        return same;
    };
    slice.draw(SliceLook::tissue);
    EXPECT_TRUE(isShell());
    slice.draw(SliceLook::tinted);
    EXPECT_TRUE(isShell());
    slice.draw(SliceLook::image);
    EXPECT_FALSE(isShell());
}

// Without an image every look is the tissue's colours, the same as with one and the look `tissue`.
TEST(SliceOfAnImage, WithoutOneIsTheTissuesColours)
{
    const Block block;
    Slice with(block), without(block, false);
    with.draw(SliceLook::tissue);
    for (const SliceLook look : {SliceLook::tissue, SliceLook::tinted, SliceLook::image}) {
        without.draw(look);
        EXPECT_EQ(without.image(), with.image());
    }
    const Slice::Pixel fat = with.pixelAt(60, 100), artery = with.pixelAt(60, 20);
    EXPECT_EQ(fat, (Slice::Pixel{242, 217, 128}));
    EXPECT_EQ(artery, (Slice::Pixel{217, 26, 26}));
}

// Whether a shape of a canvas has this colour.
bool shows(vtkRenderer& renderer, const Colour& colour)
{
    auto* actor = vtkActor2D::SafeDownCast(renderer.GetViewProps()->GetItemAsObject(0));
    vtkPolyData& shapes = *static_cast<vtkPolyDataMapper2D*>(actor->GetMapper())->GetInput();
    const Pixel wanted = pixelOf(colour);
    for (vtkIdType i = 0; i < shapes.GetNumberOfCells(); ++i) {
        const double* const own = shapes.GetCellData()->GetScalars()->GetTuple(i);
        if (near({static_cast<int>(own[0]), static_cast<int>(own[1]), static_cast<int>(own[2])}, wanted, 1))
            return true;
    }
    return false;
}

// As parts of a needle are: a fingertip over 2 mm off the plane is no hole in what the slice shows.
TEST(SliceOfAnImage, AFingertipOffItsPlaneIsThinnerAndDarker)
{
    Block block;
    Slice slice(block);
    slice.draw(SliceLook::tissue);
    vtkNew<vtkRenderer> renderer;
    Canvas canvas(*renderer);
    channel::Scenery scenery = block.scenery;
    scenery.toolRadius = 4e-3;
    for (const channel::ToolKind tool : {channel::ToolKind::sphere, channel::ToolKind::capsule})
        for (const double off : {1.5e-3, 2.5e-3}) {
            scenery.tool = tool;
            channel::State state;
            state.tip = {Slice::centre, Slice::centre, 20e-3 + off};
            state.axis = {0, 1, 0};
            canvas.begin();
            slice.picture.annotate(canvas, {scenery, slice.deformation, slice.grey, SliceLook::tissue}, state, {}, 10);
            canvas.end();
            EXPECT_EQ(shows(*renderer, toolColour), off < 2e-3) << static_cast<int>(tool);
        }
}

}  // namespace
}  // namespace palpate::render
