#include <report/groups.h>

#include <base/counted.h>
#include <base/folds.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/printable.h>
#include <base/round_step.h>
#include <base/utf8.h>
#include <report/html.h>
#include <report/measure_table.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::report {

namespace {

// Of a drawing [px]: the strips of dots of all groups, below them an axis.
constexpr double plotWidth = 430, rowHeight = 18, nameWidth = 96, right = 12, axisHeight = 20;

// Which colour a group has in all drawings.
std::string colourOf(std::size_t group)
{
    return fmt::format("var(--c{})", group % 7);
}

// As printed; infinite stays so.
std::vector<double> rounded(std::vector<double> values, const haptics::Measure& measure)
{
    const double unit = std::pow(10.0, decimalsOf(measure));
    for (double& v : values) {
        v = base::printable(std::round(v * unit) / unit, decimalsOf(measure));
    }
    return values;
}

std::string shortened(const std::string& name, std::size_t most)
{
    std::string out;
    std::size_t characters = 0;
    for (const char c : name) {
        characters += base::beginsCharacter(c) ? 1 : 0;
        if (characters < most) {
            out += c;
        }
    }
    return characters <= most ? name : out + "…";
}

bool without(const std::vector<double>& values)
{
    return std::ranges::none_of(values, [](double v) { return std::isfinite(v); });
}

// Of all sessions, as printed.
std::vector<double> allRounded(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    std::vector<double> all;
    for (const ScoredGroup& g : groups) {
        const auto values = rounded(valuesOf(g, measure), measure);
        all.insert(all.end(), values.begin(), values.end());
    }
    return all;
}

struct Range {
    double low = INFINITY, high = -INFINITY;
};

Range rangeOf(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    Range range;
    for (const double v : allRounded(groups, measure)) {
        range.low = std::isfinite(v) ? std::min(range.low, v) : range.low;
        range.high = std::isfinite(v) ? std::max(range.high, v) : range.high;
    }
    return range;
}

// Whether no session differs from another, as printed: also not in having no value.
bool constant(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    const std::vector<double> all = allRounded(groups, measure);
    const auto sessions = base::sumOf(
        groups, [](const auto& g) { return g.sessions.size(); }, std::size_t{0});
    const bool same = std::ranges::all_of(all, [&](double v) { return v == all.front(); });
    return same && (all.size() == sessions || all.empty() || std::isinf(all.front()));
}

// 1, 2 or 5 times a power of ten, so that a range has four to ten steps.
double stepOf(double span)
{
    const double ten = std::pow(10, std::floor(std::log10(span)));
    const double part = span / ten;
    return part >= 4 ? ten : part >= 2 ? ten / 2 : ten / 5;
}

// @param finest  what the last printed digit stands for
std::string axisBelow(const Range& range, double finest, double y, const auto& x)
{
    const double step = stepOf(std::max(range.high - range.low, finest));
    const int decimals = std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
    std::string out = fmt::format("<line x1=\"{:.0f}\" y1=\"{:.1f}\" x2=\"{:.0f}\" y2=\"{:.1f}\" class=\"axis\"/>",
                                  nameWidth, y, plotWidth - right, y);
    for (const double at : base::multiplesIn(range.low, range.high, step)) {
        out += fmt::format(
            "<line x1=\"{0:.1f}\" y1=\"{1:.1f}\" x2=\"{0:.1f}\" y2=\"{2:.1f}\" class=\"axis\"/><text x=\"{0:.1f}\" "
            "y=\"{3:.1f}\" text-anchor=\"middle\">{4:.{5}f}</text>",
            x(at), y, y + 4, y + 15, base::printable(at, decimals), decimals);
    }
    return out;
}

// One row of dots per group on a common axis, with a bar from the lower to the upper quartile and a line at the median. A
// value that is not there stands at the right edge.
std::string strip(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    const Range range = rangeOf(groups, measure);
    const double span = range.high > range.low ? range.high - range.low : 1.0;
    const auto x = [&](double v) {
        return std::isfinite(v) ? nameWidth + 6 + (plotWidth - nameWidth - right - 14) * (v - range.low) / span
                                : plotWidth - 5;
    };
    const double height = rowHeight * static_cast<double>(groups.size());
    std::string out = fmt::format("<svg class=\"strip\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">",
                                  plotWidth, height + axisHeight, measure.label);
    double y = rowHeight / 2;
    for (std::size_t i = 0; i < groups.size(); ++i) {
        const auto values = rounded(valuesOf(groups[i], measure), measure);
        out += fmt::format("<text x=\"{:.0f}\" y=\"{:.1f}\" text-anchor=\"end\">{}<title>{}</title></text>", nameWidth - 6,
                           y + 4, escape(shortened(groups[i].name, 14)), escape(groups[i].name));
        if (values.empty()) {
            y += rowHeight;
            continue;
        }
        const double first = x(quantile(values, 0.25)), last = x(quantile(values, 0.75)), middle = x(quantile(values, 0.5));
        out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"12\" fill=\"{}\" opacity=\"0.25\"/>",
                           first, y - 6, std::max(1.0, last - first), colourOf(i));
        for (const double v : values) {
            out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.4\" fill=\"{}\" opacity=\"0.6\"/>", x(v), y,
                               colourOf(i));
        }
        out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"2.4\" height=\"14\" class=\"median\"/>", middle - 1.2,
                           y - 7);
        y += rowHeight;
    }
    return out + axisBelow(range, std::pow(10.0, -decimalsOf(measure)), height, x) + "</svg>";
}

