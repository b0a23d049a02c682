#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace palpate::report {

/// Points of one kind, under one name in the legend. `x` and `y` have the same length and any order.
struct ChartSeries {
    std::string name;
    std::vector<double> x{}, y{};
    bool line = false;                   // joined in their order; separate points otherwise
    bool markers = true;                 // false: a line alone
    std::vector<std::string> label{};    // what each point is, for who points at it; empty, or as long as x
    std::vector<std::string> written{};  // text beside each point in the PNG; empty, or as long as x

    void add(double atX, double atY)
    {
        x.push_back(atX);
        y.push_back(atY);
    }
};

/// A horizontal line, for a bound.
struct ChartLine {
    std::string name;
    double y = 0;
};

/// A chart of values against values. All text is plain and may hold any character; labels say their unit: "time [us]".
struct Chart {
    std::string title, xLabel, yLabel;
    bool logX = false, logY = false;
    std::vector<ChartSeries> series{};
    std::vector<ChartLine> bounds{};
    std::string note{};  // below the chart; may have several lines
};

/// Draws a chart for a paper: PNG, the plot 1100 x 720 pixels, its legend beside it. gnuplot is run for it (Debian's
/// gnuplot-nox).
///
/// What an axis cannot show (not finite; not positive on a logarithmic axis) is left out, a line has a gap there, and the
/// note says how many values that were.
///
/// The file appears whole or not at all; one that is there is replaced. Throws std::runtime_error when nothing can be
/// shown, gnuplot is not there or fails, or the file cannot be written.
void writeChartPng(const Chart& chart, const std::filesystem::path& file);

/// Writes charts one below the other as one HTML file that needs nothing else and no network: values under the pointer,
/// series that can be hidden, a region that can be enlarged. Leaves out the same values as writeChartPng(), and throws as
/// it does.
///
/// @param below  HTML below the charts, such as tables; with it there may be no charts
void writeChartHtml(std::span<const Chart> charts, const std::string& title, const std::filesystem::path& file,
                    const std::string& below = {});

}  // namespace palpate::report
