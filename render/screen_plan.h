#pragma once

#include <array>
#include <cstdint>

namespace palpate::render {

/// `trainee`: the body large, the slice through the needle, figures. `instructor`: three orthogonal slices through the tip,
/// a small body, traces of the last seconds, events, figures. `body`: the body alone, without a word.
enum class Layout : std::uint8_t { trainee, instructor, body };

/// What a slice shows of a body that came with an intensity image: the colours of its tissues, the image tinted with them,
/// or the image alone. Without an image it is always the first.
enum class SliceLook : std::uint8_t { tissue, tinted, image };

/// A rectangle of the window [pixels], from the lower left.
struct Area {
    int x = 0, y = 0, width = 0, height = 0;

    bool empty() const noexcept { return width <= 0 || height <= 0; }
    bool holds(const std::array<double, 2>& p) const noexcept
    {
        return p[0] >= x && p[1] >= y && p[0] < x + width && p[1] < y + height;
    }
    bool operator==(const Area&) const = default;
};

/// Where things are in a window of `width` x `height` pixels. What the window is too small for has an empty area.
struct ScreenPlan {
    /// `scale`: pixels per point of the screen, from 1.
    /// `scanned`: with the ultrasound picture.
    ScreenPlan(int windowWidth, int windowHeight, Layout layout = Layout::trainee, double scale = 1, bool scanned = false);

    int width, height;
    double font;                 // [pixels]
    Area view;                   // 3-D
    std::array<Area, 3> slices;  // trainee: the first only
    Area ultrasound;             // only where it is shown
    Area panel;                  // figures
    Area events, forces, distances;
    Area title;                   // scene and session stand in its upper left corner
    Area legend, health, banner;  // banner: the left and right ends and the baseline of warnings
};

inline constexpr double lineHeight = 1.42;  // in fonts

}  // namespace palpate::render
