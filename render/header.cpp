#include <render/header.h>

#include <base/said.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::render {
namespace {

using base::said;
using base::spokenHere;
using base::tr;

constexpr Colour cardColour{0.05, 0.06, 0.09};
constexpr double edge = 0.8;    // of a text from its area, in fonts
constexpr double boxGap = 0.3;  // between boxes, in fonts

// Goes down an area, line by line.
struct Column {
    Canvas& canvas;
    double left, width, y, font;

    // Over the body as well: dark below bright.
    void line(const std::string& words, double size, const Colour& colour, bool bold)
    {
        y -= 1.35 * size;
        canvas.text({left + 1, y - 1}, words, size, {0, 0, 0}, Align::left, bold);
        canvas.text({left, y}, words, size, colour, Align::left, bold);
    }
    double heightOf(const std::string& words, double size) const
    {
        return 1.3 * size * static_cast<double>(wrapped(canvas, words, size, true, width - size).size()) + 0.4 * size;
    }
    Area box(const std::string& words, double size, const Colour& back, double opacity, const Colour& colour)
    {
        const auto lines = wrapped(canvas, words, size, true, width - size);
        double widest = 0;
        for (const std::string& part : lines)
            widest = std::max(widest, canvas.widthOf(part, size, true));
        const double high = heightOf(words, size);
        y -= high + boxGap * font;
        canvas.rectangle({left - 0.4 * font, y}, {widest + size, high}, back, opacity);
        for (std::size_t i = 0; i < lines.size(); ++i)
            canvas.text({left - 0.4 * font + 0.5 * size, y + high - 0.1 * size - 1.3 * size * static_cast<double>(i + 1)},
                        lines[i], size, colour, Align::left, true);
        return {static_cast<int>(left - 0.4 * font), static_cast<int>(y), static_cast<int>(widest + size),
                static_cast<int>(high)};
    }
};

void drawTitle(Column& column, const channel::Scenery& scenery, const channel::State& state, const std::string& session)
{
    const double size = 1.25 * column.font;
    const std::string title = shortened(column.canvas, text(scenery.scene), size, true, column.width),
                      time = said("{:.1Lf} s", state.time);
    const std::string all = said(tr("session {}   {}"), session, time);
    const double room = column.width - column.canvas.widthOf(title, size, true) - 2 * column.font;
    column.line(title, size, white, true);
    for (const std::string& words : {all, time})
        if (column.canvas.widthOf(words, column.font, false) < room) {
            column.canvas.text({column.left + column.width, column.y}, words, column.font, grey, Align::right);
            return;
        }
    column.line(time, column.font, grey, false);
}

// Empty: no warning.
std::string warningWords(const channel::Scenery& scenery, const channel::State& state)
{
    const std::size_t s = std::min<std::size_t>(state.warned, channel::maxStructures - 1);
    if (state.status == channel::Status::faulted)
        return tr("FAULT: forces are off");
    if (state.warning == channel::Warning::none)
        return "";
    if (state.warning == channel::Warning::touching)
        return said(tr("STOP: touching {}"), spokenHere(text(scenery.structure[s])));
    return said(tr("{}: {} at {:.1Lf} mm"), state.warning == channel::Warning::near ? tr("CAREFUL") : tr("VERY NEAR"),
                spokenHere(text(scenery.structure[s])), state.distance[s] * 1e3);
}

void drawTimeline(Column& column, double fraction)
{
    column.y -= 0.7 * column.font;
    const double high = 0.3 * column.font;
    column.canvas.rectangle({column.left, column.y}, {column.width, high}, dark);
    column.canvas.rectangle({column.left, column.y}, {column.width * std::min(fraction, 1.0), high}, amber);
}

// A box of words below the title.
struct Part {
    std::string words;
    double size;
    Colour back;
    double opacity;
    Colour colour;
    int rank;  // 0: the last to be left out
};

std::vector<Part> partsOf(const ScreenPlan& plan, const channel::Scenery& scenery, const channel::State& state,
                          const Header& header)
{
    const double font = plan.font;
    const Coaching& c = header.coaching;
    const std::string at = c.steps > 1 ? fmt::format("{}/{}  ", c.step, c.steps) : "";
    const bool told = c.step > 0 && plan.events.empty();
    const bool severe = state.status == channel::Status::faulted || state.warning == channel::Warning::touching;
    return {{header.caption, font, cardColour, 0.75, amber, 3},
            {told ? at + c.now : "", 1.1 * font, cardColour, 0.8, white, 1},
            {told ? c.wrong : "", font, {0.35, 0.20, 0.02}, 0.9, {1.0, 0.88, 0.6}, 2},
            {warningWords(scenery, state), 1.35 * font, severe ? red : amber, 1, {0.05, 0.05, 0.05}, 0}};
}

// Empties what has no room down to `floor`.
void leaveOut(std::vector<Part>& parts, const Column& column, double floor)
{
    double room = column.y - floor;
    for (int rank = 0; rank < static_cast<int>(parts.size()); ++rank)
        for (Part& part : parts) {
            if (part.rank != rank || part.words.empty())
                continue;
            const double high = column.heightOf(part.words, part.size) + boxGap * column.font;
            if (high > room)
                part.words.clear();
            else
                room -= high;
        }
}

}  // namespace

