#include <render/overlay.h>

#include <render/deformation.h>
#include <render/tool_picture.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

namespace palpate::render {
namespace {

constexpr Colour white{0.95, 0.96, 0.98}, grey{0.62, 0.66, 0.72}, dark{0.20, 0.22, 0.27};
constexpr Colour good{0.45, 0.85, 0.50}, amber{1.0, 0.75, 0.15}, red{1.0, 0.30, 0.25};
constexpr double lineHeight = 1.42;  // in fonts
constexpr double margin = 0.8;       // in fonts

// A name from a table, as words.
std::string text(const channel::Name& name)
{
    std::string words(name.data(), std::find(name.begin(), name.end(), '\0'));
    std::replace(words.begin(), words.end(), '_', ' ');
    return words;
}

std::string millimetres(double metres)
{
    return std::isfinite(metres) ? fmt::format("{:.1f} mm", metres * 1e3) : std::string("-");
}

// Writes lines from the top of an area downwards.
struct Pen {
    Canvas& canvas;
    double left, right, y, font;

    void down(double lines = 1) { y -= lines * lineHeight * font; }
    void heading(const std::string& words)
    {
        down();
        canvas.text({left, y}, words, font, grey, Align::left, true);
    }
    void pair(const std::string& name, const std::string& value, const Colour& colour)
    {
        down();
        canvas.text({left, y}, name, font, colour);
        canvas.text({right, y}, value, font, colour, Align::right);
    }
};

void drawBar(Pen& pen, const std::string& name, double force, double cap, const Colour& colour)
{
    pen.down();
    const double from = pen.left + 5.6 * pen.font, to = pen.right - 4.2 * pen.font;
    const double full = std::max(cap, 0.1), share = std::clamp(force / full, 0.0, 1.0);
    pen.canvas.text({pen.left, pen.y}, name, pen.font, white);
    pen.canvas.rectangle({from, pen.y}, {to - from, pen.font}, dark);
    pen.canvas.rectangle({from, pen.y}, {(to - from) * share, pen.font}, colour);
    pen.canvas.rectangle({to - 2, pen.y - 2}, {2, pen.font + 4}, white);
    pen.canvas.text({pen.right, pen.y}, fmt::format("{:.2f} N", force), pen.font, white, Align::right);
}

void drawForces(Pen& pen, const channel::Scenery& scenery, const channel::State& state)
{
    const double total = glm::length(vec(state.total));
    const bool atCap = total > 0.95 * scenery.forceCap;
    pen.heading(fmt::format("FORCE ON THE HAND  (limit {:.1f} N)", scenery.forceCap));
    drawBar(pen, "basic", glm::length(vec(state.basic)), scenery.forceCap, {0.35, 0.65, 1.0});
    drawBar(pen, "additional", glm::length(vec(state.additional)), scenery.forceCap, {0.75, 0.55, 1.0});
    drawBar(pen, atCap ? "total !" : "total", total, scenery.forceCap, atCap ? red : good);
}

void drawDistances(Pen& pen, const channel::Scenery& scenery, const channel::State& state, int lines)
{
    pen.heading("FROM THE TIP TO");
    const std::size_t count = std::min<std::size_t>(scenery.structures, channel::maxStructures);
    if (count == 0)
        return;
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), 0U);
    // The target stays on top; the rest by distance.
    std::sort(order.begin() + 1, order.end(),
              [&](std::size_t a, std::size_t b) { return state.distance[a] < state.distance[b]; });
    const auto shown = std::min(count, static_cast<std::size_t>(lines));
    for (std::size_t i = 0; i < shown; ++i) {
        const std::size_t s = order[i];
        const double distance = state.distance[s];
        const std::string name = text(scenery.structure[s]);
        if (i + 1 == shown && shown < count)
            pen.pair(fmt::format("{} and {} more", name, count - shown), millimetres(distance), grey);
        else if (s == 0)
            pen.pair(name + " (target)", distance <= 0 ? "INSIDE" : millimetres(distance), good);
        else if (distance <= 0)
            pen.pair(name + "  TOUCHED", millimetres(distance), red);
        else if (distance < scenery.warnDistance[s])
            pen.pair(name + "  NEAR", millimetres(distance), amber);
        else
            pen.pair(name, millimetres(distance), white);
    }
}

std::string phaseWords(const channel::State& state)
{
    switch (state.phase) {
        case channel::Phase::contact:
            return "touching the skin";
        case channel::Phase::inserted:
            return fmt::format("inserted {:.1f} mm", state.inserted * 1e3);
        case channel::Phase::free:
            break;
    }
    return "in the air";
}

void drawProgress(Pen& pen, const channel::Scenery& scenery, const channel::State& state)
{
    pen.heading("NEEDLE");
    const bool known = state.tissue > 0 && state.tissue < scenery.tissues;
    pen.pair(phaseWords(state), known ? "tip in " + text(scenery.tissue[state.tissue].name) : std::string(), white);
    if (state.aheadTissue > 0 && state.aheadTissue < scenery.tissues)
        pen.pair("ahead: " + text(scenery.tissue[state.aheadTissue].name), millimetres(state.aheadTissueDistance), grey);
    if (state.cores > 0)
        pen.pair(fmt::format("core {}: {:.0f} % target", state.cores, 100 * state.coreTarget),
                 fmt::format("{:.1f} mm of it", state.coreLength * 1e3), state.coreTarget > 0 ? good : amber);
    else
        pen.pair("no core taken yet", "", grey);
}

