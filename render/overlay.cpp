#include <render/overlay.h>

#include <base/said.h>
#include <render/coach.h>
#include <render/deformation.h>
#include <render/tool_picture.h>
#include <render/volume_picture.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace palpate::render {
namespace {

using base::said;
using base::spokenHere;
using base::tr;
using base::trn;

constexpr double margin = 0.8;  // in fonts

std::string millimetresText(double metres)
{
    return std::isfinite(metres) ? said("{:.1Lf} mm", metres * 1e3) : std::string("-");
}

// Writes lines from the top of an area downwards, and nothing below its floor.
struct Pen {
    Canvas& canvas;
    double left, right, y, font, floor;

    void down(double lines = 1) { y -= lines * lineHeight * font; }
    int lines() const { return std::max(0, static_cast<int>((y - floor) / (lineHeight * font))); }
    // `brief`: where there is no room for `words`.
    void heading(const std::string& words, const std::string& brief = {})
    {
        if (lines() < 2)  // alone it says nothing
            y = floor;
        down();
        if (y < floor)
            return;
        const bool fits = brief.empty() || canvas.widthOf(words, font, true) <= right - left;
        canvas.text({left, y}, shortened(canvas, fits ? words : brief, font, true, right - left), font, grey, Align::left,
                    true);
    }
    void pair(const std::string& name, const std::string& value, const Colour& colour)
    {
        down();
        if (y < floor)
            return;
        // Smaller where a narrow window has no room for both, and then the name is cut.
        const double room = right - left - (value.empty() ? 0 : 0.6 * font);
        const auto both = [&](double size) { return canvas.widthOf(name, size) + canvas.widthOf(value, size); };
        double size = font;
        while (both(size) > room && size - 1 >= 0.6 * font)
            --size;
        const std::string shown = shortened(canvas, value, size, false, room);
        canvas.text({left, y}, shortened(canvas, name, size, false, room - canvas.widthOf(shown, size)), size, colour);
        if (!shown.empty())
            canvas.text({right, y}, shown, size, colour, Align::right);
    }
};

void drawBar(Pen& pen, const std::string& name, double force, double cap, const Colour& colour)
{
    const double from = pen.left + 5.6 * pen.font, to = pen.right - 4.2 * pen.font;
    if (to - from < 2 * pen.font || pen.lines() < 1) {
        pen.pair(name, said("{:.2Lf} N", force), white);
        return;
    }
    pen.down();
    const double full = std::max(cap, 0.1), fraction = std::clamp(force / full, 0.0, 1.0);
    pen.canvas.text({pen.left, pen.y}, name, pen.font, white);
    pen.canvas.rectangle({from, pen.y}, {to - from, pen.font}, dark);
    pen.canvas.rectangle({from, pen.y}, {(to - from) * fraction, pen.font}, colour);
    pen.canvas.rectangle({to - 2, pen.y - 2}, {2, pen.font + 4}, white);
    pen.canvas.text({pen.right, pen.y}, said("{:.2Lf} N", force), pen.font, white, Align::right);
}

void drawForces(Pen& pen, const channel::Scenery& scenery, const channel::State& state)
{
    const double total = glm::length(vec(state.total));
    const bool atCap = total > 0.95 * scenery.forceCap;
    pen.heading(said(tr("FORCE ON THE HAND  (limit {:.1Lf} N)"), scenery.forceCap),
                said(tr("FORCE  (limit {:.1Lf} N)"), scenery.forceCap));
    drawBar(pen, tr("basic"), glm::length(vec(state.basic)), scenery.forceCap, basicColour);
    drawBar(pen, tr("additional"), glm::length(vec(state.additional)), scenery.forceCap, additionalColour);
    drawBar(pen, atCap ? tr("total !") : tr("total"), total, scenery.forceCap, atCap ? red : good);
}

// " in 0.8 s" when the needle's line meets structure `s` soon.
std::string contactWords(const channel::State& state, std::size_t s)
{
    constexpr double slowest = 1e-3, soon = 9.95;  // [m/s], [s]
    const double time = state.aheadSpeed > slowest ? state.ahead[s] / state.aheadSpeed : soon;
    return std::isfinite(time) && time >= 0 && time < soon && state.distance[s] > 0 ? said(tr("  in {:.1Lf} s"), time)
                                                                                    : std::string();
}

void drawDistance(Pen& pen, const channel::Scenery& scenery, const channel::State& state, std::size_t s)
{
    const double distance = state.distance[s];
    const std::string name = spokenHere(text(scenery.structure[s])), when = contactWords(state, s);
    // Within half a voxel of the surface the label at the tip may still be the other one.
    const bool atRim = distance > -0.5 * scenery.labels.spacing;
    if (s == 0)
        pen.pair(name + tr(" (target)") + when,
                 distance > 0 ? millimetresText(distance)
                 : atRim      ? tr("at its rim")
                              : tr("INSIDE"),
                 good);
    else if (distance < (state.phase != channel::Phase::free ? scenery.toolRadius : 0))
        pen.pair(name + tr("  TOUCHED"), millimetresText(distance), red);
    else if (distance < scenery.warnDistance[s])
        pen.pair(name + tr("  NEAR") + when, millimetresText(distance), amber);
    else
        pen.pair(name + when, millimetresText(distance), white);
}

void drawDistances(Pen& pen, const channel::Scenery& scenery, const channel::State& state, bool targetHidden)
{
    pen.heading(tr("FROM THE TIP TO"));
    constexpr int most = 7;
    const int lines = std::min(most, pen.lines());
    const std::size_t count = std::min<std::size_t>(scenery.structures, channel::maxStructures);
    if (count == 0 || lines == 0)
        return;
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), 0U);
    // The target stays on top; the rest by distance.
    std::sort(order.begin() + 1, order.end(),
              [&](std::size_t a, std::size_t b) { return state.distance[a] < state.distance[b]; });
    const auto shown = std::min(count, static_cast<std::size_t>(lines));
    if (targetHidden)
        pen.pair(spokenHere(text(scenery.structure[0])), tr("to be found"), good);
    for (std::size_t i = targetHidden ? 1 : 0; i < shown; ++i)
        if (i + 1 == shown && shown < count && i > 0)
            pen.pair(said(trn("and {} more", "and {} more", count - i), count - i),
                     said(tr("from {}"), millimetresText(state.distance[order[i]])), grey);
        else
            drawDistance(pen, scenery, state, order[i]);
}