std::vector<std::string> wrapped(const Canvas& canvas, const std::string& words, double size, bool bold, double width)
{
    std::vector<std::string> lines;
    std::string line;
    for (std::size_t from = 0; from < words.size();) {
        const std::size_t to = std::min(words.find(' ', from), words.size());
        const std::string word = words.substr(from, to - from);
        if (!line.empty() && canvas.widthOf(line + " " + word, size, bold) > width)
            lines.push_back(std::exchange(line, ""));
        line += (line.empty() ? "" : " ") + word;
        from = to + 1;
    }
    if (!line.empty())
        lines.push_back(line);
    for (std::string& part : lines)
        part = shortened(canvas, part, size, bold, width);
    return lines;
}

HeaderPlaces drawHeader(Canvas& canvas, const ScreenPlan& plan, const channel::Scenery& scenery,
                        const channel::State& state, const Header& header)
{
    const double font = plan.font, inset = edge * font;
    const auto columnOf = [&](const Area& area) {
        return Column{canvas, area.x + inset, area.width - 2 * inset,
                      static_cast<double>(area.y + area.height) - 0.3 * font, font};
    };
    Column title = columnOf(plan.title);
    drawTitle(title, scenery, state, header.session);
    const bool apart = !plan.events.empty();  // the title has a place of its own
    Column column = apart ? columnOf({plan.banner.x, 0, plan.banner.width, plan.height}) : title;
    std::vector<Part> parts = partsOf(plan, scenery, state, header);
    const double bar = header.timeline < 0 ? 0 : font;
    leaveOut(parts, column, plan.health.height + bar);
    HeaderPlaces places;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        const Part& part = parts[i];
        if (!part.words.empty()) {
            const Area box = column.box(part.words, part.size, part.back, part.opacity, part.colour);
            if (i == 1)
                places.step = box;
        }
        if (i == 0 && header.timeline >= 0)
            drawTimeline(column, header.timeline);
    }
    places.bottom = column.y;
    return places;
}

void drawNotice(Canvas& canvas, const ScreenPlan& plan, const std::string& words, const std::string& smaller)
{
    const double x = plan.banner.x + 0.5 * plan.banner.width, width = 0.98 * plan.banner.width;
    const double size = 1.8 * plan.font;
    const auto large = wrapped(canvas, words, size, true, width - size),
               small = wrapped(canvas, smaller, plan.font, false, width - size);
    const double high =
        1.35 * (size * static_cast<double>(large.size()) + plan.font * static_cast<double>(small.size())) + size;
    double widest = 0;
    for (const std::string& line : large)
        widest = std::max(widest, canvas.widthOf(line, size, true));
    for (const std::string& line : small)
        widest = std::max(widest, canvas.widthOf(line, plan.font, false));
    double y = 0.5 * plan.height + high / 2;
    canvas.rectangle({x - widest / 2 - size / 2, y - high}, {widest + size, high}, cardColour, 0.9);
    y -= 0.4 * size;
    for (const std::string& line : large)
        canvas.text({x, y -= 1.35 * size}, line, size, white, Align::centre, true);
    for (const std::string& line : small)
        canvas.text({x, y -= 1.35 * plan.font}, line, plan.font, grey, Align::centre);
}

