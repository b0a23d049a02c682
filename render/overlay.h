#pragma once

#include <channel/layout.h>
#include <render/canvas.h>
#include <render/events.h>
#include <render/palette.h>
#include <render/screen_plan.h>

#include <cstdint>
#include <deque>
#include <span>
#include <string>

namespace palpate::render {

inline constexpr Colour white{0.95, 0.96, 0.98}, grey{0.62, 0.66, 0.72}, dark{0.20, 0.22, 0.27};
inline constexpr Colour good{0.45, 0.85, 0.50}, amber{1.0, 0.75, 0.15}, red{1.0, 0.30, 0.25};
inline constexpr Colour panelColour{0.09, 0.10, 0.13};
inline constexpr Colour cardColour{0.05, 0.06, 0.09};  // behind words that lie on a picture
inline constexpr Colour basicColour{0.35, 0.65, 1.0}, additionalColour{0.75, 0.55, 1.0};

/// How well viewer and simulation keep up.
struct Health {
    double framesPerSecond = 0;
    double delay = 0;     // from the tick to its picture [s]; 0: what is shown stands still
    double tickRate = 0;  // [Hz]
};

/// The tissues that there are.
struct Legend {
    std::span<const std::uint8_t> rows;
    int chosen = -1;   // row whose opacity is being changed; -1: none
    float factor = 1;  // of its opacity
    Palette palette = Palette::standard;
    bool ghost = false;  // another session's tool is shown
    bool marks = false;  // places are marked
    double below = 1e9;  // of what stands above it [pixels from the lower edge]
};

/// A key and what it does.
struct KeyHelp {
    std::string key, what;
};

/// Forces, distances with times to contact, phase, core, health; what has no room is left out from the end. `targetHidden`:
/// nothing of the target, which is to be found.
void drawFigures(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state,
                 const Health& health, bool targetHidden);
void drawLegend(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const Legend& legend);
/// The last ones first.
void drawEvents(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const std::deque<Event>& events);

}  // namespace palpate::render
