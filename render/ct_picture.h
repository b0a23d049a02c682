#pragma once

#include <channel/deformation.h>
#include <channel/layout.h>
#include <ct/scanner.h>
#include <render/canvas.h>
#include <render/recorded.h>
#include <render/screen_plan.h>

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace palpate::render {

/// How the last CT scan is drawn.
struct CtLook {
    bool exact = false;       // waits for a scan that has begun
    bool handIsHere = false;  // this window takes scans
};

/// The last CT scan in the window: the slice through the needle's tip large, the others beside it, and the dose so far.
class CtPicture {
public:
    explicit CtPicture(vtkRenderer& renderer);

    /// Of a session whose scene has CT.
    void open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint16_t> image);
    void close();
    bool opened() const noexcept { return scanner_.has_value(); }
    /// Begins a scan when the hand has asked for one since the last look. `shape`: the last that came. In a record the scan
    /// is of the tick at which it was asked for.
    void see(const channel::State& state, const channel::Displaced& shape, const Recorded* recorded = nullptr);
    void draw(Canvas& canvas, const Area& area, const Area& around, double font, const CtLook& look);
    void hide();
    void nextWindow() noexcept;

private:
    void take(bool wait);
    void scan(const channel::State& state, std::span<const channel::Displacement> shape);
    Area tile(std::size_t slice) const;
    void paint();
    const char* whyEmpty(bool handIsHere) const;
    std::vector<std::string> caption(const Canvas& canvas, double wide, double font) const;
    static void label(Canvas& canvas, Point2 at, const std::string& words, double size, Align align = Align::left);
    void drawLabels(Canvas& canvas, double font) const;

    vtkNew<vtkImageData> image_;
    vtkNew<vtkActor2D> actor_;
    channel::Scenery scenery_;
    // Of the thread that scans, while there is one.
    std::optional<ct::Scanner> scanner_;
    std::unique_ptr<channel::Deformation> body_;
    std::unique_ptr<channel::Displaced> shape_;

    std::future<ct::Scan> coming_;
    std::optional<ct::Scan> scan_;
    std::uint64_t tick_ = 0;   // of the last scan that was asked for
    std::uint32_t taken_ = 0;  // scans so far
    std::size_t window_ = 0;
    Area area_, around_;
    bool due_ = false;  // the image is not that of the scan
};

}  // namespace palpate::render