std::string phaseWords(const channel::State& state)
{
    return state.phase == channel::Phase::contact    ? tr("touching the body")
           : state.phase == channel::Phase::inserted ? said(tr("inserted {:.1Lf} mm"), state.inserted * 1e3)
                                                     : tr("in the air");
}

void drawProgress(Pen& pen, const channel::Scenery& scenery, const channel::State& state)
{
    const bool needle = scenery.tool == channel::ToolKind::needle;
    pen.heading(needle ? tr("NEEDLE") : tr("FINGERTIP"));
    const bool known = state.tissue > 0 && state.tissue < scenery.tissues;
    pen.pair(phaseWords(state),
             known ? said(tr("tip in {}"), spokenHere(text(scenery.tissue[state.tissue].name))) : std::string(), white);
    if (state.aheadTissue > 0 && state.aheadTissue < scenery.tissues)
        pen.pair(said(tr("ahead: {}"), spokenHere(text(scenery.tissue[state.aheadTissue].name))),
                 millimetresText(state.aheadTissueDistance), grey);
    if (state.cores > 0)
        pen.pair(said(tr("core {}: {:.0f} % target"), state.cores, 100 * state.coreTarget),
                 said(tr("{:.1Lf} mm of it"), state.coreLength * 1e3), isEnough(state.coreTarget) ? good : amber);
    else if (needle && scenery.task == channel::Task::biopsy)
        pen.pair(tr("no core taken yet"), "", grey);
}

