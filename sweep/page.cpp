#include <base/mapped.h>
#include <sweep/report.h>

#include <report/assets.h>
#include <report/html.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

namespace palpate::sweep {

using nlohmann::json;

namespace {

constexpr std::size_t maxRows = 50000;  // in the page: of more, some at random
constexpr std::size_t maxErrors = 20;   // listed

json valueOf(const KeyValue& value)
{
    return std::visit([](const auto& v) { return json(v); }, value);
}

json axesOf(const SweepPlan& plan)
{
    json out = json::array();
    for (const auto& a : plan.axes) {
        const bool words = !a.values.empty() &&
                           (std::holds_alternative<std::string>(a.values[0]) || std::holds_alternative<bool>(a.values[0]));
        json values = base::mapped<json>(a.values, [](const auto& v) { return valueOf(v); });
        out.push_back({{"name", a.name}, {"key", a.key}, {"log", a.log}, {"words", words}, {"values", values}});
    }
    return out;
}

// Of so many cases the page holds one.
std::size_t stepOf(const std::vector<std::optional<SweepRow>>& rows)
{
    return std::max<std::size_t>((rows.size() + maxRows - 1) / maxRows, 1);
}

json rowsOf(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows)
{
    json out = json::array();
    const std::size_t step = stepOf(rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
        // At random: every n-th case of a grid has the same levels again and again.
        if (mixedSeed({i}) % step != 0 || !rows[i] || rows[i]->failed()) {
            continue;
        }
        json row = json::array();
        std::ranges::transform(sweepPoint(plan, i).parameters, std::back_inserter(row),
                               [](const auto& p) { return valueOf(p); });
        std::ranges::transform(rows[i]->outputs, std::back_inserter(row),
                               [](double v) { return std::isfinite(v) ? json(v) : json(); });
        out.push_back(std::move(row));
    }
    return out;
}

std::string choice(const char* id, const char* label)
{
    return fmt::format("<label>{} <select id=\"{}\"></select></label>", label, id);
}

std::string failures(const std::vector<std::optional<SweepRow>>& rows)
{
    std::string list;
    std::size_t count = 0;
    for (const auto& row : rows) {
        if (row && row->failed() && ++count <= maxErrors) {
            list += fmt::format("<tr><td>{}</td><td>{}</td></tr>", row->index, report::escape(row->error));
        }
    }
    if (count == 0) {
        return "";
    }
    return fmt::format(
        "<section class=\"card\"><h2>Cases that failed: {}</h2><table "
        "class=\"plain\"><thead><tr><th>case</th><th>error</th>"
        "</tr></thead><tbody>{}</tbody></table></section>",
        count, list);
}

std::string header(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows)
{
    std::size_t there = 0, failed = 0;
    std::set<std::string> builds;
    for (const auto& row : rows) {
        there += row ? 1 : 0;
        failed += row && row->failed() ? 1 : 0;
        if (row) {
            builds.insert(row->build);
        }
    }
    std::string out = fmt::format(
        "<header><div><p class=\"eyebrow\">Palpate sweep &middot; scene {} &middot; {}</p><h1>{}</h1><p "
        "class=\"outcome\">{}</p>"
        "<p class=\"note\" id=\"count\">{} of {} cases, {} failed; {} points, {} repeat{}; seed {}</p>",
        report::escape(plan.base.name), designNames[static_cast<std::size_t>(plan.design)], report::escape(plan.name),
        report::escape(plan.about), there, rows.size(), failed, plan.points.size(), plan.repeats,
        plan.repeats == 1 ? "" : "s", plan.seed);
    if (stepOf(rows) > 1) {
        out +=
            fmt::format("<p class=\"note\">This page holds one case in {}, at random; table.csv has all</p>", stepOf(rows));
    }
    for (const std::string& build : builds) {
        out += fmt::format("<p class=\"note\">{}</p>", report::escape(build));
    }
    return out + "</div></header>";
}

std::string body(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows)
{
    return header(plan, rows) +
           fmt::format(
               "<section class=\"card\"><h2>Response</h2><div class=\"choices\">{}{}{}</div><div id=\"curve\" "
               "class=\"chart\">"
               "</div><p class=\"note\">Medians; the band holds the middle half of the cases at each point, over repeats "
               "and all other axes.<span id=\"bins\"></span> <span class=\"hint\">Drag on the strip to look closer; a name "
               "in "
               "the legend hides its curve.</span></p></section>"
               "<section class=\"card\"><h2>Map</h2><div class=\"choices\">{}{}</div><div id=\"map\" class=\"chart\"></div>"
               "<p class=\"note\">Mean of the cases in each field, of the output chosen above; an axis "
               "with over twelve values is put into bins.<span id=\"fields\"></span></p></section>"
               "<section class=\"card\"><h2>What matters</h2><div id=\"rank\" class=\"chart\"></div><p class=\"note\" "
               "id=\"method\"></p><div class=\"scroll\"><table class=\"plain\" id=\"indices\"></table></div></section>",
               choice("output", "output"), choice("x", "over"), choice("by", "a curve for each"), choice("mapx", "across"),
               choice("mapy", "up")) +
           failures(rows) +
           fmt::format(
               "<section class=\"card\"><h2>Plan</h2><details><summary>as it was run</summary><pre>{}</pre></details>"
               "</section>",
               report::escape(plan.text));
}

}  // namespace

std::string sweepPage(const SweepPlan& plan, const std::vector<std::optional<SweepRow>>& rows)
{
    const auto markData = [](const auto& m) -> json { return {{"output", m.output}, {"at", m.at}, {"label", m.label}}; };
    json data{{"axes", axesOf(plan)},
              {"outputs", base::mapped<json>(plan.outputs, [](const auto& o) { return json(o.name); })},
              {"marks", base::mapped<json>(plan.marks, markData)},
              {"rows", rowsOf(plan, rows)},
              {"sensitivity", sensitivity(plan, rows)}};

    std::string out =
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width, initial-scale=1\"><title>" +
        report::escape(plan.name) + "</title>\n<style>";
    out.append(report::asset("assets/report.css")).append(report::asset("assets/sweep.css"));
    out.append("</style></head>\n<body><main>").append(body(plan, rows));
    out +=
        "<footer>Written by Palpate. Charts by Apache ECharts (Apache License 2.0).</footer></main>\n"
        "<noscript><p>The charts need JavaScript.</p></noscript>\n<script type=\"application/json\" id=\"data\">" +
        report::embedded(data) + "</script>\n<script>";
    out.append(report::chartLibrary("assets/echarts.min.js"))
        .append("</script>\n<script>")
        .append(report::asset("assets/sweep.js"));
    return out + "</script></body></html>\n";
}

}  // namespace palpate::sweep
