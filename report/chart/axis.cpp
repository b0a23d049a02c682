#include <report/chart/axis.h>

#include <base/error.h>
#include <base/round_step.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <string_view>

namespace palpate::report {

namespace {

constexpr double noTick = std::numeric_limits<double>::quiet_NaN();

// Room beside the outermost values, so that no marker is cut.
constexpr double linearRoom = 0.05;  // of what the values span
constexpr double logRoom = 1.12;     // a factor

AxisRange rangeOf(const std::vector<double>& values, bool log)
{
    const auto [least, largest] = std::ranges::minmax(values);
    if (log) {
        // At the ends of the doubles a step further is none: zero or infinity.
        const double low = base::roundStep(least / logRoom, false), high = base::roundStep(largest * logRoom, true);
        return {low > 0 ? low : least, std::isfinite(high) ? high : largest};
    }
    const double span = largest - least;
    const double size = std::max(std::abs(least), std::abs(largest));
    const double room = span > 1e-12 * size ? linearRoom * span : size > 0 ? 0.1 * size : 1;
    // Values that come near zero are read against zero.
    const bool fromZero = least >= 0 && least < 0.5 * largest;
    return {fromZero ? 0 : least - room, largest + room};
}

std::string superscript(int power)
{
    constexpr std::array<std::string_view, 10> digits{"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    std::string out;
    for (const char c : std::to_string(power)) {
        out += c == '-' ? "⁻" : digits[static_cast<std::size_t>(c - '0')];
    }
    return out;
}

std::string logLabel(int step, int power)
{
    if (power >= -3 && power <= 4) {
        return fmt::format("{:g}", step * std::pow(10, power));
    }
    return (step == 1 ? "" : fmt::format("{}·", step)) + "10" + superscript(power);
}

// Both coordinates of what cannot be shown become NaN. Returns how many points that were.
std::size_t blank(ChartSeries& series, bool logX, bool logY)
{
    assert(series.x.size() == series.y.size());
    std::size_t count = 0;
    for (std::size_t i = 0; i < series.x.size(); ++i) {
        if (!drawable(series.x[i], logX) || !drawable(series.y[i], logY)) {
            series.x[i] = series.y[i] = noTick;
            ++count;
        }
    }
    return count;
}

std::string leftOut(std::size_t count, bool log)
{
    return fmt::format("{} {} left out: not finite{}.", count, count == 1 ? "value is" : "values are",
                       log ? ", or not positive on a logarithmic axis" : "");
}

}  // namespace

bool drawable(double value, bool log) noexcept
{
    return std::isfinite(value) && (!log || value > 0);
}

DrawableChart drawableChart(Chart chart, const std::filesystem::path& file)
{
    std::size_t out = 0;
    std::vector<double> x, y;
    for (ChartSeries& s : chart.series) {
        out += blank(s, chart.logX, chart.logY);
        std::ranges::copy_if(s.x, std::back_inserter(x), [](double v) { return !std::isnan(v); });
        std::ranges::copy_if(s.y, std::back_inserter(y), [](double v) { return !std::isnan(v); });
    }
    base::failIf(x.empty(), "{}: the chart has no value to draw{}", file.string(),
                 out > 0 ? ": " + leftOut(out, chart.logX || chart.logY) : "");
    out += std::erase_if(chart.bounds, [&](const ChartLine& b) { return !drawable(b.y, chart.logY); });
    std::ranges::transform(chart.bounds, std::back_inserter(y), &ChartLine::y);
    if (out > 0) {
        chart.note += (chart.note.empty() ? "" : " ") + leftOut(out, chart.logX || chart.logY);
    }
    const AxisRange rangeX = rangeOf(x, chart.logX), rangeY = rangeOf(y, chart.logY);
    return {std::move(chart), rangeX, rangeY};
}

std::vector<AxisTick> logTicks(AxisRange range)
{
    constexpr int maxLabels = 8;
    const int first = static_cast<int>(std::floor(std::log10(range.low) + 1e-9));
    const int last = static_cast<int>(std::ceil(std::log10(range.high) - 1e-9));
    const bool fine = std::log10(range.high) - std::log10(range.low) < 2.1;
    const int every = (last - first) / maxLabels + 1;
    std::vector<AxisTick> ticks;
    for (int power = first; power <= last; ++power) {
        for (int step = 1; step < 10; ++step) {
            const double at = step * std::pow(10, power);
            const bool labelled = fine ? step == 1 || step == 2 || step == 5 : step == 1 && power % every == 0;
            const bool shown = at >= range.low * (1 - 1e-9) && at <= range.high * (1 + 1e-9);
            if (shown && (labelled || every == 1 || step == 1)) {
                ticks.push_back({at, labelled ? logLabel(step, power) : ""});
            }
        }
    }
    return ticks;
}

}  // namespace palpate::report
