#include <base/error.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <report/chart/axis.h>
#include <report/chart/chart.h>
#include <report/html.h>

#include <nlohmann/json.hpp>

#include <cmath>

namespace palpate::report {

namespace {

using nlohmann::json;

json column(const std::vector<double>& values)
{
    return base::mapped<json>(values, [&](const double v) { return std::isfinite(v) ? json(v) : json(); });
}

json axis(const std::string& label, bool log, AxisRange range)
{
    return {{"label", label}, {"log", log}, {"range", {range.low, range.high}}};
}

json chartData(const DrawableChart& drawn)
{
    const Chart& c = drawn.chart;
    const auto seriesData = [](const ChartSeries& s) -> json {
        return {{"label", s.name},   {"line", s.line},   {"markers", s.markers},
                {"points", s.label}, {"x", column(s.x)}, {"y", column(s.y)}};
    };
    const auto lineData = [](const ChartLine& b) -> json { return {{"at", b.y}, {"label", b.name}, {"colour", "soft"}}; };
    return {{"scatter", true},
            {"x", axis(c.xLabel, c.logX, drawn.x)},
            {"y", axis(c.yLabel, c.logY, drawn.y)},
            {"series", base::mapped<json>(c.series, seriesData)},
            {"lines", base::mapped<json>(c.bounds, lineData)}};
}

}  // namespace

void writeChartHtml(std::span<const Chart> charts, const std::string& title, const std::filesystem::path& file,
                    const std::string& below)
{
    base::failIf(charts.empty() && below.empty(), "{}: there is no chart to draw", file.native());
    json data = {{"charts", json::object()}};
    std::string body = "<header><div><p class=\"eyebrow\">Palpate</p><h1>" + escape(title) + "</h1></div></header>";
    for (std::size_t i = 0; i < charts.size(); ++i) {
        const DrawableChart drawn = drawableChart(charts[i], file);
        const std::string id = "chart" + std::to_string(i);
        body += chartCard(id, escape(drawn.chart.title), escape(drawn.chart.note));
        data["charts"][id] = chartData(drawn);
    }
    body +=
        "<p class=\"note\">Drag to look closer, click twice to see all; a name in the legend hides its points. The pointer "
        "shows the values of the point below it.</p>";
    base::writeWhole(file, page(title, body + below, data));
}

}  // namespace palpate::report
