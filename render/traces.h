#pragma once

#include <channel/layout.h>
#include <render/canvas.h>
#include <render/history.h>
#include <render/screen_plan.h>

namespace palpate::render {

/// Forces on the hand against the limit, and distances of the tip, over the last traceSeconds.
void drawForceTraces(Canvas& canvas, const Area& area, double font, const channel::Scenery& scenery,
                     const History& history);
void drawDistanceTraces(Canvas& canvas, const Area& area, double font, const channel::Scenery& scenery,
                        const History& history);

}  // namespace palpate::render
