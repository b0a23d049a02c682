#pragma once

#include <render/picture.h>

#include <channel/needle_shape.h>
#include <render/display.h>
#include <tests/render/body.h>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkRenderWindow.h>
#include <vtkRendererCollection.h>
#include <vtkWindowToImageFilter.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace palpate::render {

inline constexpr int width = 960, height = 720;

using Pixel = std::array<int, 3>;

inline bool near(const Pixel& a, const Pixel& b, int tolerance)
{
    return std::abs(a[0] - b[0]) <= tolerance && std::abs(a[1] - b[1]) <= tolerance && std::abs(a[2] - b[2]) <= tolerance;
}

inline Pixel pixelOf(const Colour& colour)
{
    const auto byte = [](double c) { return static_cast<int>(std::lround(255 * c)); };
    return {byte(colour[0]), byte(colour[1]), byte(colour[2])};
}

struct Image {
    int wide = 0, high = 0;
    std::vector<std::uint8_t> bytes;

    Pixel at(int x, int y) const
    {
        const std::size_t i =
            3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(wide) + static_cast<std::size_t>(x));
        return {bytes[i], bytes[i + 1], bytes[i + 2]};
    }
    int count(const Area& area, const Pixel& colour, int tolerance) const
    {
        int found = 0;
        for (int y = area.y; y < area.y + area.height; ++y)
            for (int x = area.x; x < area.x + area.width; ++x)
                found += near(at(x, y), colour, tolerance) ? 1 : 0;
        return found;
    }
    int differing(const Image& other, const Area& area) const
    {
        int found = 0;
        for (int y = area.y; y < area.y + area.height; ++y)
            for (int x = area.x; x < area.x + area.width; ++x)
                found += near(at(x, y), other.at(x, y), 12) ? 0 : 1;
        return found;
    }
};

// One body and one window for all tests: both are slow to make.
class Studio {
public:
    explicit Studio(int voxels = 104) : scenery(bodyScenery(voxels, 0.104 / voxels)), labels(bodyLabels(scenery))
    {
        if (!displayWorks())
            display_.emplace();
        window_->SetShowWindow(false);
        window_->SetOffScreenRendering(1);
        window_->SetMultiSamples(0);
        window_->SetSize(width, height);
        picture_ = std::make_unique<Picture>(*window_);
    }
    ~Studio()
    {
        picture_.reset();
        window_->Finalize();
    }

    // The story at `t`, told from its beginning; without the body's deformation where `rigid`.
    Image take(double t, Layout layout, bool rigid = false, const std::string& file = {})
    {
        picture_->open(scenery, labels, "story");
        picture_->show(layout);
        picture_->resetView();
        constexpr double step = 0.05;
        for (double then = 0; then < t; then += step)
            picture_->note(storyState(scenery, then));
        auto displaced = std::make_unique<channel::Displaced>();
        storyDisplaced(scenery, t, *displaced);
        picture_->update(storyState(scenery, t), rigid ? nullptr : displaced.get(), {30, 0.02, 1000});
        picture_->render(Quality::still);
        return grab(file);
    }
    Image grab(const std::string& file = {})
    {
        vtkNew<vtkWindowToImageFilter> grab;
        grab->SetInput(window_);
        grab->SetInputBufferTypeToRGB();
        grab->ReadFrontBufferOff();
        grab->ShouldRerenderOff();
        grab->Update();
        // PALPATE_PICTURES: a folder to keep the pictures in, to look at them.
        if (const char* folder = std::getenv("PALPATE_PICTURES"); folder != nullptr && !file.empty()) {
            vtkNew<vtkPNGWriter> writer;
            writer->SetInputConnection(grab->GetOutputPort());
            writer->SetFileName((std::filesystem::path(folder) / (file + ".png")).c_str());
            writer->Write();
        }
        vtkImageData& data = *grab->GetOutput();
        Image image{data.GetDimensions()[0], data.GetDimensions()[1], {}};
        const auto* first = static_cast<const std::uint8_t*>(data.GetScalarPointer());
        image.bytes.assign(first, first + 3 * static_cast<std::size_t>(image.wide) * static_cast<std::size_t>(image.high));
        return image;
    }
    // Where the 3-D view shows `p` [m].
    glm::dvec2 project(glm::dvec3 p) const
    {
        vtkRenderer& view = *window_->GetRenderers()->GetFirstRenderer();
        view.SetWorldPoint(1e3 * p.x, 1e3 * p.y, 1e3 * p.z, 1);
        view.WorldToDisplay();
        return {view.GetDisplayPoint()[0], view.GetDisplayPoint()[1]};
    }
    Picture& picture() { return *picture_; }
    void resize(int wide, int high) { window_->SetSize(wide, high); }

    const channel::Scenery scenery;
    const std::vector<std::uint8_t> labels;

private:
    std::optional<PrivateDisplay> display_;
    vtkNew<vtkRenderWindow> window_;
    std::unique_ptr<Picture> picture_;
};

inline constexpr std::array<std::pair<Layout, const char*>, 2> layouts{
    {{Layout::trainee, "trainee"}, {Layout::instructor, "instructor"}}};

}  // namespace palpate::render
