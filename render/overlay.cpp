#include <render/overlay.h>

#include <render/deformation.h>
#include <render/tool_picture.h>
#include <render/volume_picture.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

namespace palpate::render {
namespace {

constexpr double margin = 0.8;  // in fonts

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
    drawBar(pen, "basic", glm::length(vec(state.basic)), scenery.forceCap, basicColour);
    drawBar(pen, "additional", glm::length(vec(state.additional)), scenery.forceCap, additionalColour);
    drawBar(pen, atCap ? "total !" : "total", total, scenery.forceCap, atCap ? red : good);
}

// " in 0.8 s" when the needle's line meets structure `s` soon.
std::string contactWords(const channel::State& state, std::size_t s)
{
    constexpr double slowest = 1e-3, soon = 9.95;  // [m/s], [s]
    const double time = state.aheadSpeed > slowest ? state.ahead[s] / state.aheadSpeed : soon;
    return std::isfinite(time) && time >= 0 && time < soon && state.distance[s] > 0 ? fmt::format("  in {:.1f} s", time)
                                                                                    : std::string();
}

void drawDistance(Pen& pen, const channel::Scenery& scenery, const channel::State& state, std::size_t s)
{
    const double distance = state.distance[s];
    const std::string name = text(scenery.structure[s]), when = contactWords(state, s);
    if (s == 0)
        pen.pair(name + " (target)" + when, distance <= 0 ? "INSIDE" : millimetres(distance), good);
    else if (distance <= 0)
        pen.pair(name + "  TOUCHED", millimetres(distance), red);
    else if (distance < scenery.warnDistance[s])
        pen.pair(name + "  NEAR" + when, millimetres(distance), amber);
    else
        pen.pair(name + when, millimetres(distance), white);
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
    for (std::size_t i = 0; i < shown; ++i)
        if (i + 1 == shown && shown < count)
            pen.pair(fmt::format("and {} more", count - i), "from " + millimetres(state.distance[order[i]]), grey);
        else
            drawDistance(pen, scenery, state, order[i]);
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
    const double size = 1.35 * plan.font, middle = plan.banner.x + 0.5 * plan.banner.width;
    const double width = std::min(0.66 * size * static_cast<double>(words.size()) + 2 * size, 0.96 * plan.banner.width);
    const double y = plan.banner.y;
    canvas.rectangle({middle - width / 2, y - 0.4 * size}, {width, 1.9 * size}, colour);
    canvas.text({middle, y}, words, size, {0.05, 0.05, 0.05}, Align::centre, true);
}

struct Entry {
    Colour colour;
    std::string name;
};

std::vector<Entry> legendEntries(const channel::Scenery& scenery, const Legend& legend, std::size_t room)
{
    std::vector<Entry> entries{{toolColour, scenery.tool == channel::ToolKind::needle ? "needle" : "probe"},
                               {planColour, "planned line, target"}};
    for (std::size_t s = 1; s < std::min<std::size_t>(scenery.structures, channel::maxStructures); ++s)
        if (scenery.warnDistance[s] > 0) {
            entries.push_back({{shellColour[0], shellColour[1], shellColour[2]}, "warning distance"});
            break;
        }
    for (const std::uint8_t row : legend.rows) {
        if (entries.size() + 1 >= room) {
            entries.push_back({dark, "and more"});
            break;
        }
        const auto& c = scenery.tissue[row].colour;
        const bool chosen = row == legend.chosen;
        entries.push_back({{c[0], c[1], c[2]},
                           (chosen ? "> " : "") + text(scenery.tissue[row].name) +
                               (chosen ? fmt::format("  x {:.2g}", static_cast<double>(legend.factor)) : std::string())});
    }
    return entries;
}

void drawHealth(Canvas& canvas, const ScreenPlan& plan, const channel::State& state, const Health& health)
{
    std::string simulation = fmt::format("{} ticks missed", state.missed), viewer;
    if (health.tickRate > 0 && state.tickP99 > 0)
        simulation = fmt::format("{:.0f} ticks/s, 99 % within {:.0f} us, {} missed", health.tickRate, state.tickP99 * 1e6,
                                 state.missed);
    if (health.framesPerSecond > 0)
        viewer = fmt::format("{:.0f} frames/s, {:.0f} ms behind", health.framesPerSecond, health.delay * 1e3);
    const double font = 0.9 * plan.font, x = plan.health.x + margin * plan.font;
    const bool wide = 0.5 * font * static_cast<double>(simulation.size() + viewer.size() + 7) < plan.health.width;
    if (wide && !viewer.empty())
        simulation += "   |   " + std::exchange(viewer, {});
    canvas.text({x, plan.health.y + 0.6 * font}, viewer.empty() ? simulation : viewer, font, grey);
    if (!viewer.empty())
        canvas.text({x, plan.health.y + 2.0 * font}, simulation, font, grey);
}

}  // namespace

