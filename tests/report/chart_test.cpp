#include <base/inputs.h>
#include <report/chart/axis.h>
#include <report/chart/chart.h>
#include <report/chart/labels.h>

#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <glm/common.hpp>
#include <nlohmann/json.hpp>

#include <signal.h>
#include <sys/resource.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace palpate::report {
namespace {

using tests::errorOf;
using tests::Folder;

constexpr double infinity = std::numeric_limits<double>::infinity();

Chart sample()
{
    Chart chart{"Error against time", "time per update [us]", "error [%]", true, true, {}, {}, "One push."};
    chart.series.push_back({"chainmail", {20, 45, 90}, {9, 7, 6.5}, true});
    chart.series.push_back({"elastic", {300, 120, 700}, {1.5, 3, 0.8}, false});
    chart.bounds.push_back({"bound", 3});
    return chart;
}

// Width and height by the PNG's header (IHDR: two numbers of four bytes, highest first, from byte 16).
std::pair<unsigned, unsigned> sizeOf(const std::string& png)
{
    const auto number = [&](std::size_t at) {
        unsigned n = 0;
        for (std::size_t i = at; i < at + 4; ++i) {
            n = n << 8 | static_cast<unsigned char>(png.at(i));
        }
        return n;
    };
    return {number(16), number(20)};
}

void expectOneLine(const std::string& error, const std::filesystem::path& file, const std::string& hint)
{
    EXPECT_TRUE(error.starts_with(file.string() + ": ")) << error;
    EXPECT_NE(error.find(hint), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    EXPECT_FALSE(std::filesystem::exists(file));
}

// The environment's PATH is another one for a while.
class Path {
public:
    explicit Path(const std::string& folder) : before_(std::getenv("PATH")) { setenv("PATH", folder.c_str(), 1); }
    ~Path() { setenv("PATH", before_.c_str(), 1); }
    Path(const Path&) = delete;
    Path& operator=(const Path&) = delete;

private:
    std::string before_;
};

TEST(ChartPng, EachSeriesEachBoundAndTheNoteAreInThePicture)
{
    const Folder folder;
    std::vector<std::string> pictures;
    Chart chart = sample();
    for (int i = 0; i < 4; ++i) {
        writeChartPng(chart, folder / "a.png");
        pictures.push_back(base::contentOf(folder / "a.png").value());
        EXPECT_TRUE(pictures.back().starts_with("\x89PNG\r\n\x1a\n"));
        const auto [width, height] = sizeOf(pictures.back());
        EXPECT_GT(width, 1100U);
        EXPECT_GT(height, 720U);
        for (int j = 0; j < i; ++j) {
            EXPECT_NE(pictures[static_cast<std::size_t>(j)], pictures.back()) << i;
        }
        if (i == 0) {
            chart.series.pop_back();
        } else if (i == 1) {
            chart.bounds.clear();
        } else {
            chart.note.clear();
        }
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "a.png.part"));
}

TEST(ChartPng, WordsBesidePointsAndLinesWithoutMarkersAreDrawn)
{
    const Folder folder;
    Chart chart = sample();
    writeChartPng(chart, folder / "plain.png");
    chart.series[0].written = {"fast", "", "fine"};
    writeChartPng(chart, folder / "words.png");
    EXPECT_NE(base::contentOf(folder / "words.png").value(), base::contentOf(folder / "plain.png").value());
    chart.series[0].written = {"", "", ""};
    chart.series[0].markers = false;
    writeChartPng(chart, folder / "line.png");
    EXPECT_NE(base::contentOf(folder / "line.png").value(), base::contentOf(folder / "plain.png").value());
}

// Nothing of a text is run: neither by gnuplot nor by a shell. The same chart draws the same bytes.
TEST(ChartPng, AnyTextIsOnlyText)
{
    const Folder folder;
    const std::string mark = folder / "ran";
    const std::string hostile = "a_b^{c} 'q' \"d\" `touch " + mark + "` $(touch " + mark + ")\nsystem('touch " + mark +
                                "')\r\nEND\n'; system('touch " + mark + "') #\\";
    Chart chart = sample();
    chart.title = chart.xLabel = chart.yLabel = chart.note = chart.bounds[0].name = hostile;
    chart.series[0].name = hostile;
    chart.series[0].written = {hostile.substr(0, 8), hostile.substr(8), "\nEND\nset output"};
    chart.series[1].name = "not UTF-8: \xff\xfe\x80, " + std::string(5000, 'w');
    for (const char* name : {"it's $HOME 'a'.png", "b.png"}) {
        writeChartPng(chart, folder / name);
    }
    EXPECT_FALSE(std::filesystem::exists(mark));
    EXPECT_EQ(base::contentOf(folder / "it's $HOME 'a'.png").value(), base::contentOf(folder / "b.png").value());
    EXPECT_LT(sizeOf(base::contentOf(folder / "b.png").value()).first, 3000U);
}

TEST(ChartPng, ManyNamesHaveRoomInMoreColumns)
{
    const Folder folder;
    Chart chart = sample();
    std::vector<unsigned> widths;
    for (const std::size_t count : {10U, 20U, 40U}) {
        chart.series.resize(count, {"elastic", {300}, {1.5}});
        writeChartPng(chart, folder / "a.png");
        widths.push_back(sizeOf(base::contentOf(folder / "a.png").value()).first);
    }
    EXPECT_EQ(widths[1], widths[0]);
    EXPECT_EQ(widths[2] - widths[1], widths[1] - 1254) << "the legend is twice as wide; the rest is 1254 pixels";
}

// 0.5 is not 0u, which it would be if the number of the full stop (056, octal) took the digit after it.
TEST(ChartPng, DigitsAfterSignsStay)
{
    const Folder folder;
    Chart chart = sample();
    chart.note = "0.5";
    writeChartPng(chart, folder / "a.png");
    chart.note = "0u";
    writeChartPng(chart, folder / "b.png");
    EXPECT_NE(base::contentOf(folder / "a.png").value(), base::contentOf(folder / "b.png").value());
}

TEST(ChartPng, SaysWhatToInstallWhenGnuplotIsMissingOrFails)
{
    const Folder folder;
    const std::filesystem::path file = folder / "a.png";
    const Path path(folder.path());
    expectOneLine(errorOf([&] { writeChartPng(sample(), file); }), file, "gnuplot-nox");
    std::ofstream(folder / "gnuplot") << "#!/bin/sh\necho 'line 3: no fonts' >&2\nexit 3\n";
    std::filesystem::permissions(folder / "gnuplot", std::filesystem::perms::owner_all);
    const std::string error = errorOf([&] { writeChartPng(sample(), file); });
    expectOneLine(error, file, "exit status 3: line 3: no fonts");
    EXPECT_NE(error.find("gnuplot-nox"), std::string::npos);
}

// A file may not grow over 8 kB, as if the disk were full.
TEST(Chart, LeavesNoHalfAFileOnAFullDisk)
{
    const Folder folder;
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const rlimit little{8192, before.rlim_max};
    const auto handler = signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &little);
    const std::string png = errorOf([&] { writeChartPng(sample(), folder / "a.png"); });
    const std::vector<Chart> charts{sample()};
    const std::string html = errorOf([&] { writeChartHtml(charts, "t", folder / "a.html"); });
    setrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, handler);
    expectOneLine(png, folder / "a.png", "room");
    expectOneLine(html, folder / "a.html", "space");
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Chart, WithoutAValueIsRefused)
{
    const Folder folder;
    Chart none = sample(), logarithmic = sample();
    none.series.clear();
    logarithmic.series = {{"s", {1, -1, infinity}, {0, 1, 1}}};
    for (const Chart& chart : {none, logarithmic}) {
        const std::vector<Chart> charts{chart};
        expectOneLine(errorOf([&] { writeChartPng(chart, folder / "a.png"); }), folder / "a.png", "no value to draw");
        expectOneLine(errorOf([&] { writeChartHtml(charts, "t", folder / "a.html"); }), folder / "a.html", "no value");
    }
    expectOneLine(errorOf([&] { writeChartHtml({}, "t", folder / "b.html"); }), folder / "b.html", "no chart");
}

