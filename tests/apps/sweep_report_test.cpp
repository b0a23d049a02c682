#include <tests/apps/program.h>
#include <tests/apps/sweep_plan.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace palpate::apps {
namespace {

using nlohmann::json;

// What a browser makes of a page: its document once the scripts have run.
std::string documentOf(const std::string& address, const std::string& profile, const std::string& size = "1200,900")
{
    return Program("/usr/bin/chromium", {"--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                                         "--user-data-dir=" + profile, "--window-size=" + size,
                                         "--virtual-time-budget=5000", "--dump-dom", address})
        .wait()
        .out;
}

std::string partOf(const std::string& page, const std::string& id)
{
    const auto begin = page.find("id=\"" + id + "\"");
    const auto end = page.find("</section>", begin);
    return begin == std::string::npos ? "" : page.substr(begin, end - begin);
}

std::size_t countOf(const std::string& text, const std::string& what)
{
    std::size_t count = 0;
    for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) {
        ++count;
    }
    return count;
}

// What the dashed lines of a chart are stands below its legend, where it lies on no curve.
TEST(SessionReport, NamesTheLinesOfAChartBelowIt)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    figures({"train", "near-vessel", "--headless", "--unpaced", "--setting", "fast", "--report", here / "r.html"});
    const std::string page = documentOf("file://" + std::string(here / "r.html"), here / "profile");
    const std::string distances = partOf(page, "distances");
    const auto legend = distances.find("u-legend"), lines = distances.find("class=\"lines\"");
    ASSERT_NE(lines, std::string::npos);
    EXPECT_LT(legend, lines);
    EXPECT_NE(distances.find("warning: vein, 5 mm", lines), std::string::npos);
}

// How far down a chart the text stands: "translate(26 81)" before it [px].
double placeOf(const std::string& chart, const std::string& text)
{
    const auto at = chart.find(">" + text + "<");
    const auto place = chart.rfind("translate(", at);
    return at == std::string::npos || place == std::string::npos ? -1 : std::stod(chart.substr(chart.find(' ', place)));
}

// Runs the short plan with so many steps of its first axis and another name for one, and draws it. The report's file.
std::string reportWith(const Folder& here, int steps, const std::string& axis, const std::string& name)
{
    std::string text = shortPlan(1);
    const auto put = [&](const std::string& what, const std::string& instead) {
        text.replace(text.find(what), what.size(), instead);
    };
    put("steps = 3", "steps = " + std::to_string(steps));
    put("name = \"" + axis + "\"", "name = \"" + name + "\"");
    writeText(here / "p.toml", text);
    figures({"sweep", here / "p.toml", "-o", here / "s", "--jobs", "2"});
    figures({"sweep", "--report", here / "s"});
    return here / "s" / "report.html";
}

// On a telephone each name of the legend has a row of its own, above the curves. Values that are put into bins are said to
// be so below them.
TEST(SweepReport, TheLegendLiesAboveTheCurvesAndBinsAreNamed)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    const std::string file = reportWith(here, 14, "depth_mm", "depth_of_the_finger_in_the_tissue_mm");
    const std::string page = documentOf("file://" + file, here / "profile", "420,1400");
    const std::string curve = partOf(page, "curve");
    // The highest line of the grid: "M74 116.5L423 116.5".
    double top = 1e9;
    for (auto at = curve.find("d=\"M74 "); at != std::string::npos; at = curve.find("d=\"M74 ", at + 1)) {
        top = std::min(top, std::stod(curve.substr(at + 7)));
    }
    for (const char* const depth : {"1", "2", "3", "4"}) {
        const double y = placeOf(curve, "depth_of_the_finger_in_the_tissue_mm = " + std::string(depth));
        EXPECT_GT(y, 0) << depth;
        EXPECT_LT(y + 14, top) << depth;
    }
    EXPECT_NE(page.find("youngs_kpa has 14 values: they are put into 12 bins"), std::string::npos);
}

// A text of a chart and the place where it stands [px].
struct Placed {
    std::string words;
    double x = 0, y = 0;
};

// The number behind `name` in an element; 0 where it has none.
double attribute(const std::string& element, const std::string& name)
{
    const auto at = element.find(" " + name + "=\"");
    return at == std::string::npos ? 0 : std::stod(element.substr(at + name.size() + 3));
}

std::vector<Placed> textsOf(const std::string& chart)
{
    std::vector<Placed> all;
    for (auto at = chart.find("<text"); at != std::string::npos; at = chart.find("<text", at + 1)) {
        const auto open = chart.find('>', at), close = chart.find("</text", at), place = chart.find("translate(", at);
        const std::string element = chart.substr(at, open - at);
        Placed text{chart.substr(open + 1, close - open - 1), 0, 0};
        if (place < open && std::sscanf(chart.c_str() + place, "translate(%lf %lf)", &text.x, &text.y) == 2) {
            text.x += attribute(element, "x");
            text.y += attribute(element, "y");
            all.push_back(text);
        }
    }
    return all;
}

