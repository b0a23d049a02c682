#include <trainer/charts.h>

#include <base/round_step.h>
#include <base/said.h>
#include <trainer/widgets.h>

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

namespace palpate::trainer {

namespace {

constexpr Rgb ground{0.09F, 0.10F, 0.13F};

using base::said;
using base::tr;

ImU32 ink(Rgb c, float opacity = 1)
{
    return ImGui::GetColorU32({c.r, c.g, c.b, opacity});
}

struct Range {
    double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();

    void take(double v) noexcept
    {
        if (std::isfinite(v)) {
            low = std::min(low, v);
            high = std::max(high, v);
        }
    }
    void take(const std::optional<double>& v) noexcept
    {
        if (v) {
            take(*v);
        }
    }
};

// What the curves and their levels need, with some room; from 0 on where that is near.
Range rangeOf(const std::vector<ChartLine>& lines)
{
    Range r;
    for (const ChartLine& line : lines) {
        for (const double v : line.curve->values) {
            r.take(v);
        }
        r.take(line.curve->atLeast);
        r.take(line.curve->atMost);
    }
    if (r.low > r.high) {
        return {0, 1};
    }
    if (r.low > 0 && r.low < 0.6 * r.high) {
        r.low = 0;
    }
    const double room = std::max(0.08 * (r.high - r.low), 1e-6 + 0.02 * std::abs(r.high));
    return {r.low == 0 ? 0 : r.low - room, r.high + room};
}

// From values to pixels.
struct Plane {
    ImVec2 from, to;  // upper left and lower right
    Range y;
    std::size_t sessions = 1;

    float across(std::size_t session) const
    {
        const float fraction =
            (static_cast<float>(session) + 0.5F) / static_cast<float>(std::max<std::size_t>(sessions, 1));
        return from.x + fraction * (to.x - from.x);
    }
    float down(double v) const { return to.y - static_cast<float>((v - y.low) / (y.high - y.low)) * (to.y - from.y); }
};

void drawAxes(ImDrawList& draw, const Plane& p)
{
    const float em = ImGui::GetFontSize();
    draw.AddRectFilled(p.from, p.to, ink(ground));
    const auto rows = ticksOf(p.y.low, p.y.high, static_cast<int>((p.to.y - p.from.y) / (1.8F * em)));
    for (const double v : rows) {
        const float at = p.down(v);
        const double step = rows.size() > 1 ? rows[1] - rows[0] : 1;
        const std::string text = said("{:.{}Lf}", v == 0 ? 0.0 : v, step < 0.1 ? 2 : step < 1 ? 1 : 0);
        draw.AddLine({p.from.x, at}, {p.to.x, at}, ink(quiet, 0.25F));
        draw.AddText({p.from.x - ImGui::CalcTextSize(text.c_str()).x - 0.4F * em, at - 0.5F * em}, ink(quiet),
                     text.c_str());
    }
    const auto most = std::max(2, static_cast<int>((p.to.x - p.from.x) / (3 * em)));
    for (const double v : ticksOf(1, static_cast<double>(std::max<std::size_t>(p.sessions, 1)), most)) {
        if (v < 1 || v != std::floor(v)) {
            continue;
        }
        const std::string text = said("{:.0f}", v);
        const float at = p.across(static_cast<std::size_t>(v) - 1);
        draw.AddText({at - 0.5F * ImGui::CalcTextSize(text.c_str()).x, p.to.y + 0.15F * em}, ink(quiet), text.c_str());
    }
}

// A line across that is to be reached, or not to be passed.
struct Level {
    double value = 0;
    Rgb colour;
    std::string name;
    bool below = false;  // its name stands below it, where there is room
};

void drawLevel(ImDrawList& draw, const Plane& p, const Level& level)
{
    const float em = ImGui::GetFontSize(), at = p.down(level.value);
    for (float x = p.from.x; x < p.to.x; x += 0.8F * em) {
        draw.AddLine({x, at}, {std::min(x + 0.45F * em, p.to.x), at}, ink(level.colour), 1.5F);
    }
}

// Over the curves, which would cross it out.
void drawName(ImDrawList& draw, const Plane& p, const Level& level)
{
    const float em = ImGui::GetFontSize(), at = p.down(level.value);
    const bool roomAbove = at - 1.15F * em > p.from.y, roomBelow = at + 1.2F * em < p.to.y;
    const float up = (level.below && roomBelow) || !roomAbove ? 0.1F * em : -1.1F * em;
    const ImVec2 size = ImGui::CalcTextSize(level.name.c_str());
    const ImVec2 from{p.to.x - size.x - 0.3F * em, at + up};
    draw.AddRectFilled({from.x - 0.2F * em, from.y}, {p.to.x, from.y + size.y}, ink(ground, 0.6F));
    draw.AddText(from, ink(level.colour), level.name.c_str());
}

void drawCurve(ImDrawList& draw, const Plane& p, const ChartLine& line, std::size_t number)
{
    const auto& values = line.curve->values;
    const float mark = 0.22F * ImGui::GetFontSize();
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (!std::isfinite(values[i])) {
            continue;
        }
        const ImVec2 at{p.across(i), p.down(values[i])};
        if (i > 0 && std::isfinite(values[i - 1])) {
            draw.AddLine({p.across(i - 1), p.down(values[i - 1])}, at, ink(line.colour), 2);
        }
        number == 0 ? draw.AddCircleFilled(at, mark, ink(line.colour))
                    : draw.AddRectFilled({at.x - mark, at.y - mark}, {at.x + mark, at.y + mark}, ink(line.colour));
    }
}

}  // namespace