TEST(Chart, ValuesThatAnAxisCannotShowAreCountedInTheNote)
{
    Chart chart = sample();
    chart.series[0] = {"s", {1, 2, 3, -4, 0, 6}, {1, NAN, infinity, 1, 1, 6}};
    chart.bounds.push_back({"zero", 0});
    const DrawableChart drawn = drawableChart(chart, "f");
    EXPECT_EQ(drawn.chart.note, "One push. 5 values are left out: not finite, or not positive on a logarithmic axis.");
    EXPECT_EQ(drawn.chart.bounds.size(), 1U);
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_EQ(std::isfinite(drawn.chart.series[0].x[i]), i == 0 || i == 5);
        EXPECT_EQ(std::isfinite(drawn.chart.series[0].y[i]), i == 0 || i == 5);
    }
    chart.logX = chart.logY = false;
    EXPECT_EQ(drawableChart(chart, "f").chart.note, "One push. 2 values are left out: not finite.");
}

// Each value and bound lies within the axis, on which at least two labels stand: of any magnitude, also a single value.
TEST(Chart, AxesHoldTheValues)
{
    for (const double size : {1e-300, 1e-9, 1e-3, 1.0, 37.0, 9.99e6, 1e300}) {
        for (const double ratio : {1.0, 1.01, 4.0, 3e2, 1e5}) {
            for (const bool log : {false, true}) {
                SCOPED_TRACE(std::to_string(size) + " " + std::to_string(ratio) + (log ? " log" : ""));
                Chart chart{"t", "x", "y", log, log, {{"s", {size, size * ratio}, {size, size}}}, {{"b", size * ratio}},
                            ""};
                const DrawableChart drawn = drawableChart(chart, "f");
                for (const AxisRange& r : {drawn.x, drawn.y}) {
                    EXPECT_TRUE(r.low < size && size * ratio < r.high) << r.low << " " << r.high;
                    EXPECT_TRUE(!log || r.low > 0);
                    const auto ticks = log ? logTicks(r) : std::vector<AxisTick>{};
                    const auto labels = std::ranges::count_if(ticks, [](const AxisTick& t) { return !t.label.empty(); });
                    EXPECT_TRUE(!log || (labels >= 2 && labels <= 9)) << labels;
                }
            }
        }
    }
}