std::string titleOf(const haptics::Measure& measure)
{
    return fmt::format("{}{}{}{}", escape(measure.label), *measure.unit == 0 ? "" : " [", escape(measure.unit),
                       *measure.unit == 0 ? "" : "]");
}

std::string row(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    const int decimals = decimalsOf(measure);
    std::string medians, deltas;
    for (std::size_t i = 0; i < groups.size(); ++i) {
        const auto values = valuesOf(groups[i], measure);
        const auto at = [&](double fraction) { return cell(quantile(values, fraction), decimals); };
        medians += fmt::format("<div><i style=\"background:{}\"></i>{}: {}</div>", colourOf(i), escape(groups[i].name),
                               quartilesText(at(0.5), at(0.25), at(0.75)));
    }
    for (std::size_t b = 1; b < groups.size(); ++b) {
        const auto delta = effectSize(groups[0], groups[b], measure);
        deltas += fmt::format("<div>over {}: {}</div>", escape(groups[b].name), deltaText(delta));
    }
    return fmt::format("<tr><th>{}</th><td class=\"key\">{}</td><td>{}</td><td class=\"n words\">{}</td></tr>",
                       titleOf(measure), medians, strip(groups, measure), deltas);
}

}  // namespace

std::vector<double> valuesOf(const ScoredGroup& group, const haptics::Measure& measure)
{
    const auto column = static_cast<std::size_t>(&measure - haptics::measures().data());
    auto values = base::mapped<double>(group.sessions, [&](const auto& session) { return session[column]; });
    std::erase_if(values, [](double value) { return std::isnan(value); });
    return values;
}

int decimalsOf(const haptics::Measure& measure) noexcept
{
    return std::max(measure.decimals, 1);
}

std::vector<double> rowOf(const haptics::Score& score)
{
    return base::mapped<double>(haptics::measures(), [&](const haptics::Measure& m) { return m.value(score); });
}

double quantile(std::vector<double> values, double fraction)
{
    if (values.empty()) {
        return NAN;
    }
    std::ranges::sort(values);
    const double place = fraction * static_cast<double>(values.size() - 1);
    const auto below = static_cast<std::size_t>(place);
    const double rest = place - static_cast<double>(below);
    // Between two that are infinite there is no straight line.
    return rest > 0 && values[below + 1] > values[below] ? values[below] + rest * (values[below + 1] - values[below])
                                                         : values[below];
}

double cliffsDelta(const std::vector<double>& a, const std::vector<double>& b)
{
    double above = 0;
    for (const double x : a) {
        for (const double y : b) {
            above += x > y ? 1 : x < y ? -1 : 0;
        }
    }
    return above / static_cast<double>(a.size() * b.size());
}

std::optional<double> effectSize(const ScoredGroup& a, const ScoredGroup& b, const haptics::Measure& measure)
{
    const auto first = rounded(valuesOf(a, measure), measure), second = rounded(valuesOf(b, measure), measure);
    const bool few = std::min(first.size(), second.size()) < 2;
    return few || (without(first) && without(second)) ? std::nullopt : std::optional(cliffsDelta(first, second));
}

std::string quartilesText(const std::string& median, const std::string& low, const std::string& high)
{
    return median == "-" && low == "-" && high == "-" ? "-" : fmt::format("{} ({} to {})", median, low, high);
}

std::string groupsPart(const std::vector<ScoredGroup>& groups)
{
    std::string names, same;
    for (std::size_t i = 0; i < groups.size(); ++i) {
        names += fmt::format("<span><i style=\"background:{}\"></i>{} ({})</span>", colourOf(i), escape(groups[i].name),
                             base::counted(groups[i].sessions.size(), "session"));
    }
    std::string rows;
    for (const haptics::Measure& m : haptics::measures()) {
        if (!constant(groups, m)) {
            rows += row(groups, m);
            continue;
        }
        const auto values = valuesOf(groups[0], m);
        const double value = values.empty() ? INFINITY : values[0];
        same += fmt::format("{}{} {}", same.empty() ? "" : ", ", titleOf(m),
                            std::isfinite(value) ? cell(value, m.decimals) : "without a value");
    }
    std::string body =
        "<header><div><h1>Groups compared</h1><p class=\"key\">" + names +
        "</p><p>A dot is a session, the bar goes from the lower to the upper quartile, the line is the median; a dot "
        "beyond the axis has no value. Cliff's delta says how much more often a value of " +
        escape(groups[0].name) +
        " lies above one of the other group than below it, from -1 to 1; by convention 0.15, 0.33 and 0.47 "
        "are small, medium and large. It needs two sessions with a value in each group; values that are the "
        "same as printed count as equal.</p></div></header><section class=\"card\"><div class=\"scroll\"><table "
        "class=\"plain progress groups\"><thead><tr><th>Measure</th>"
        "<th>Median (quartiles)</th><th>Sessions</th><th class=\"n words\">" +
        (groups.size() > 1 ? "Cliff's delta of " + escape(groups[0].name) : "") + "</th></tr></thead><tbody>" + rows +
        "</tbody></table></div>";
    if (!same.empty()) {
        body += "<p class=\"note\">The same in all sessions: " + same + ".</p>";
    }
    return body + "</section>";
}

void writeGroupReport(const std::filesystem::path& html, const std::vector<ScoredGroup>& groups)
{
    base::writeWhole(html, page("Groups - Palpate", groupsPart(groups), {{"charts", nlohmann::json::object()}}));
}

}  // namespace palpate::report
