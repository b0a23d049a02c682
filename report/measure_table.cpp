#include <report/measure_table.h>

#include <base/printable.h>
#include <haptics/measures.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace palpate::report {

std::string cell(double value, int decimals)
{
    return std::isfinite(value) ? fmt::format("{:.{}f}", base::printable(value, decimals), decimals) : "-";
}

std::string deltaText(const std::optional<double>& delta)
{
    return delta ? fmt::format("{:+.2f}", base::printable(*delta, 2)) : "-";
}

std::string measureTable(const std::vector<std::string>& heads, const std::vector<std::vector<std::string>>& columns)
{
    std::vector<std::size_t> widths;
    for (std::size_t c = 0; c < heads.size(); ++c) {
        widths.push_back(std::max<std::size_t>(heads[c].size(), 8));
        for (const std::string& value : columns[c]) {
            widths[c] = std::max(widths[c], value.size());
        }
    }
    std::string text = fmt::format("{:<12}", "");
    for (std::size_t c = 0; c < heads.size(); ++c) {
        text += fmt::format("  {:>{}}", heads[c], widths[c]);
    }
    for (std::size_t m = 0; m < haptics::measures().size(); ++m) {
        if (std::ranges::all_of(columns, [&](const auto& column) { return column[m] == "-"; })) {
            continue;
        }
        text += fmt::format("\n{:<12}", haptics::measures()[m].title);
        for (std::size_t c = 0; c < heads.size(); ++c) {
            text += fmt::format("  {:>{}}", columns[c][m], widths[c]);
        }
    }
    return text;
}

std::string groupTable(const std::vector<ScoredGroup>& groups)
{
    std::vector<std::string> heads;
    std::vector<std::vector<std::string>> columns;
    for (const ScoredGroup& g : groups) {
        heads.push_back(fmt::format("{} (n={})", g.name, g.sessions.size()));
        columns.emplace_back();
        for (const haptics::Measure& m : haptics::measures()) {
            const auto values = valuesOf(g, m);
            const int decimals = decimalsOf(m);
            const auto at = [&](double fraction) { return cell(quantile(values, fraction), decimals); };
            columns.back().push_back(quartilesText(at(0.5), at(0.25), at(0.75)));
        }
    }
    for (std::size_t a = 0; a < groups.size(); ++a) {
        for (std::size_t b = a + 1; b < groups.size(); ++b) {
            heads.push_back(groups[a].name + " over " + groups[b].name);
            columns.emplace_back();
            for (const haptics::Measure& m : haptics::measures()) {
                const auto delta = effectSize(groups[a], groups[b], m);
                columns.back().push_back(deltaText(delta));
            }
        }
    }
    return fmt::format("Medians (quartiles){}\n{}",
                       groups.size() > 1 ? ", and Cliff's delta of one group over another (-1 to 1)" : "",
                       measureTable(heads, columns));
}

}  // namespace palpate::report