// One file: the data as JSON that no text can leave, and nothing that is loaded from elsewhere.
TEST(ChartHtml, HoldsTheDataAndNeedsNoNetwork)
{
    const Folder folder;
    std::vector<Chart> charts{sample(), sample()};
    charts[0].series[0].name = "</script><script>alert(1)</script> \xff";
    charts[0].series[1].y[1] = 0;
    charts[0].series[1].label = {"fast", "default", "fine"};
    charts[1].title = charts[1].note = "<b>bold</b>";
    charts[1].logX = false;
    writeChartHtml(charts, "A & B <i>", folder / "a.html");
    const std::string html = base::contentOf(folder / "a.html").value();
    const std::size_t begin = html.find("id=\"data\">") + 10;
    const auto data = nlohmann::json::parse(html.substr(begin, html.find("</script>", begin) - begin)).at("charts");
    ASSERT_EQ(data.size(), 2U);
    const auto& first = data.at("chart0");
    EXPECT_EQ(first["series"][0]["x"].get<std::vector<double>>(), charts[0].series[0].x);
    EXPECT_EQ(first["series"][0]["y"].get<std::vector<double>>(), charts[0].series[0].y);
    EXPECT_TRUE(first["series"][1]["y"][1].is_null());
    EXPECT_EQ(first["series"][1]["points"][2], "fine");
    EXPECT_EQ(first["series"][1]["markers"], true);
    EXPECT_TRUE(first["series"][0]["points"].empty());
    EXPECT_EQ(first["lines"][0]["at"], 3);
    EXPECT_EQ(first["x"]["log"], true);
    EXPECT_EQ(data.at("chart1")["x"]["log"], false);
    EXPECT_NE(html.find("1 value is left out"), std::string::npos);
    EXPECT_NE(html.find("id=\"chart1\""), std::string::npos);
    EXPECT_NE(html.find("<title>A &amp; B &lt;i&gt;</title>"), std::string::npos);
    EXPECT_NE(html.find("function scatter("), std::string::npos);
    for (const std::string outside : {"src=", "href=", "@import", "url(", "<link", "<b>bold", "alert(1)</script>"}) {
        EXPECT_EQ(html.find(outside), std::string::npos) << outside;
    }
}

// However points lie beside each other, no text covers another.
TEST(Labels, OfNeighboursDoNotCoverEachOther)
{
    const glm::dvec2 size(150, 17);
    for (const glm::dvec2 step : {glm::dvec2(0, 0), glm::dvec2(40, 2), glm::dvec2(60, -3), glm::dvec2(3, 12)}) {
        std::vector<PointLabel> labels;
        std::vector<glm::dvec2> markers;
        for (int i = 0; i < 4; ++i) {
            labels.push_back({glm::dvec2(300, 300) + double(i) * step, size});
            markers.push_back(labels.back().point);
        }
        const auto places = placedLabels(labels, markers);
        ASSERT_EQ(places.size(), labels.size());
        for (std::size_t i = 0; i < labels.size(); ++i) {
            for (std::size_t k = 0; k < i; ++k) {
                const glm::dvec2 apart = glm::abs(labels[i].point + places[i] - labels[k].point - places[k]);
                EXPECT_TRUE(apart.x >= size.x || apart.y >= size.y) << step.x << " " << i << " " << k;
            }
        }
    }
}

TEST(Labels, WithRoomAllAroundStandsAboveAndToTheRight)
{
    const PointLabel label{{500, 500}, {80, 17}};
    const auto place = placedLabels(std::span(&label, 1), std::span(&label.point, 1)).front();
    EXPECT_GT(place.x, 0.0);
    EXPECT_GT(place.y, 0.0);
}

}  // namespace
}  // namespace palpate::report
