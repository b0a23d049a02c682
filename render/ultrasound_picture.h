#pragma once

#include <channel/layout.h>
#include <render/canvas.h>
#include <render/scan_thread.h>
#include <render/screen_plan.h>

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace palpate::render {

/// What a key of the console turns. `tgc` and seven more: the sliders from the top on.
enum class Knob : std::uint8_t { depth, gain, focus, frequency, dynamicRange, tgc };

/// The ultrasound picture in the window, with the console of its scanner.
class UltrasoundPicture {
public:
    explicit UltrasoundPicture(vtkRenderer& renderer);

    /// Begins to scan a session's body.
    void open(const channel::Scenery& scenery, std::span<const std::uint8_t> labels, std::span<const std::uint8_t> fine,
              const std::string& session);
    void close();
    bool opened() const noexcept { return scan_ != nullptr; }
    /// What there is to see now; `shape` is null when it is as before.
    void see(const channel::State& state, const channel::Displaced* shape);
    /// In `area`, and black in all of `around`, which holds it. `exact`: waits for the picture of what was seen last.
    /// `told`: with its scale, settings and measures.
    void draw(Canvas& canvas, const Area& area, const Area& around, double font, bool exact, bool told = true);
    void hide();

    /// `slider`: of Knob::tgc, from 0.
    void turn(Knob knob, int steps, int slider = 0);
    void levelTgc();
    void toggleFreeze();
    bool frozen() const noexcept { return frozen_; }
    /// Through the pictures before the freeze: -1 one back.
    void stepCine(int pictures);
    void toggleGuide() noexcept { guide_ = !guide_; }
    void mirror() noexcept { mirrored_ = !mirrored_; }
    void changeProbe();
    void moveProbe(const ultrasound::ProbeMove& move);
    /// Whether a pixel of the window (from the lower left) lies on the picture.
    bool holds(Point2 pixel) const noexcept { return area_.holds(pixel); }
    void beginCaliper(Point2 pixel);
    void dragCaliper(Point2 pixel);
    void endCaliper();
    void clearCalipers() { calipers_.clear(); }
    /// Writes the picture beside those before into `folder`. False where there is none, or it cannot be written.
    bool store(const std::filesystem::path& folder);

    std::optional<ScanFigures> figures() const { return scan_ ? std::optional(scan_->figures()) : std::nullopt; }

private:
    using Ends = std::array<glm::vec2, 2>;  // lateral, axial [m]

    void ask() { scan_->ask(console_->first, console_->second); }
    ScanThread::Image shown() const;
    void convert(const ultrasound::BeamImage* image);
    ultrasound::Layout layout(const ultrasound::BeamImage& image) const;
    Point2 pixel(const ultrasound::BeamImage& image, glm::vec2 at) const;
    void drawScale(Canvas& canvas, const ultrasound::BeamImage& image, double font) const;
    void drawConsole(Canvas& canvas, const ultrasound::BeamImage& image, double font) const;
    void drawGuide(Canvas& canvas, const ultrasound::BeamImage& image) const;
    void drawCalipers(Canvas& canvas, const ultrasound::BeamImage& image, double font) const;

    vtkNew<vtkImageData> image_;
    vtkNew<vtkActor2D> actor_;
    std::unique_ptr<ScanThread> scan_;
    std::string session_;
    channel::Scenery scenery_;
    std::optional<std::pair<ultrasound::Transducer, ultrasound::Settings>> console_;  // once somebody turned a knob
    ultrasound::ScanConverter converter_;
    ultrasound::Pixels pixels_;
    ScanThread::Image drawn_;  // what image_ holds
    bool drawnMirrored_ = false;
    Area area_, around_;
    bool frozen_ = false, guide_ = true, mirrored_ = false;
    std::deque<ScanThread::Image> cine_;
    std::size_t cineAt_ = 0;
    std::vector<Ends> calipers_;
    std::string message_;
};

}  // namespace palpate::render