// Twelve columns have no room for their values on a telephone, whose screen is 390 px wide: there the page says how they
// are read. Names of axes stay in the chart, in several lines.
TEST(SweepReport, NoTextsOfANarrowPageLieOnEachOther)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    const std::string file = reportWith(here, 12, "youngs_kpa", "youngs_modulus_of_the_fat_around_it_kpa");
    const std::string wide = documentOf("file://" + file, here / "profile", "1280,1400");
    EXPECT_NE(wide.find("id=\"fields\"></span>"), std::string::npos);
    std::string narrow = readText(file);
    narrow.insert(narrow.find("</head>"), "<style>html { width: 390px }</style>");  // a window of chromium is wider
    writeText(here / "narrow.html", narrow);
    const std::string page = documentOf("file://" + std::string(here / "narrow.html"), here / "profile");
    EXPECT_NE(page.find("id=\"fields\"> Point at a field to read its value.</span>"), std::string::npos);
    constexpr double letter = 6, high = 11;  // about the least of a text with 12 px
    for (const char* const part : {"map", "rank"}) {
        const std::vector<Placed> texts = textsOf(partOf(page, part));
        EXPECT_GT(texts.size(), 4U) << part;
        for (std::size_t a = 0; a < texts.size(); ++a) {
            for (std::size_t b = 0; b < a; ++b) {
                const auto letters = static_cast<double>(std::min(texts[a].words.size(), texts[b].words.size()));
                EXPECT_TRUE(std::abs(texts[a].y - texts[b].y) >= high ||
                            std::abs(texts[a].x - texts[b].x) >= letter * letters)
                    << part << ": '" << texts[a].words << "' lies on '" << texts[b].words << "'";
            }
        }
    }
    EXPECT_GE(countOf(partOf(page, "rank"), ">youngs_modulus"), 1U);
}

// ECharts takes what a tooltip says as HTML. Names of a plan of somebody else's are none.
TEST(SweepReport, ATooltipShowsNamesAsTheyAre)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    std::string text = readText(reportWith(here, 3, "youngs_kpa", "youngs_kpa"));
    for (const std::string name : {"youngs_kpa", "depth_mm", "force_n"}) {
        for (auto at = text.find('"' + name + '"'); at != std::string::npos; at = text.find('"' + name + '"', at)) {
            text.insert(at + 1, "\\u003ci class=it\\u003e");
        }
    }
    const std::string point = "dispatchAction({ type: \"showTip\", dataIndex: 0, seriesIndex: ";
    text.insert(text.find("</body>"), "<script>charts.curve." + point + "1 }); charts.map." + point + "0 }); charts.rank." +
                                          point + "0 });</script>");
    writeText(here / "named.html", text);
    const std::string page = documentOf("file://" + std::string(here / "named.html"), here / "profile");
    for (const char* const part : {"curve", "map", "rank"}) {
        const std::string chart = partOf(page, part), tip = chart.substr(0, chart.find("<p class=\"note\""));
        EXPECT_NE(tip.find("&lt;i class=it&gt;", tip.rfind("</svg>")), std::string::npos) << part << ": no tooltip";
    }
    EXPECT_EQ(page.find("<i class=\"it\""), std::string::npos);
}

// The bands of a chart of curves, as paths: "M74 268.36L550 208.72...Z".
std::vector<std::string> bandsOf(const std::string& curve)
{
    std::vector<std::string> all;
    for (auto at = curve.find("fill-opacity=\"0.16\""); at != std::string::npos;
         at = curve.find("fill-opacity=\"0.16\"", at + 1)) {
        const auto path = curve.rfind(" d=\"", at) + 4;
        all.push_back(curve.substr(path, curve.find('"', path) - path));
    }
    return all;
}