void drawLegend(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const Legend& legend)
{
    const double font = 0.95 * plan.font, x = plan.legend.x + margin * plan.font, row = 1.35 * font;
    const double bottom = plan.legend.y + 0.6 * font;
    const auto room = static_cast<std::size_t>(std::max(3.0, plan.legend.height / row - 1));
    const std::vector<Entry> entries = legendEntries(scenery, legend, room);
    std::size_t longest = 0;
    for (const Entry& entry : entries)
        longest = std::max(longest, entry.name.size());
    const double high = row * static_cast<double>(entries.size()),
                 wide = 0.6 * font * static_cast<double>(longest) + 2.2 * font;
    if (plan.events.empty())
        canvas.rectangle({x - 0.4 * font, bottom - 0.4 * font}, {wide, high + 0.4 * font}, panelColour, 0.6);
    else
        canvas.rectangle({static_cast<double>(plan.legend.x), static_cast<double>(plan.legend.y)},
                         {static_cast<double>(plan.legend.width), static_cast<double>(plan.legend.height)}, panelColour);
    double y = bottom;
    for (const Entry& entry : entries) {
        canvas.rectangle({x, y}, {font, font}, entry.colour);
        canvas.text({x + 1.5 * font, y - 1}, entry.name, font, white);
        y += row;
    }
}

void drawFigures(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state,
                 const Health& health, const std::string& session)
{
    const double font = plan.font, edge = margin * font;
    canvas.rectangle({static_cast<double>(plan.panel.x), 0},
                     {static_cast<double>(plan.panel.width), static_cast<double>(plan.panel.height)}, panelColour);
    Pen pen{canvas, plan.panel.x + edge, plan.panel.x + plan.panel.width - edge,
            static_cast<double>(plan.panel.height) - 0.2 * font, font};
    drawForces(pen, scenery, state);
    pen.down(0.3);
    drawProgress(pen, scenery, state);
    pen.down(0.3);
    constexpr int distanceLines = 7;
    drawDistances(pen, scenery, state, distanceLines);

    const double x = plan.title.x + edge, top = plan.title.y + plan.title.height;
    // Over the body as well: dark below bright.
    const auto words = [&](double y, const std::string& what, double size, const Colour& colour, bool bold) {
        canvas.text({x + 1, y - 1}, what, size, {0, 0, 0}, Align::left, bold);
        canvas.text({x, y}, what, size, colour, Align::left, bold);
    };
    words(top - 1.8 * font, text(scenery.scene), 1.25 * font, white, true);
    words(top - 3.2 * font, fmt::format("session {}   {:.1f} s", session, state.time), font, white, false);
    drawWarning(canvas, plan, scenery, state);
    drawHealth(canvas, plan, state, health);
}

void drawEvents(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const std::deque<Event>& events)
{
    if (plan.events.empty())
        return;
    const double font = plan.font, edge = margin * font, top = plan.events.y + plan.events.height;
    canvas.rectangle({static_cast<double>(plan.events.x), static_cast<double>(plan.events.y)},
                     {static_cast<double>(plan.events.width), static_cast<double>(plan.events.height)}, panelColour);
    Pen pen{canvas, plan.events.x + edge, plan.events.x + plan.events.width - edge, top - 0.2 * font, font};
    pen.heading("EVENTS");
    const double floor = plan.events.y + lineHeight * font;
    for (auto event = events.rbegin(); event != events.rend() && pen.y > floor; ++event) {
        const bool bad = event->kind == EventKind::touching || event->kind == EventKind::fault;
        const bool warning = event->kind == EventKind::near || event->kind == EventKind::veryNear;
        const Colour colour = bad ? red : warning ? amber : event->kind == EventKind::fired ? good : white;
        pen.pair(words(*event, scenery), fmt::format("{:.1f} s", event->time), colour);
    }
}

void drawNotice(Canvas& canvas, const ScreenPlan& plan, const std::string& words, const std::string& smaller)
{
    const double size = 1.8 * plan.font, y = 0.5 * plan.height, x = plan.banner.x + 0.5 * plan.banner.width;
    const double width = std::min(0.98 * plan.banner.width, 0.62 * size * static_cast<double>(words.size()) + 3 * size);
    canvas.rectangle({x - width / 2, y - 1.3 * size}, {width, 3.4 * size}, {0.05, 0.06, 0.09}, 0.88);
    canvas.text({x, y + 0.4 * size}, words, size, white, Align::centre, true);
    canvas.text({x, y - 0.8 * size}, smaller, plan.font, grey, Align::centre);
}

void drawHelp(Canvas& canvas, const ScreenPlan& plan, std::span<const KeyHelp> keys)
{
    const double font = plan.font, row = lineHeight * font, x = plan.banner.x + margin * font;
    const double high = row * static_cast<double>(keys.size()) + font, y = 0.5 * (plan.height - high);
    const double wide = std::min(0.98 * plan.banner.width, 34 * font);
    canvas.rectangle({x, y}, {wide, high}, {0.05, 0.06, 0.09}, 0.92);
    double line = y + high - 0.5 * font;
    for (const KeyHelp& key : keys) {
        line -= row;
        canvas.text({x + font, line + 0.2 * font}, key.key, font, amber, Align::left, true);
        canvas.text({x + 10 * font, line + 0.2 * font}, key.what, font, white);
    }
}

void drawCaption(Canvas& canvas, const ScreenPlan& plan, const std::string& words, double timeline)
{
    const double font = plan.font, left = plan.banner.x + 0.25 * plan.banner.width, width = 0.5 * plan.banner.width;
    const double y = plan.height - 1.6 * font;
    if (!words.empty())
        canvas.text({left + width, y}, words, 1.1 * font, amber, Align::right, true);
    if (timeline < 0)
        return;
    canvas.rectangle({left, y - 0.6 * font}, {width, 0.3 * font}, dark);
    canvas.rectangle({left, y - 0.6 * font}, {width * std::min(timeline, 1.0), 0.3 * font}, amber);
}

}  // namespace palpate::render
