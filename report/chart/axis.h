#pragma once

#include <report/chart/chart.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::report {

/// What an axis shows, in the units of its values: low < high, and both positive on a logarithmic axis.
struct AxisRange {
    double low = 0, high = 1;
};

/// A mark on an axis; a small one has no label.
struct AxisTick {
    double at = 0;
    std::string label;
};

/// Whether an axis can show a value.
bool drawable(double value, bool log) noexcept;

/// A chart as it can be drawn: the same series, with both coordinates NaN where either cannot be shown.
struct DrawableChart {
    Chart chart;  // only bounds that can be shown; the note says what was left out
    AxisRange x, y;
};

/// Throws std::runtime_error, with `file` in its text, when no point is left.
DrawableChart drawableChart(Chart chart, const std::filesystem::path& file);

/// Marks of a logarithmic axis: at 1, 2 and 5 of each decade where the range is short, at powers of ten otherwise.
std::vector<AxisTick> logTicks(AxisRange range);

}  // namespace palpate::report
