#include <studies/thesis/tasks_thesis.h>

#include <base/error.h>

#include <boost/math/distributions/students_t.hpp>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <string>

namespace palpate::studies {

bool LineFit::flat() const noexcept
{
    return std::abs(slope) <= studentQuantile(points - 2) * slopeError;
}

LineFit fitLine(std::span<const double> x, std::span<const double> y)
{
    assert(x.size() == y.size());
    base::failIf(x.size() < 3, "a line with errors needs three points or more");
    const auto n = static_cast<double>(x.size());
    const double meanX = std::accumulate(x.begin(), x.end(), 0.0) / n;
    const double meanY = std::accumulate(y.begin(), y.end(), 0.0) / n;
    double xx = 0.0, xy = 0.0, yy = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xx += (x[i] - meanX) * (x[i] - meanX);
        xy += (x[i] - meanX) * (y[i] - meanY);
        yy += (y[i] - meanY) * (y[i] - meanY);
    }
    base::failIf(!(xx > 0.0), "a line needs points at different places");
    LineFit fit;
    fit.points = x.size();
    fit.slope = xy / xx;
    fit.intercept = meanY - fit.slope * meanX;
    double squares = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        const double off = y[i] - fit.at(x[i]);
        squares += off * off;
    }
    fit.residual = std::sqrt(squares / (n - 2.0));
    fit.slopeError = fit.residual / std::sqrt(xx);
    fit.interceptError = fit.residual * std::sqrt(1.0 / n + meanX * meanX / xx);
    fit.rSquared = yy > 0.0 ? 1.0 - squares / yy : 1.0;
    return fit;
}

double studentQuantile(std::size_t freedom) noexcept
{
    assert(freedom > 0);
    return boost::math::quantile(boost::math::students_t(static_cast<double>(freedom)), 0.975);
}

namespace {

constexpr double none = -1.0;  // not in the table

struct Column {
    std::string_view event;
    std::array<double, thesisObjects.size()> load;  // Table 2 [0.1 ms]
    struct {
        double slope, slopeError, intercept, interceptError;
    } line;  // Table 4 [0.1 ms]
};

constexpr std::array<Column, 8> thesisColumns{
    {{"A1",
      {1.6, 1.9, 2.125, 2.4, 2.9, 3.35, 3.8, 4.25, 4.8, 5.35, 5.9, 6.55, 6.9, 7.4},
      {0.01009, 1.00431e-4, 1.34746, 0.03428}},
     {"A2",
      {1.5, 1.8, 2.025, 2.3, 2.8, 3.25, 3.7, 4.0, 4.6, 5.15, 5.65, 6.3, 6.675, 7.2},
      {0.0098, 1.20632e-4, 1.2676, 0.04118}},
     {"A3",
      {1.2, 1.4, 1.7, 1.9, 2.4, 2.85, 3.3, 3.8, 4.3, 4.75, 5.4, 6.0, 6.45, 6.9},
      {0.00999, 1.07684e-4, 0.88569, 0.03676}},
     {"A4",
      {1.05, 1.3, 1.6, 1.8, 2.3, 2.8, 3.2, 3.7, 4.2, 4.7, 5.2, 5.75, 6.25, 6.7},
      {0.0098, 5.48663e-5, 0.81092, 0.01873}},
     {"A7",
      {2.1, 2.3, 2.6, 2.9, 3.4, 3.9, 4.4, 4.8, 5.2, 5.8, 6.2, 6.9, 7.3, 7.7},
      {0.00978, 8.96409e-5, 1.86607, 0.03174}},
     {"A8", {2.0, 2.2, 2.5, 2.8, 3.3, 3.8, 4.3, 4.7, 5.1, 5.7, 6.1, 6.6, 7.1, none}, {0.0096, 8.03373e-5, 1.78949, 0.0244}},
     {"A9",
      {1.4, 1.6, 1.9, 2.1, 2.6, 3.2, 3.6, 4.1, 4.6, 5.1, 5.6, 6.0, 6.5, 6.9},
      {0.00972, 4.64103e-5, 1.15241, 0.01409}},
     {"A10",
      {1.3, 1.5, 1.8, 2.0, 2.5, 3.1, 3.5, 3.9, 4.5, 5.0, 5.4, 5.9, 6.3, 6.8},
      {0.00959, 6.47935e-5, 1.06219, 0.01968}}}};

ThesisSeries seriesOf(const Column& column)
{
    ThesisSeries s;
    s.event = column.event;
    for (std::size_t i = 0; i < thesisObjects.size(); ++i) {
        if (column.load[i] != none) {
            s.objects.push_back(thesisObjects[i]);
            s.seconds.push_back(column.load[i] * thesisUnit);
        }
    }
    s.line.points = s.objects.size();
    s.line.slope = column.line.slope * thesisUnit;
    s.line.slopeError = column.line.slopeError * thesisUnit;
    s.line.intercept = column.line.intercept * thesisUnit;
    s.line.interceptError = column.line.interceptError * thesisUnit;
    s.line.rSquared = std::nan("");
    s.line.residual = std::nan("");
    return s;
}

TaskLine operator-(TaskLine a, TaskLine b) noexcept
{
    return {a.slope - b.slope, a.intercept - b.intercept};
}

TaskLine operator+(TaskLine a, TaskLine b) noexcept
{
    return {a.slope + b.slope, a.intercept + b.intercept};
}

}  // namespace

const std::vector<ThesisSeries>& thesisSeries()
{
    static const auto all = [] {
        std::vector<ThesisSeries> series;
        std::ranges::transform(thesisColumns, std::back_inserter(series), seriesOf);
        return series;
    }();
    return all;
}

const ThesisSeries* thesisSeries(std::string_view event)
{
    const auto& all = thesisSeries();
    const auto found = std::ranges::find(all, event, &ThesisSeries::event);
    return found == all.end() ? nullptr : &*found;
}

TaskLine TaskModel::servo() const noexcept
{
    return position + collision + feedback;
}

TaskLine TaskModel::total() const noexcept
{
    return servo() + graphics + monitoring + additional;
}

TaskModel taskModel(std::span<const EventLine> lines)
{
    const auto of = [&](std::string_view event) {
        const auto found = std::ranges::find(lines, event, &EventLine::event);
        base::failIf(found == lines.end(), "the task-timing model needs event {}", event);
        return found->line;
    };
    TaskModel m;
    m.graphics = of("A1") - of("A2");
    m.position = of("A6");
    m.collision = of("A4") - of("A6");
    m.feedback = of("A2") - of("A4");
    m.monitoring = of("A7") - of("A9") - m.feedback;
    m.additional = of("A7") - of("A1") - m.monitoring;
    return m;
}

TaskModel thesisModel()
{
    std::vector<EventLine> lines{{"A6", {0.0, thesisA6}}};
    for (const auto& s : thesisSeries()) {
        lines.push_back({s.event, {s.line.slope, s.line.intercept}});
    }
    return taskModel(lines);
}

}  // namespace palpate::studies
