#include <report/groups.h>

#include <base/outputs.h>
#include <report/html.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::report {

namespace {

constexpr double plotWidth = 420, rowHeight = 14, pad = 8;  // of a strip of dots [px]

std::string number(double value, int decimals)
{
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, decimals) : "-";
}

// One row of dots per group on a common axis, with a bar from the lower to the upper quartile and a line at the median.
std::string strip(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    double low = INFINITY, high = -INFINITY;
    for (const ScoredGroup& g : groups) {
        for (const double v : valuesOf(g, measure)) {
            low = std::isfinite(v) ? std::min(low, v) : low;
            high = std::isfinite(v) ? std::max(high, v) : high;
        }
    }
    const double span = high > low ? high - low : 1.0;
    const auto x = [&](double v) {
        return std::isfinite(v) && std::isfinite(low) ? pad + (plotWidth - 2 * pad) * (v - low) / span : plotWidth - 2;
    };
    std::string out = fmt::format("<svg width=\"{:.0f}\" height=\"{:.0f}\" role=\"img\" aria-label=\"{}\">", plotWidth,
                                  rowHeight * static_cast<double>(groups.size()), measure.key);
    double y = rowHeight / 2;
    for (const ScoredGroup& g : groups) {
        const auto values = valuesOf(g, measure);
        const double first = x(quantile(values, 0.25)), last = x(quantile(values, 0.75)), middle = x(quantile(values, 0.5));
        out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"10\" fill=\"#8ab\" opacity=\"0.4\"/>",
                           first, y - 5, std::max(1.0, last - first));
        for (const double v : values) {
            out += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"#357\" opacity=\"0.5\"/>", x(v), y);
        }
        out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"2\" height=\"12\" fill=\"#c33\"/>", middle - 1, y - 6);
        y += rowHeight;
    }
    return out + "</svg>";
}

std::string row(const std::vector<ScoredGroup>& groups, const haptics::Measure& measure)
{
    const int decimals = measure.decimals + (measure.decimals == 0 ? 1 : 0);
    std::string medians, deltas;
    for (const ScoredGroup& g : groups) {
        const auto values = valuesOf(g, measure);
        medians += fmt::format("{}{} ({} to {})", medians.empty() ? "" : "<br>", number(quantile(values, 0.5), decimals),
                               number(quantile(values, 0.25), decimals), number(quantile(values, 0.75), decimals));
    }
    for (std::size_t b = 1; b < groups.size(); ++b) {
        deltas += fmt::format("{}{:+.2f}", b > 1 ? "<br>" : "",
                              cliffsDelta(valuesOf(groups[0], measure), valuesOf(groups[b], measure)));
    }
    return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>", escape(measure.title), medians,
                       strip(groups, measure), deltas);
}

}  // namespace

std::vector<double> valuesOf(const ScoredGroup& group, const haptics::Measure& measure)
{
    std::vector<double> values;
    for (const haptics::Score& s : group.scores) {
        values.push_back(measure.value(s));
    }
    return values;
}

double quantile(std::vector<double> values, double share)
{
    std::ranges::sort(values);
    const double place = share * static_cast<double>(values.size() - 1);
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

void writeGroupReport(const std::filesystem::path& html, const std::vector<ScoredGroup>& groups)
{
    std::string names, others;
    for (const ScoredGroup& g : groups) {
        names += fmt::format("{}{} ({} sessions)", names.empty() ? "" : ", ", escape(g.name), g.scores.size());
        others += &g == groups.data() ? "" : (others.empty() ? "" : "<br>") + escape(g.name);
    }
    std::string body =
        "<header><div><h1>Groups compared</h1><p>From top to bottom in every row: " + names +
        ". A dot is a session, the bar goes from the lower to the upper quartile, the line is the median. "
        "Cliff's delta says how much more often a value of " +
        escape(groups[0].name) +
        " lies above one of the other group than below it, from -1 to 1; by convention 0.15, 0.33 and 0.47 are "
        "small, medium and large.</p></div></header><section class=\"card\"><table><tr><th>measure</th><th>median "
        "(quartiles)</th><th></th><th>Cliff's delta over<br>" +
        others + "</th></tr>";
    for (const haptics::Measure& m : haptics::measures()) {
        const bool any = std::ranges::any_of(groups, [&](const ScoredGroup& g) {
            return std::ranges::any_of(valuesOf(g, m), [](double v) { return std::isfinite(v); });
        });
        body += any ? row(groups, m) : "";
    }
    base::writeWhole(html, page("Groups - Palpate", body + "</table></section>", {{"charts", nlohmann::json::object()}}));
}

}  // namespace palpate::report
