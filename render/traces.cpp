#include <render/traces.h>

#include <base/said.h>
#include <render/overlay.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>
#include <vector>

namespace palpate::render {
namespace {

struct Curve {
    std::string name;
    Colour colour;
    double width;  // [pixels]
    std::function<double(const History::Moment&)> value;
    bool least = false;  // of a pixel column: the smallest value counts
};

// A diagram over time: `top` is the value at its upper edge.
struct Diagram {
    Canvas& canvas;
    Area inner;  // [pixels]
    double font, now, top;

    double x(double time) const { return inner.x + inner.width * (1 + (time - now) / traceSeconds); }
    // The point `p`, or where the line from it to `q` comes down to the upper edge.
    Point2 seen(const History::Point& p, const History::Point& q) const
    {
        const double part = p.value > top ? (p.value - top) / (p.value - q.value) : 0.0;
        return {x(std::lerp(p.time, q.time, part)), y(std::lerp(p.value, q.value, part))};
    }
    double y(double value) const { return inner.y + inner.height * std::clamp(value / top, 0.0, 1.0); }
};

// Where the names of curves stand, from the left end and in rows from above. All have a place where there is room for
// their rows; what has none is left out from the end.
struct CurveNames {
    struct Place {
        double x;  // [pixels]
        int row;
    };
    std::vector<Place> places;
    int rows = 1;
};

constexpr double nameSize = 0.85, nameRow = 1.2, traceLeft = 3.2, traceBelow = 1.7, traceAbove = 3.2;  // in fonts

CurveNames namesOf(const Canvas& canvas, const Area& area, double font, const std::vector<Curve>& curves)
{
    constexpr double least = 3;  // of the diagram, in fonts
    const double size = nameSize * font, first = area.x + std::floor(traceLeft * font);
    const double spare = area.height - (traceBelow + traceAbove + least) * font;
    const int most = 1 + std::max(0, static_cast<int>(spare / (nameRow * font)));
    CurveNames names;
    double x = first;
    for (const Curve& curve : curves) {
        const double wide = canvas.widthOf(curve.name, size) + 2.4 * size;
        if (x > first && x + wide - size > area.x + area.width) {
            x = first;
            ++names.rows;
        }
        if (names.rows > most || x + wide - size > area.x + area.width) {
            names.rows = std::min(names.rows, most);
            break;
        }
        names.places.push_back({x, names.rows - 1});
        x += wide;
    }
    return names;
}

Diagram frameOf(Canvas& canvas, const Area& area, double font, const std::string& title, double now, double top,
                const std::string& unit, int rows)
{
    canvas.rectangle(area, panelColour);
    const int left = static_cast<int>(traceLeft * font), low = static_cast<int>(traceBelow * font),
              high = static_cast<int>((traceAbove + (rows - 1) * nameRow) * font);
    const Diagram d{canvas,
                    {area.x + left, area.y + low, area.width - left - static_cast<int>(font), area.height - low - high},
                    font,
                    now,
                    top};
    canvas.text({area.x + 0.8 * font, area.y + area.height - 1.5 * font},
                shortened(canvas, title, font, true, area.width - 1.6 * font), font, grey, Align::left, true);
    const int lines = d.inner.height > 4 * font ? 2 : 1;
    for (int i = 0; i <= lines && d.inner.height > 1.5 * font; ++i) {
        const double value = top * i / lines;
        canvas.rectangle({static_cast<double>(d.inner.x), d.y(value)}, {static_cast<double>(d.inner.width), 1}, dark);
        canvas.text({d.inner.x - 0.4 * font, d.y(value) - 0.5 * font}, base::said("{:Lg}", value), 0.85 * font, grey,
                    Align::right);
    }
    const std::string begin = fmt::format("-{:g} s", traceSeconds), end = base::tr("now");
    const double size = 0.85 * font;
    if (canvas.widthOf(begin, size) + canvas.widthOf(end, size) + font <= d.inner.width)
        canvas.text({static_cast<double>(d.inner.x), area.y + 0.3 * font}, begin, size, grey);
    canvas.text({static_cast<double>(d.inner.x + d.inner.width), area.y + 0.3 * font}, end, size, grey, Align::right);
    canvas.text({d.inner.x - 0.4 * font, d.y(top) + 0.6 * font}, unit, 0.85 * font, grey, Align::right);
    return d;
}

// One point per pixel column is all that can be seen, and nothing above the upper edge: there are gaps.
void draw(const Diagram& d, const History& history, const Curve& curve)
{
    const auto points = history.columns(d.inner.width / traceSeconds, curve.value, curve.least);
    for (std::size_t i = 1; i < points.size(); ++i) {
        const auto &a = points[i - 1], &b = points[i];
        if (std::isfinite(a.value) && std::isfinite(b.value) && std::min(a.value, b.value) <= d.top)
            d.canvas.line(d.seen(a, b), d.seen(b, a), curve.width, curve.colour);
    }
}

void drawAll(const Diagram& d, const Area& area, const History& history, const std::vector<Curve>& curves,
             const CurveNames& names)
{
    for (const Curve& curve : curves)
        draw(d, history, curve);
    const double size = nameSize * d.font;
    for (std::size_t i = 0; i < names.places.size(); ++i) {
        const double x = names.places[i].x, y = area.y + area.height - (2.8 + nameRow * names.places[i].row) * d.font;
        d.canvas.rectangle({x, y + 0.3 * size}, {size, 0.4 * size}, curves[i].colour);
        d.canvas.text({x + 1.3 * size, y}, curves[i].name, size, white);
    }
}

double nowOf(const History& history)
{
    return history.moments.empty() ? 0 : history.moments.back().time;
}

}  // namespace

void drawForceTraces(Canvas& canvas, const Area& area, double font, const channel::Scenery& scenery, const History& history)
{
    const double cap = std::max(scenery.forceCap, 0.1);
    double most = 0;
    for (const History::Moment& moment : history.moments)
        most = std::max({most, moment.basic, moment.additional, moment.total});
    // Half the limit when that is enough: most procedures need less.
    const double top = most > 0.5 * cap ? 1.1 * cap : 0.55 * cap;
    const std::vector<Curve> curves{
        {base::tr("basic"), basicColour, 1.5, [](const auto& m) { return m.basic; }},
        {base::tr("additional"), additionalColour, 1.5, [](const auto& m) { return m.additional; }},
        {base::tr("total"), good, 2.5, [](const auto& m) { return m.total; }}};
    const CurveNames names = namesOf(canvas, area, font, curves);
    const Diagram d =
        frameOf(canvas, area, font, base::tr("FORCE ON THE HAND"), nowOf(history), std::ceil(top), "N", names.rows);
    if (cap < d.top)
        canvas.rectangle({static_cast<double>(d.inner.x), d.y(cap)}, {static_cast<double>(d.inner.width), 2}, red);
    drawAll(d, area, history, curves, names);
}

void drawDistanceTraces(Canvas& canvas, const Area& area, double font, const channel::Scenery& scenery,
                        const History& history)
{
    constexpr std::size_t shown = 4;
    constexpr std::array<Colour, 5> colours{
        {{0.95, 0.60, 0.95}, {1.0, 0.45, 0.40}, {0.50, 0.70, 1.0}, {1.0, 0.80, 0.40}, {0.60, 0.90, 0.90}}};
    const std::size_t count = std::min<std::size_t>(scenery.structures, channel::maxStructures);
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), 0U);
    if (count > 1 && !history.moments.empty())
        std::sort(order.begin() + 1, order.end(), [&](std::size_t a, std::size_t b) {
            return history.moments.back().distance[a] < history.moments.back().distance[b];
        });
    order.resize(std::min(count, shown));  // the nearest first: a narrow legend has no room for the last
    constexpr double top = 40;             // [mm]
    std::vector<Curve> curves;
    for (const std::size_t s : order)
        curves.push_back({base::spokenHere(text(scenery.structure[s])), s == 0 ? good : colours[s % colours.size()],
                          s == 0 ? 2.5 : 1.5,
                          [s](const History::Moment& m) { return 1e3 * static_cast<double>(m.distance[s]); }, true});
    const CurveNames names = namesOf(canvas, area, font, curves);
    const Diagram d = frameOf(canvas, area, font, base::tr("DISTANCE FROM THE TIP"), nowOf(history), top, "mm", names.rows);
    drawAll(d, area, history, curves, names);
}

}  // namespace palpate::render
