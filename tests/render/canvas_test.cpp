#include <render/canvas.h>
#include <render/display.h>
#include <render/history.h>
#include <render/traces.h>
#include <tests/render/body.h>

#include <gtest/gtest.h>

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderWindow.h>
#include <vtkWindowToImageFilter.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace palpate::render {
namespace {

class CanvasTest : public testing::Test {
protected:
    CanvasTest()
    {
        if (!displayWorks())
            display_.emplace();
        window_->SetShowWindow(false);
        window_->SetOffScreenRendering(1);
        window_->SetSize(400, 60);
        window_->AddRenderer(renderer_);
    }
    ~CanvasTest() override { window_->Finalize(); }

    // How bright a picture of these words is, all pixels together. `after`: they are not the first of the picture.
    double lightOf(Canvas& canvas, const std::string& words, double size, const Colour& colour, bool bold,
                   bool after = false)
    {
        canvas.begin();
        if (after)
            canvas.text({390, 50}, ".", 9, {0.2, 0.2, 0.2});
        canvas.text({5, 20}, words, size, colour, Align::left, bold);
        canvas.end();
        return light();
    }
    double light()
    {
        window_->Render();
        vtkNew<vtkWindowToImageFilter> grab;
        grab->SetInput(window_);
        grab->ReadFrontBufferOff();
        grab->Update();
        double light = 0;
        const auto* bytes = static_cast<const unsigned char*>(grab->GetOutput()->GetScalarPointer());
        for (vtkIdType i = 0; i < 3 * grab->GetOutput()->GetNumberOfPoints(); ++i)
            light += bytes[i];
        return light;
    }

    std::optional<PrivateDisplay> display_;
    vtkNew<vtkRenderWindow> window_;
    vtkNew<vtkRenderer> renderer_;
};

// More looks than VTK keeps faces of come in between, as with every size of a window. What was not drawn before in the
// bold look must be bold as well.
TEST_F(CanvasTest, BoldStaysBoldWhateverElseIsWritten)
{
    constexpr double size = 17;
    constexpr Colour first{1, 1, 1}, second{1, 1, 0.99};
    Canvas canvas(*renderer_);
    const double thin = lightOf(canvas, "push along the needle", size, {1, 0.99, 1}, false);
    lightOf(canvas, "0123", size, first, true);
    for (int look = 0; look < 80; ++look)
        lightOf(canvas, "other words", 9 + look % 8, {0.1 + 0.01 * look, 0.5, 0.5}, false);
    const double later = lightOf(canvas, "push along the needle", size, first, true, true);
    const double fresh = lightOf(canvas, "push along the needle", size, second, true, true);
    EXPECT_GT(fresh, 1.1 * thin);
    EXPECT_NEAR(later, fresh, 0.03 * fresh);
}

// What lies beyond 40 mm is no flat line at 40 mm: there is a gap, as for what has no distance.
TEST_F(CanvasTest, ATraceHasGapsAboveItsUpperEdge)
{
    window_->SetSize(400, 200);
    Canvas canvas(*renderer_);
    channel::Scenery scenery;
    scenery.structures = 1;
    const auto lightAt = [&](float before, float after) {
        History history;
        for (int i = 0; i < 100; ++i) {
            history.moments.emplace_back();
            history.moments.back().time = 0.1 * i;
            history.moments.back().distance[0] = i < 50 ? before : after;
        }
        canvas.begin();
        drawDistanceTraces(canvas, {0, 0, 400, 200}, 10, scenery, history);
        canvas.end();
        return light();
    };
    const double none = lightAt(INFINITY, INFINITY);
    EXPECT_EQ(lightAt(60e-3F, 45e-3F), none);
    EXPECT_GT(lightAt(20e-3F, 20e-3F), none);
    EXPECT_GT(lightAt(60e-3F, 20e-3F), none);
    EXPECT_LT(lightAt(60e-3F, 20e-3F), lightAt(20e-3F, 20e-3F));
}

// As wide as in the instructor's layout at 1024 x 768.
TEST_F(CanvasTest, EveryTraceHasItsName)
{
    window_->SetSize(400, 240);
    Canvas canvas(*renderer_);
    channel::Scenery scenery;
    scenery.structures = 4;
    const std::vector<std::string> names{"lesion", "portal and splenic vein", "inferior vena cava", "gallbladder"};
    for (std::size_t s = 0; s < names.size(); ++s)
        scenery.structure[s] = named(names[s]);
    canvas.begin();
    drawDistanceTraces(canvas, {0, 0, 347, 230}, 17, scenery, {});
    canvas.end();
    for (const std::string& name : names) {
        const auto all = canvas.written();
        const auto at = std::ranges::find(all, name, &Written::words);
        ASSERT_NE(at, all.end()) << name;
        EXPECT_LE(at->high[0], 347) << name;
    }
}

}  // namespace
}  // namespace palpate::render
