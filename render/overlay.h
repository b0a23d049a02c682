#pragma once

#include <render/canvas.h>
#include <render/channel/layout.h>
#include <render/slice_picture.h>

#include <cstdint>
#include <span>
#include <string>

namespace palpate::render {

/// Where things are in a window of `width` x `height` pixels.
struct ScreenPlan {
    ScreenPlan(int windowWidth, int windowHeight);

    int width, height;
    double font;  // [pixels]
    Area view;    // 3-D
    Area slice;   // empty when the window is too small for it
    Area panel;   // figures
};

/// How well viewer and simulation keep up.
struct Health {
    double framesPerSecond = 0;
    double delay = 0;     // from the tick to its picture [s]
    double tickRate = 0;  // [Hz]
};

/// Forces, distances, warning, phase, core, health and the legend of the tissues whose rows are in `legend`.
void drawFigures(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state,
                 const Health& health, const std::string& session, std::span<const std::uint8_t> legend);
/// Words across the picture: "waiting for session x", "simulation ended".
void drawNotice(Canvas& canvas, const ScreenPlan& plan, const std::string& words, const std::string& smaller);

}  // namespace palpate::render
