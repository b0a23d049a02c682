#pragma once

#include <ultrasound/transducer.h>

#include <glm/vec2.hpp>

#include <cstdint>
#include <vector>

namespace palpate::ultrasound {

/// Grey values along the lines, as the probe gives them, with all that is needed to show them again.
struct BeamImage {
    std::uint64_t tick = 0, shapeTick = 0;  // of the tool, and of the displaced nodes
    Transducer transducer;
    Settings settings;
    Pose pose;
    std::uint64_t body = 0;  // tells bodies apart, see Scanner::body(); 0: not known
    bool needled = false;    // a needle is inside, with its tip [m] and axis:
    glm::dvec3 tip{0.0}, axis{0, 0, 1};
    bool mirrored = false;           // shown with the marked side at the right
    std::vector<std::uint8_t> grey;  // (samples x lines)

    bool empty() const noexcept { return grey.empty(); }
};

/// A picture, rows from the top.
struct Pixels {
    int width = 0, height = 0;
    std::vector<std::uint8_t> grey;
};

/// What a window has around the picture: room for its scale and marks, unless told otherwise [pixels].
struct Margins {
    int above = 10;   // and below
    int beside = 40;  // on both sides
};

/// Where the picture's plane lies in a window of pixels: depth downwards, the marked side at the left, or at the right.
class Layout {
public:
    Layout(const Beam& beam, int width, int height, bool mirrored = false, Margins margins = {});

    /// Pixel (column, row from the top) of a point of the plane [m].
    glm::vec2 pixel(float lateral, float axial) const noexcept;
    /// Point (lateral, axial) [m] of the middle of a pixel.
    glm::vec2 point(float column, float row) const noexcept;
    float pixelsPerMetre() const noexcept { return scale_; }

private:
    float scale_, middle_, above_, top_, left_;
};

/// Scan conversion by a table that is made once for each geometry.
class ScanConverter {
public:
    explicit ScanConverter(Margins margins = {}) : margins_(margins) {}

    void convert(const BeamImage& image, int width, int height, Pixels& out);

private:
    struct Source {
        std::int32_t at = -1;               // sample above and line left of the pixel; -1: outside
        std::uint8_t line = 0, sample = 0;  // weights of the next ones [1/256]
    };
    void makeTable(const Beam& beam, const Layout& layout);

    Margins margins_;
    Settings of_;
    ProbeShape shape_ = ProbeShape::linear;
    bool mirrored_ = false;
    int width_ = 0, height_ = 0;
    std::vector<Source> table_;
};

/// Centimetre scale at the right (long ticks every centimetre), focus, mark of the probe's side.
void drawMarks(const BeamImage& image, Pixels& pixels);

}  // namespace palpate::ultrasound