void drawWarning(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state)
{
    const std::size_t s = std::min<std::size_t>(state.warned, channel::maxStructures - 1);
    std::string words;
    Colour colour = amber;
    if (state.status == channel::Status::faulted) {
        words = "FAULT: forces are off";
        colour = red;
    } else if (state.warning == channel::Warning::touching) {
        words = "STOP: touching " + text(scenery.structure[s]);
        colour = red;
    } else if (state.warning != channel::Warning::none) {
        words = fmt::format("{}: {} at {}", state.warning == channel::Warning::near ? "CAREFUL" : "VERY NEAR",
                            text(scenery.structure[s]), millimetres(state.distance[s]));
    } else {
        return;
    }
    const double size = 1.35 * plan.font, middle = plan.view.x + 0.5 * plan.view.width;
    const double width = std::min(0.66 * size * static_cast<double>(words.size()) + 2 * size, 0.96 * plan.view.width);
    const double y = plan.height - 6.3 * plan.font;
    canvas.rectangle({middle - width / 2, y - 0.4 * size}, {width, 1.9 * size}, colour);
    canvas.text({middle, y}, words, size, {0.05, 0.05, 0.05}, Align::centre, true);
}

void drawLegend(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery,
                std::span<const std::uint8_t> legend)
{
    const double font = 0.95 * plan.font, x = margin * plan.font, bottom = 2.6 * plan.font, row = 1.35 * font;
    struct Entry {
        Colour colour;
        std::string name;
    };
    std::vector<Entry> entries{{toolColour, scenery.tool == channel::ToolKind::needle ? "needle" : "probe"},
                               {planColour, "planned line, aim"}};
    const auto room = std::max(3, static_cast<int>(0.45 * plan.height / row));
    for (const std::uint8_t tissue : legend) {
        if (static_cast<int>(entries.size()) + 1 >= room) {
            entries.push_back({dark, "and more"});
            break;
        }
        const auto& c = scenery.tissue[tissue].colour;
        entries.push_back({{c[0], c[1], c[2]}, text(scenery.tissue[tissue].name)});
    }
    std::size_t longest = 0;
    for (const Entry& entry : entries)
        longest = std::max(longest, entry.name.size());
    const double high = row * static_cast<double>(entries.size()),
                 wide = 0.6 * font * static_cast<double>(longest) + 2.2 * font;
    canvas.rectangle({x - 0.4 * font, bottom - 0.4 * font}, {wide, high + 0.4 * font}, {0.06, 0.07, 0.10}, 0.6);
    double y = bottom;
    for (const Entry& entry : entries) {
        canvas.rectangle({x, y}, {font, font}, entry.colour);
        canvas.text({x + 1.5 * font, y - 1}, entry.name, font, white);
        y += row;
    }
}

}  // namespace

ScreenPlan::ScreenPlan(int windowWidth, int windowHeight) : width(windowWidth), height(windowHeight)
{
    font = std::max(10.0, std::round(13.0 * std::min(width / 800.0, height / 600.0)));
    const int column = static_cast<int>(0.4 * width);
    const int figures = std::min(height, static_cast<int>(16.4 * lineHeight * font));
    view = {0, 0, width - column, height};
    panel = {width - column, 0, column, figures};
    slice = {width - column, figures, column, height - figures};
    if (slice.height < 4 * lineHeight * font)
        slice = {};
}

void drawFigures(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state,
                 const Health& health, const std::string& session, std::span<const std::uint8_t> legend)
{
    const double font = plan.font, edge = margin * font;
    canvas.rectangle({static_cast<double>(plan.panel.x), 0},
                     {static_cast<double>(plan.panel.width), static_cast<double>(plan.panel.height)}, {0.09, 0.10, 0.13});
    Pen pen{canvas, plan.panel.x + edge, plan.panel.x + plan.panel.width - edge,
            static_cast<double>(plan.panel.height) - 0.2 * font, font};
    drawForces(pen, scenery, state);
    pen.down(0.3);
    drawProgress(pen, scenery, state);
    pen.down(0.3);
    constexpr int distanceLines = 7;
    drawDistances(pen, scenery, state, distanceLines);

    canvas.text({edge, plan.height - 1.8 * font}, text(scenery.scene), 1.25 * font, white, Align::left, true);
    canvas.text({edge, plan.height - 3.2 * font}, fmt::format("session {}   {:.1f} s", session, state.time), font, grey);
    drawWarning(canvas, plan, scenery, state);
    drawLegend(canvas, plan, scenery, legend);
    std::string line = fmt::format("{} ticks missed", state.missed);
    if (health.tickRate > 0 && state.tickP99 > 0)
        line = fmt::format("{:.0f} ticks/s, 99 % within {:.0f} us, {} missed", health.tickRate, state.tickP99 * 1e6,
                           state.missed);
    if (health.framesPerSecond > 0)
        line += fmt::format("   |   {:.0f} frames/s, {:.0f} ms behind", health.framesPerSecond, health.delay * 1e3);
    canvas.text({edge, 0.6 * font}, line, 0.9 * font, grey);
}

void drawNotice(Canvas& canvas, const ScreenPlan& plan, const std::string& words, const std::string& smaller)
{
    const double size = 1.8 * plan.font, y = 0.5 * plan.height, x = plan.view.x + 0.5 * plan.view.width;
    const double width = std::min(0.98 * plan.view.width, 0.62 * size * static_cast<double>(words.size()) + 3 * size);
    canvas.rectangle({x - width / 2, y - 1.3 * size}, {width, 3.4 * size}, {0.05, 0.06, 0.09}, 0.88);
    canvas.text({x, y + 0.4 * size}, words, size, white, Align::centre, true);
    canvas.text({x, y - 0.8 * size}, smaller, plan.font, grey, Align::centre);
}

}  // namespace palpate::render