// The band is drawn although x = 0 is not on the axis, and lies in the chart as a whole; so does a mark beyond all medians.
TEST(SweepReport, BandsAndMarksAreWithinTheChart)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    writeText(here / "p.toml", shortPlan(1) + "[[mark]]\noutput = \"force_n\"\nat = 50\nlabel = \"felt\"\n");
    figures({"sweep", here / "p.toml", "-o", here / "s", "--jobs", "2"});
    figures({"sweep", "--report", here / "s"});
    const std::string address =
        "file://" + std::string(here / "s" / "report.html") + "#x=youngs_kpa&by=(all+together)&output=";
    EXPECT_NE(partOf(documentOf(address + "force_n", here / "profile"), "curve").find(">felt<"), std::string::npos);

    const auto bands = bandsOf(partOf(documentOf(address + "work_mj", here / "profile"), "curve"));
    ASSERT_EQ(bands.size(), 1U);
    EXPECT_EQ(std::ranges::count(bands[0], 'L'), 5);  // two corners at each of three points
    constexpr double top = 44;                        // of the curves, below one row of the legend [px]
    for (auto at = bands[0].find(' '); at != std::string::npos; at = bands[0].find(' ', at + 1)) {
        EXPECT_GE(std::stod(bands[0].substr(at)), top) << bands[0];
    }
}

// One axis that nothing follows: no chart without bars above the words for it.
TEST(SweepReport, WithoutARankingThereIsNoChartOfIt)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    std::string text = shortPlan(1);
    text.replace(text.find("\"force_n\", "), 11, "\"nothing = 0 * force_n\", ");
    writeText(here / "p.toml", text);
    figures({"sweep", here / "p.toml", "-o", here / "s", "--jobs", "2"});
    figures({"sweep", "--report", here / "s"});
    const std::string page = documentOf("file://" + std::string(here / "s" / "report.html"), here / "profile");
    const std::string rank = partOf(page, "rank");
    EXPECT_NE(rank.find("No ranking can be had"), std::string::npos);
    EXPECT_EQ(rank.find("<svg"), std::string::npos);
}

// Curves, map and ranking are drawn by the page itself, offline, and follow what its address chooses.
TEST(SweepReport, IsDrawnByABrowserFromOneFile)
{
    if (!std::filesystem::exists("/usr/bin/chromium")) {
        GTEST_SKIP() << "no chromium here (Debian: chromium)";
    }
    const Folder here;
    std::string text = shortPlan(1, "name = \"A </script> & B\"\n");
    text += "[[mark]]\noutput = \"force_n\"\nat = 0.07\nlabel = \"felt <here>\"\n";
    writeText(here / "p.toml", text);
    figures({"sweep", here / "p.toml", "-o", here / "s", "--jobs", "2"});
    const json ranking = figures({"sweep", "--report", here / "s"});
    const std::string file = here / "s" / "report.html";
    const std::string raw = readText(file);
    EXPECT_EQ(raw.find("src=\"http"), std::string::npos);
    EXPECT_EQ(raw.find("A </script>"), std::string::npos) << "text of a plan must not end a script";

    const std::size_t ranked = raw.find("chart(\"rank\"");
    ASSERT_NE(ranked, std::string::npos);
    EXPECT_NE(raw.substr(ranked, 200).find("containLabel: true"), std::string::npos) << "a long name of an axis is cut off";

    const std::string page = documentOf("file://" + file, here / "profile");
    EXPECT_NE(page.find("data-drawn=\"force_n\""), std::string::npos) << "the script did not come to its end";
    EXPECT_NE(page.find("12 of 12 cases, 0 failed"), std::string::npos);
    const std::string curve = partOf(page, "curve"), map = partOf(page, "map"), rank = partOf(page, "rank");
    for (const char* const depth : {"depth_mm = 1", "depth_mm = 2", "depth_mm = 3", "depth_mm = 4"}) {
        EXPECT_NE(curve.find(depth), std::string::npos) << depth;
    }
    EXPECT_NE(curve.find("felt &lt;here&gt;"), std::string::npos);
    EXPECT_GE(countOf(curve, "<path"), 8U);
    // A field of the map for each of 3 x 4 points, with its value.
    const auto rows = csvRows(here / "s" / "table.csv");
    std::size_t found = 0;
    for (std::size_t c = 1; c < rows.size(); ++c) {
        char value[32];
        std::snprintf(value, sizeof value, "%.4g", std::stod(rows[c][6]));
        found += map.find(std::string(">") + value + "<") != std::string::npos ? 1 : 0;
    }
    EXPECT_EQ(found, 12U);
    // The ranking's table says what --json says.
    const json& first = ranking["outputs"]["force_n"][0];
    EXPECT_NE(rank.find("<td>" + first["axis"].get<std::string>() + "</td>"), std::string::npos);

    const std::string other =
        documentOf("file://" + file + "#output=work_mj&x=depth_mm&by=(all together)", here / "profile");
    EXPECT_NE(other.find("data-drawn=\"work_mj\""), std::string::npos);
    EXPECT_EQ(partOf(other, "curve").find("depth_mm = 1"), std::string::npos);
    EXPECT_NE(partOf(other, "curve").find(">work_mj<"), std::string::npos);
}

}  // namespace
}  // namespace palpate::apps