void drawResult(Canvas& canvas, const ScreenPlan& plan, const ResultCard& result, const std::string& smaller)
{
    struct Line {
        std::string words;
        double size;
        Colour colour;
        bool bold;
    };
    const double wide = 0.96 * plan.banner.width;
    double font = plan.font, high = 0;
    std::vector<Line> lines;
    const auto add = [&](const std::string& words, double size, const Colour& colour, bool bold) {
        for (const std::string& part : wrapped(canvas, words, size, bold, wide - 2 * font)) {
            lines.push_back({part, size, colour, bold});
            high += 1.45 * size;
        }
    };
    // Smaller where the window is too low for all, and without the last lines where it is lower still.
    for (const double scale : {1.0, 0.85, 0.7}) {
        font = scale * plan.font;
        lines.clear();
        high = font;
        add(said(tr("{:.0f} of 100 points"), result.total), 1.8 * font, white, true);
        for (const std::string& part : result.parts)
            add(part, font, grey, false);
        add(result.losses.empty() ? tr("Nothing was lost") : tr("Where the points went"), 1.1 * font, amber, true);
        for (const std::string& loss : result.losses)
            add(loss, 1.05 * font, white, false);
        add(smaller, font, grey, false);
        if (high <= plan.height)
            break;
    }
    for (; high > plan.height && lines.size() > 1; lines.pop_back())
        high -= 1.45 * lines.back().size;
    const double x = plan.banner.x + 0.02 * plan.banner.width;
    double y = std::min(0.5 * plan.height + high / 2, static_cast<double>(plan.height));
    canvas.rectangle({x, y - high}, {wide, high}, cardColour, 0.94);
    y -= 0.4 * font;
    for (const Line& line : lines)
        canvas.text({x + font, y -= 1.45 * line.size}, line.words, line.size, line.colour, Align::left, line.bold);
}

void drawHelp(Canvas& canvas, const ScreenPlan& plan, std::span<const KeyHelp> keys)
{
    constexpr double below = 0.84;  // of the height: title, caption and warning stand above
    double font = plan.font, widestKey = 0, widest = 0;
    for (const KeyHelp& key : keys) {
        widestKey = std::max(widestKey, canvas.widthOf(key.key, font, true));
        widest = std::max(widest, canvas.widthOf(key.what, font, false));
    }
    // Over the whole window where the body's part of it is too narrow, and smaller where that is too.
    const double all = widestKey + widest + 3.5 * font, rows = static_cast<double>(keys.size()) + 1;
    const bool inBody = all < 0.98 * plan.banner.width;
    const double from = inBody ? plan.banner.x : 0, room = 0.98 * (inBody ? plan.banner.width : plan.width);
    const double scale = std::min({1.0, room / all, below * plan.height / (rows * lineHeight * font)});
    font *= scale;
    const double row = lineHeight * font, high = row * rows, y = 0.5 * (below * plan.height - high);
    canvas.rectangle({from + 0.5 * font, y}, {all * scale, high}, cardColour, 0.95);
    double line = y + high - 0.5 * font;
    for (const KeyHelp& key : keys) {
        line -= row;
        canvas.text({from + 1.5 * font, line + 0.2 * font}, key.key, font, amber, Align::left, true);
        canvas.text({from + 2.5 * font + widestKey * scale, line + 0.2 * font}, key.what, font, white);
    }
}

}  // namespace palpate::render
