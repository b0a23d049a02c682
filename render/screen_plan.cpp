#include <render/screen_plan.h>

#include <algorithm>
#include <cmath>

namespace palpate::render {
namespace {

constexpr double figureLines = 16.8;  // that forces, needle and distances take

void planTrainee(ScreenPlan& plan)
{
    const int column =
        std::max(static_cast<int>(0.35 * plan.width), std::min(static_cast<int>(21 * plan.font), plan.width / 2));
    const int figures = std::min(plan.height, static_cast<int>(figureLines * lineHeight * plan.font));
    plan.view = {0, 0, plan.width - column, plan.height};
    plan.panel = {plan.width - column, 0, column, figures};
    plan.slices[0] = {plan.width - column, figures, column, plan.height - figures};
    if (plan.slices[0].height < 4 * lineHeight * plan.font)
        plan.slices[0] = {};
    plan.health = {0, 0, plan.view.width, static_cast<int>(3 * plan.font)};
    // It lies over the body: in a narrow view over nearly all of its width.
    const double high = plan.view.width < 20 * plan.font ? 0.3 : 0.5;
    plan.legend = {0, static_cast<int>(2.8 * plan.font), plan.view.width, static_cast<int>(high * plan.height)};
    plan.banner = {0, plan.height - static_cast<int>(6.3 * plan.font), plan.view.width, 0};
}

void planInstructor(ScreenPlan& plan)
{
    const int column =
        std::max(static_cast<int>(0.30 * plan.width), std::min(static_cast<int>(21 * plan.font), plan.width / 2));
    const int left = plan.width - column;
    const int figures = std::min(plan.height, static_cast<int>(figureLines * lineHeight * plan.font));
    plan.panel = {left, 0, column, figures};
    // Legend above the figures, as far as there is room; events above it.
    const int above = plan.height - figures, legend = 3 * above / 5;
    plan.legend = {left, figures, column, legend};
    plan.events = {left, figures + legend, column, above - legend};
    const int traces = static_cast<int>(0.30 * plan.height), upper = plan.height - traces;
    plan.forces = {0, 0, left / 2, traces};
    plan.distances = {left / 2, 0, left - left / 2, traces};
    const int wide = left / 2, tall = upper / 2;
    plan.slices[0] = {0, traces + tall, wide, upper - tall};
    plan.slices[1] = {wide, traces + tall, left - wide, upper - tall};
    plan.slices[2] = {0, traces, wide, tall};
    plan.view = {wide, traces, left - wide, tall};
    plan.health = {left, 0, column, static_cast<int>(3 * plan.font)};
    plan.banner = {0, plan.height - static_cast<int>(6.3 * plan.font), left, 0};
}

}  // namespace

ScreenPlan::ScreenPlan(int windowWidth, int windowHeight, Layout layout, double scale, bool scanned)
    : width(windowWidth),
      height(windowHeight),
      font(std::max(10.0 * std::max(scale, 1.0), std::round(13.0 * std::min(windowWidth / 800.0, windowHeight / 600.0))))
{
    if (layout == Layout::body)
        view = {0, 0, width, height};
    else if (layout == Layout::instructor)
        planInstructor(*this);
    else
        planTrainee(*this);
    title = view;
    if (scanned && layout == Layout::instructor) {
        ultrasound = slices[2];
        slices[2] = {};
    } else if (scanned) {
        // Large, and the body in the place of the slice; without a place for that the picture has the whole.
        ultrasound = view;
        // Title, caption, step and what is wrong stand above it: nothing hides where the needle comes in. In a narrow view,
        // or one of longer words (German), caption and step take two lines each.
        const int upper = static_cast<int>((view.width < 46 * font ? 9.2 : 8.2) * font), lower = static_cast<int>(3 * font);
        ultrasound.y += lower;
        ultrasound.height = std::max(ultrasound.height - upper - lower, 1);
        view = slices[0].empty() ? Area{panel.x, panel.y + panel.height - 1, panel.width, 1} : slices[0];
        slices[0] = {};
        legend = {};
    }
}

}  // namespace palpate::render