struct Entry {
    Colour colour;
    std::string name;
    Pattern pattern = Pattern::none;
};

std::vector<Entry> legendEntries(const channel::Scenery& scenery, const Legend& legend, std::size_t room)
{
    const bool needle = scenery.tool == channel::ToolKind::needle;
    std::vector<Entry> entries{{toolColour, needle ? tr("needle") : tr("fingertip")}};
    if (scenery.entry != scenery.aim)
        entries.push_back({planColour, tr("planned line, target")});
    if (needle) {
        entries.push_back({trailColour, tr("way of the tip")});
        entries.push_back({coreColour, tr("core taken")});
    }
    if (legend.marks)
        entries.push_back({markColour, tr("place marked")});
    if (legend.ghost)
        entries.push_back({ghostColour, tr("the expert's")});
    for (std::size_t s = 1; s < std::min<std::size_t>(scenery.structures, channel::maxStructures); ++s)
        if (scenery.warnDistance[s] > 0) {
            entries.push_back({{shellColour[0], shellColour[1], shellColour[2]}, tr("warning distance")});
            break;
        }
    for (const std::uint8_t row : legend.rows) {
        if (entries.size() + 1 >= room) {
            entries.push_back({dark, tr("and more")});
            break;
        }
        const auto& c = scenery.tissue[row].colour;
        const bool chosen = row == legend.chosen;
        entries.push_back({{c[0], c[1], c[2]},
                           (chosen ? "> " : "") + spokenHere(text(scenery.tissue[row].name)) +
                               (chosen ? said("  x {:.2Lg}", static_cast<double>(legend.factor)) : std::string()),
                           patternOf(legend.palette, scenery.tissue[row].name)});
    }
    if (entries.size() > room) {
        entries.resize(room - 1);
        entries.push_back({dark, tr("and more")});
    }
    return entries;
}

void drawHealth(Canvas& canvas, const ScreenPlan& plan, const channel::State& state, const Health& health)
{
    const std::string brief = state.missed == channel::notCounted
                                  ? ""
                                  : said(trn("{} tick missed", "{} ticks missed", state.missed), state.missed);
    std::string simulation = brief, viewer;
    if (health.tickRate > 0 && state.tickP99 > 0 && !brief.empty())
        simulation = said(tr("{:.0f} ticks/s, 99 % within {:.0f} us, {} missed"), health.tickRate, state.tickP99 * 1e6,
                          state.missed);
    if (health.framesPerSecond > 0)
        viewer = health.delay > 0
                     ? said(tr("{:.0f} frames/s, {:.0f} ms behind"), health.framesPerSecond, health.delay * 1e3)
                     : said(tr("{:.0f} frames/s"), health.framesPerSecond);
    const double font = 0.9 * plan.font, x = plan.health.x + margin * plan.font;
    const double room = plan.health.width - 2 * margin * plan.font;
    const auto fits = [&](const std::string& words) { return canvas.widthOf(words, font) <= room; };
    const std::string both = simulation + (simulation.empty() ? "" : "   |   ") + viewer;
    if (!viewer.empty() && fits(both)) {
        simulation = both;
        viewer.clear();
    }
    if (!fits(simulation))
        simulation = brief;
    double y = plan.health.y + 0.6 * font;
    for (const std::string& words : {viewer, simulation}) {
        if (words.empty())
            continue;
        const std::string shown = shortened(canvas, words, font, false, room);
        // A bone below them is as bright as the words.
        canvas.rectangle({x - 0.4 * font, y - 0.35 * font}, {canvas.widthOf(shown, font) + 0.8 * font, 1.4 * font},
                         cardColour, 0.75);
        canvas.text({x, y}, shown, font, grey);
        y += 1.4 * font;
    }
}

