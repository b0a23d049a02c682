#pragma once

#include <channel/layout.h>
#include <render/canvas.h>
#include <render/coach.h>
#include <render/overlay.h>
#include <render/screen_plan.h>

#include <string>
#include <vector>

namespace palpate::render {

/// What a session came to, as its window tells it at the end.
struct ResultCard {
    double total = 0;                 // points of 100
    std::vector<std::string> parts;   // "Core 38 of 50"
    std::vector<std::string> losses;  // the largest first: "-12   The core missed the tumour by 14 mm, towards the feet"
};

/// What stands above the body: title, time, caption with the bar of a record, step, what is wrong, warning. One below the
/// other, each broken into as many lines as it takes: nothing lies on anything else.
struct Header {
    std::string title, session, caption;
    double timeline = -1;  // how much of a record is over, in [0, 1]; negative: no record
    Coaching coaching;
    bool keysListed = false;  // below it
};

/// Words broken into lines of at most `width` pixels.
std::vector<std::string> wrapped(const Canvas& canvas, const std::string& words, double size, bool bold, double width);

struct HeaderPlaces {
    Area step;          // where the words of the step are; empty: there are none
    Area timeline;      // the bar of a record; empty: there is none
    double bottom = 0;  // of all of it [pixels]
};

/// Where there is no room for all, it has first the warning, then the step, what is wrong, the caption; of a record the
/// caption before the step.
HeaderPlaces drawHeader(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery,
                        const channel::State& state, const Header& header);
/// Words across the picture: "waiting for session x", "simulation ended".
void drawNotice(Canvas& canvas, const ScreenPlan& plan, const std::string& words, const std::string& smaller);
/// In the place of a notice when the session is over.
void drawResult(Canvas& canvas, const ScreenPlan& plan, const ResultCard& result, const std::string& smaller);
/// Lists keys. Returns whether that takes the whole window, below title, caption and warning: nothing else has room there.
bool drawHelp(Canvas& canvas, const ScreenPlan& plan, std::span<const KeyHelp> keys);

}  // namespace palpate::render