std::vector<double> ticksOf(double low, double high, int most)
{
    if (!(high > low) || most < 1) {
        return {low};
    }
    return base::multiplesIn(low, high, base::roundStep((high - low) / most, true));
}

void drawCurves(const std::vector<ChartLine>& lines, float wide, float high)
{
    const float em = ImGui::GetFontSize();
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    Plane p{{at.x + 3.2F * em, at.y + 0.3F * em}, {at.x + wide - 0.3F * em, at.y + high - 2.6F * em}, rangeOf(lines), 1};
    for (const ChartLine& line : lines) {
        p.sessions = std::max(p.sessions, line.curve->values.size());
    }
    drawAxes(draw, p);
    std::vector<Level> levels;
    for (std::size_t i = 0; i < lines.size(); ++i) {
        const Curve& c = *lines[i].curve;
        const bool several = lines.size() > 1;
        const Rgb colour = several ? lines[i].colour : green;
        if (c.atLeast) {
            levels.push_back({*c.atLeast, colour, said(tr("at least {:Lg}"), *c.atLeast), true});
        }
        if (c.atMost) {
            levels.push_back({*c.atMost, colour, several ? c.label : said(tr("at most {:Lg}"), *c.atMost), i > 0});
        }
    }
    std::ranges::for_each(levels, [&](const Level& l) { drawLevel(draw, p, l); });
    for (std::size_t i = 0; i < lines.size(); ++i) {
        drawCurve(draw, p, lines[i], i);
    }
    std::ranges::for_each(levels, [&](const Level& l) { drawName(draw, p, l); });
    const char* const below = tr("session");
    draw.AddText({0.5F * (p.from.x + p.to.x - ImGui::CalcTextSize(below).x), p.to.y + 1.2F * em}, ink(quiet), below);
    // What can have the focus is scrolled to by keys.
    ImGui::PushID(lines.front().curve);
    ImGui::InvisibleButton("chart", {wide, high});
    ImGui::PopID();
}

Rgb groupColour(std::size_t group) noexcept
{
    constexpr std::array colours{skyBlue, orange, green};
    return colours[group % colours.size()];
}

void drawSpreads(const ComparedMeasure& measure, float wide, float high)
{
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    Range r;
    for (const Spread& s : measure.groups) {
        for (const double v : s.values) {
            r.take(v);
        }
    }
    const float margin = 0.4F * ImGui::GetFontSize(), row = high / static_cast<float>(measure.groups.size());
    const auto across = [&](double v) {
        const double fraction = r.high > r.low ? (v - r.low) / (r.high - r.low) : 0.5;
        return at.x + margin + static_cast<float>(std::clamp(fraction, 0.0, 1.0)) * (wide - 2 * margin);
    };
    for (std::size_t g = 0; g < measure.groups.size(); ++g) {
        const Spread& s = measure.groups[g];
        const float middle = at.y + (static_cast<float>(g) + 0.5F) * row, half = 0.32F * row;
        if (s.values.empty()) {
            continue;
        }
        draw.AddRectFilled({across(s.lower), middle - half}, {across(s.upper), middle + half}, ink(groupColour(g), 0.3F));
        for (const double v : s.values) {
            draw.AddCircleFilled({across(v), middle}, 0.16F * ImGui::GetFontSize(), ink(groupColour(g), 0.8F));
        }
        if (std::isfinite(s.median)) {
            draw.AddLine({across(s.median), middle - half}, {across(s.median), middle + half}, ink({1, 1, 1}), 2);
        }
    }
    ImGui::Dummy({wide, high});
}

}  // namespace palpate::trainer