// As on the slices, in a square of the legend.
void drawPattern(Canvas& canvas, Point2 at, double size, const Entry& entry)
{
    constexpr int cells = 5;
    const double cell = size / cells;
    const bool dark = 0.3 * entry.colour[0] + 0.6 * entry.colour[1] + 0.1 * entry.colour[2] < 0.35;
    for (int i = 0; i < cells * cells && entry.pattern != Pattern::none; ++i) {
        const int column = i % cells, row = i / cells;
        // A cell is half a period.
        if (isMarked(entry.pattern, 3 * column, 3 * row))
            canvas.rectangle({at[0] + column * cell, at[1] + row * cell}, {cell, cell}, dark ? white : Colour{0, 0, 0},
                             0.6);
    }
}

}  // namespace

void drawLegend(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const Legend& legend)
{
    const double font = 0.95 * plan.font, x = plan.legend.x + margin * plan.font, row = 1.35 * font;
    const double bottom = plan.legend.y + 0.6 * font;
    const double top = std::min(legend.below - 0.4 * font, static_cast<double>(plan.legend.y + plan.legend.height));
    const auto room = static_cast<int>((top - bottom) / row);
    std::vector<Entry> entries;
    if (room >= 2)
        entries = legendEntries(scenery, legend, static_cast<std::size_t>(room));
    double widest = 0;
    for (Entry& entry : entries) {
        entry.name = shortened(canvas, entry.name, font, false, plan.legend.width - 2 * margin * plan.font - 1.5 * font);
        widest = std::max(widest, canvas.widthOf(entry.name, font));
    }
    const double high = row * static_cast<double>(entries.size()), wide = widest + 2.3 * font;
    if (plan.events.empty() && entries.empty())
        return;
    if (plan.events.empty())
        canvas.rectangle({x - 0.4 * font, bottom - 0.4 * font}, {wide, high + 0.4 * font}, panelColour, 0.6);
    else
        canvas.rectangle(plan.legend, panelColour);
    double y = bottom;
    for (const Entry& entry : entries) {
        canvas.rectangle({x, y}, {font, font}, entry.colour);
        drawPattern(canvas, {x, y}, font, entry);
        canvas.text({x + 1.5 * font, y - 1}, entry.name, font, white);
        y += row;
    }
}

void drawFigures(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state,
                 const Health& health, bool targetHidden)
{
    const double font = plan.font, edge = margin * font;
    canvas.rectangle(plan.panel, panelColour);
    Pen pen{canvas, plan.panel.x + edge, plan.panel.x + plan.panel.width - edge,
            static_cast<double>(plan.panel.height) - 0.2 * font, font,
            // Where the panel has the line of the health as well, that is its lowest.
            static_cast<double>(plan.health.x == plan.panel.x ? plan.health.height : plan.panel.y)};
    drawForces(pen, scenery, state);
    pen.down(0.3);
    drawProgress(pen, scenery, state);
    pen.down(0.3);
    drawDistances(pen, scenery, state, targetHidden);

    drawHealth(canvas, plan, state, health);
}

void drawEvents(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery, const std::deque<Event>& events)
{
    if (plan.events.empty())
        return;
    const double font = plan.font, edge = margin * font, top = plan.events.y + plan.events.height;
    canvas.rectangle(plan.events, panelColour);
    Pen pen{canvas,
            plan.events.x + edge,
            plan.events.x + plan.events.width - edge,
            top - 0.2 * font,
            font,
            static_cast<double>(plan.events.y)};
    pen.heading(tr("EVENTS"));
    for (auto event = events.rbegin(); event != events.rend() && pen.lines() > 0; ++event) {
        const bool bad = event->kind == EventKind::touching || event->kind == EventKind::fault;
        const bool warning = event->kind == EventKind::near || event->kind == EventKind::veryNear ||
                             event->kind == EventKind::refused || event->kind == EventKind::stopped;
        const Colour colour = bad                                                          ? red
                              : warning                                                    ? amber
                              : event->kind == EventKind::fired && isEnough(event->target) ? good
                                                                                           : white;
        pen.pair(words(*event, scenery), said("{:.1Lf} s", event->time), colour);
    }
}

}  // namespace palpate::render
