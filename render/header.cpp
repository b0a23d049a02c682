#include <render/header.h>

#include <base/said.h>
#include <base/told_losses.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::render {
namespace {

using base::said;
using base::spokenHere;
using base::tr;

constexpr double helpBelow = 0.83;  // of the height: title, caption and warning stand above
constexpr double helpLine = 1.27;   // height of a line, in fonts
constexpr double edge = 0.8;        // of a text from its area, in fonts
constexpr double boxGap = 0.3;      // between boxes, in fonts

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
        const double widest = canvas.widest(lines, size, true), high = heightOf(words, size);
        y -= high + boxGap * font;
        canvas.cover({left - 0.4 * font, y}, {widest + size, high});
        canvas.rectangle({left - 0.4 * font, y}, {widest + size, high}, back, opacity);
        for (std::size_t i = 0; i < lines.size(); ++i)
            canvas.text({left - 0.4 * font + 0.5 * size, y + high - 0.1 * size - 1.3 * size * static_cast<double>(i + 1)},
                        lines[i], size, colour, Align::left, true);
        return {static_cast<int>(left - 0.4 * font), static_cast<int>(y), static_cast<int>(widest + size),
                static_cast<int>(high)};
    }
};

void drawTitle(Column& column, const channel::State& state, const Header& header)
{
    const double size = 1.25 * column.font;
    const std::string title = shortened(column.canvas, header.title, size, true, column.width),
                      time = said("{:.1Lf} s", state.time);
    const std::string all = said(tr("session {}   {}"), header.session, time);
    const double room = column.width - column.canvas.widthOf(title, size, true) - 2 * column.font;
    column.line(title, size, white, true);
    for (const std::string& words : {all, time})
        if (column.canvas.widthOf(words, column.font, false) < room) {
            // A needle behind the words may be as bright as they are.
            const double wide = column.canvas.widthOf(words, column.font) + 0.8 * column.font;
            column.canvas.rectangle({column.left + column.width + 0.4 * column.font - wide, column.y - 0.35 * column.font},
                                    {wide, 1.4 * column.font}, cardColour, 0.75);
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

// Returns where the bar is.
Area drawTimeline(Column& column, double fraction)
{
    column.y -= 0.7 * column.font;
    const double high = 0.3 * column.font;
    column.canvas.rectangle({column.left, column.y}, {column.width, high}, dark);
    column.canvas.rectangle({column.left, column.y}, {column.width * std::min(fraction, 1.0), high}, amber);
    return {static_cast<int>(column.left), static_cast<int>(column.y), static_cast<int>(column.width),
            static_cast<int>(std::ceil(high))};
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
    const bool record = header.timeline >= 0;  // whose caption says whether it runs, and where it is
    return {{header.caption, font, cardColour, 0.75, amber, record ? 1 : 3},
            {told ? at + c.now : "", 1.1 * font, cardColour, 0.8, white, record ? 2 : 1},
            {told ? c.wrong : "", font, {0.35, 0.20, 0.02}, 0.9, {1.0, 0.88, 0.6}, record ? 3 : 2},
            {warningWords(scenery, state), 1.35 * font, severe ? red : amber, 1, {0.05, 0.05, 0.05}, 0}};
}

// Empties what has no room down to `floor`; a warning may go on down to `lowest`.
void leaveOut(std::vector<Part>& parts, const Column& column, double floor, double lowest)
{
    double room = column.y - floor;
    for (int rank = 0; rank < static_cast<int>(parts.size()); ++rank)
        for (Part& part : parts) {
            if (part.rank != rank || part.words.empty())
                continue;
            const double high = column.heightOf(part.words, part.size) + boxGap * column.font;
            if (high > room + (rank == 0 ? floor - lowest : 0))
                part.words.clear();
            else
                room -= high;
        }
}

// Where the keys are listed, and how.
struct HelpTable {
    double font = 0, from = 0, width = 0;  // width: of a column
    double keys = 0;                       // width of the keys' names
    double low = 0, room = 0;              // upright
    std::size_t columns = 1;
    bool inBody = true;  // else over the whole window
};

// In the body's part of the window, else over all of it, else there in two columns; smaller where none has room.
HelpTable helpTable(const Canvas& canvas, const ScreenPlan& plan, std::span<const KeyHelp> keys)
{
    constexpr double smallest = 4;  // [pixels]
    HelpTable table;
    for (table.font = std::round(plan.font); table.font > smallest; table.font -= 1) {
        table.keys = 0;
        for (const KeyHelp& key : keys)
            table.keys = std::max(table.keys, canvas.widthOf(key.key, table.font, true));
        for (const auto& [inBody, columns] : {std::pair{true, 1U}, {false, 1U}, {false, 2U}}) {
            table.inBody = inBody;
            table.columns = columns;
            table.from = inBody ? plan.banner.x : 0;
            table.width = (inBody ? plan.banner.width : plan.width) / static_cast<double>(columns);
            table.low = inBody && plan.health.x == plan.banner.x ? plan.health.height : 0;
            table.room = helpBelow * plan.height - table.low;
            const double text = table.width - table.keys - 2.5 * table.font;
            double lines = columns;
            for (const KeyHelp& key : keys)
                lines += text > 8 * table.font ? std::ceil(1.1 * canvas.widthOf(key.what, table.font, false) / text)
                                               : plan.height;
            if ((std::ceil(lines / columns) + 2) * helpLine * table.font <= table.room)
                return table;
        }
    }
    return table;
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
    const bool apart = !plan.events.empty();  // the title has a place of its own, which the keys need
    if (!header.keysListed || !apart)
        drawTitle(title, state, header);
    Column column = apart ? columnOf({plan.banner.x, 0, plan.banner.width, plan.height}) : title;
    std::vector<Part> parts = partsOf(plan, scenery, state, header);
    const double bar = header.timeline < 0 ? 0 : font;
    const double lowest = plan.health.height + bar;
    leaveOut(parts, column, header.keysListed ? helpBelow * plan.height + bar : lowest, lowest);
    HeaderPlaces places;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        const Part& part = parts[i];
        if (!part.words.empty()) {
            const Area box = column.box(part.words, part.size, part.back, part.opacity, part.colour);
            if (i == 1)
                places.step = box;
        }
        if (i == 0 && header.timeline >= 0)
            places.timeline = drawTimeline(column, header.timeline);
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
    const double widest = std::max(canvas.widest(large, size, true), canvas.widest(small, plan.font));
    double y = 0.5 * plan.height + high / 2;
    canvas.cover({x - widest / 2 - size / 2, y - high}, {widest + size, high});
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
        add(base::headingOfLosses(result.total, result.losses.size()), 1.1 * font, amber, true);
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
    canvas.cover({x, y - high}, {wide, high});
    canvas.rectangle({x, y - high}, {wide, high}, cardColour, 0.94);
    y -= 0.4 * font;
    for (const Line& line : lines)
        canvas.text({x + font, y -= 1.45 * line.size}, line.words, line.size, line.colour, Align::left, line.bold);
}

bool drawHelp(Canvas& canvas, const ScreenPlan& plan, std::span<const KeyHelp> keys)
{
    const HelpTable table = helpTable(canvas, plan, keys);
    const double font = table.font, row = helpLine * font, text = table.width - table.keys - 2.5 * font;
    std::vector<std::vector<std::string>> words;
    std::size_t lines = 0;
    for (const KeyHelp& key : keys) {
        words.push_back(wrapped(canvas, key.what, font, false, text));
        lines += words.back().size();
    }
    // A key and its words stay together.
    const std::size_t high = (lines + table.columns - 1) / table.columns + (table.columns > 1 ? 1 : 0);
    // Over the whole window nothing else is drawn, and what was there before would stay.
    if (!table.inBody)
        canvas.rectangle({0, 0}, {static_cast<double>(plan.width), static_cast<double>(plan.height)}, cardColour);
    const double top = table.low + 0.5 * (table.room + row * (static_cast<double>(high) + 1));
    canvas.rectangle({table.from, top - row * (static_cast<double>(high) + 1)},
                     {table.width * static_cast<double>(table.columns), row * (static_cast<double>(high) + 1)}, cardColour,
                     0.95);
    double x = table.from + font, y = top - 0.5 * font;
    std::size_t used = 0;
    for (std::size_t k = 0; k < keys.size(); ++k) {
        if (used + words[k].size() > high) {
            x += table.width;
            y = top - 0.5 * font;
            used = 0;
        }
        used += words[k].size();
        canvas.text({x, y - row + 0.2 * font}, keys[k].key, font, amber, Align::left, true);
        for (const std::string& line : words[k])
            canvas.text({x + table.keys + 0.8 * font, (y -= row) + 0.2 * font}, line, font, white);
    }
    return !table.inBody;
}

}  // namespace palpate::render
