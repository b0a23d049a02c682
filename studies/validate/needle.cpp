#include <studies/validate/experiment.h>

#include <base/error.h>
#include <base/mapped.h>
#include <studies/validate/measurements.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace palpate::studies {

namespace {

constexpr double strokeTravel = 85.3e-3;  // of the stage [m]
constexpr double longestTravel = 1.0;     // travel in a file [m]
constexpr int insertions = 10;            // of ours, at as many places
constexpr double placesApart = 12e-3;     // [m]
const char* const needleSource =
    "de Jong, Dankelman, van den Dobbelsteen 2017, doi 10.1016/j.dib.2017.01.018: 20 insertions into one ex-vivo human "
    "liver, trocar tip, 5 mm/s in and out, held 61 s";
const char* const split = "curves with even numbers";

struct Curve {
    std::vector<double> in, out;          // mean per bin of strokeStep of travel, sizes [N]
    std::vector<double> fineIn, fineMax;  // of the way in, bins of 0.5 mm [N]
    std::vector<double> fineMin;
};

std::map<int, Curve> curvesIn(const std::filesystem::path& file)
{
    const Measurements table(file);
    constexpr double millimetre = 1e-3;
    std::map<int, Curve> curves;
    std::map<std::pair<int, bool>, std::map<std::size_t, std::pair<double, int>>> bins;
    for (std::size_t row = 0; row < table.rows(); ++row) {
        const int curve = static_cast<int>(table.number(row, "curve"));
        const bool in = table.text(row, "phase") == "ins";
        const double force = table.number(row, "F_mean_N");
        const double x = millimetre * table.number(row, "x_mm");
        base::failIf(x < 0.0 || x > longestTravel, "{}: curve {}: x_mm = {:g}: must be 0 to {:g}", file.native(), curve,
                     1e3 * x, 1e3 * longestTravel);
        const auto bin = static_cast<std::size_t>(x / strokeStep);
        auto& [sum, count] = bins[{curve, in}][bin];
        sum += in ? force : -force;
        ++count;
        if (in) {
            curves[curve].fineIn.push_back(force);
            curves[curve].fineMax.push_back(table.number(row, "F_max_N"));
            curves[curve].fineMin.push_back(table.number(row, "F_min_N"));
        }
    }
    for (const auto& [key, all] : bins) {
        auto& to = key.second ? curves[key.first].in : curves[key.first].out;
        for (const auto& [bin, sum] : all) {
            to.resize(bin + 1, NAN);
            to[bin] = sum.first / sum.second;
        }
    }
    return curves;
}

// Tip force: what the way in has over the way out [N].
std::vector<double> tipForce(const Curve& curve)
{
    std::vector<double> tip(std::min(curve.in.size(), curve.out.size()));
    for (std::size_t i = 0; i < tip.size(); ++i) {
        tip[i] = curve.in[i] - curve.out[i];
    }
    return tip;
}

double meanFrom(const std::vector<double>& values, std::size_t first)
{
    double sum = 0.0;
    std::size_t count = 0;
    for (std::size_t i = first; i < values.size(); ++i) {
        if (std::isfinite(values[i])) {
            sum += values[i];
            ++count;
        }
    }
    return count > 0 ? sum / static_cast<double>(count) : NAN;
}

// The bin where the tip begins to cut: over 0.06 N there and on average over the next 10 mm.
std::size_t onsetOf(const std::vector<double>& tip)
{
    constexpr double least = 0.06;
    constexpr std::size_t next = 5;
    for (std::size_t i = 0; i + next < tip.size(); ++i) {
        const std::vector<double> ahead(tip.begin() + static_cast<std::ptrdiff_t>(i),
                                        tip.begin() + static_cast<std::ptrdiff_t>(i + next));
        if (tip[i] > least && meanFrom(ahead, 0) > least) {
            return i;
        }
    }
    return tip.size();
}

// What is fitted: where the tissue begins in the stage's travel, the tip's force, friction of guide and shaft.
struct Fit {
    std::size_t surface = 0;         // bin
    double tip = 0;                  // [N]
    std::vector<double> friction;    // of guide and shaft, mean of the way out per bin [N]
    double guide = 0, perMetre = 0;  // the same as a line: of the guide [N], and growing with travel [N/m]
    double falls = 0, fallSize = 0;  // ruptures per insertion [-], and their mean [N]
};

Fit fitted(const std::vector<Curve>& curves)
{
    Fit fit;
    auto onsets = base::mapped<double>(curves, [&](const Curve& c) { return static_cast<double>(onsetOf(tipForce(c))); });
    std::ranges::sort(onsets);
    fit.surface = static_cast<std::size_t>(onsets[onsets.size() / 2]);
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    std::vector<double> counts;
    std::vector<double> falls;
    for (const Curve& c : curves) {
        const std::vector<double> ofCurve = rupturesIn(c.fineMax, c.fineMin);
        falls.insert(falls.end(), ofCurve.begin(), ofCurve.end());
        fit.tip += meanFrom(tipForce(c), fit.surface) / static_cast<double>(curves.size());
        for (std::size_t i = 0; i < c.out.size(); ++i) {
            if (std::isfinite(c.out[i])) {
                const double at = (static_cast<double>(i) + 0.5) * strokeStep;
                n += 1.0;
                x += at;
                y += c.out[i];
                xx += at * at;
                xy += at * c.out[i];
                fit.friction.resize(std::max(fit.friction.size(), i + 1));
                counts.resize(fit.friction.size());
                fit.friction[i] += c.out[i];
                counts[i] += 1.0;
            }
        }
    }
    fit.falls = static_cast<double>(falls.size()) / static_cast<double>(curves.size());
    fit.fallSize = falls.empty() ? minRupture : meanFrom(falls, 0);
    for (std::size_t i = 0; i < counts.size(); ++i) {
        fit.friction[i] /= counts[i];
    }
    fit.perMetre = (n * xy - x * y) / (n * xx - x * x);
    fit.guide = (y - fit.perMetre * x) / n;
    return fit;
}

struct Corridor {
    std::vector<double> low, high, mean;
};

// 5 and 95 % of the curves in each bin. Throws std::runtime_error for a bin that no curve reaches.
Corridor corridorOf(const std::vector<std::vector<double>>& curves, const std::filesystem::path& file)
{
    Corridor c;
    for (std::size_t bin = 0; bin < curves.front().size(); ++bin) {
        std::vector<double> here;
        for (const auto& curve : curves) {
            if (bin < curve.size() && std::isfinite(curve[bin])) {
                here.push_back(curve[bin]);
            }
        }
        base::failIf(here.empty(), "{}: no curve with an odd number has a force at {:g} to {:g} mm of travel",
                     file.native(), 1e3 * strokeStep * static_cast<double>(bin),
                     1e3 * strokeStep * static_cast<double>(bin + 1));
        std::ranges::sort(here);
        const auto at = [&](double fraction) {
            const double place = fraction * static_cast<double>(here.size() - 1);
            const auto low = static_cast<std::size_t>(place);
            const std::size_t high = std::min(low + 1, here.size() - 1);
            return here[low] + (place - static_cast<double>(low)) * (here[high] - here[low]);
        };
        c.low.push_back(at(0.05));
        c.high.push_back(at(0.95));
        c.mean.push_back(meanFrom(here, 0));
    }
    return c;
}

// What a needle that nothing held at its tip would have, and the bins that count: those in tissue.
struct TiplessNeedle {
    std::vector<double> force;  // [N]
    std::size_t surface = 0;    // first bin
};

// Share of the predicted bins that lie outside the corridor of the measured ones [%]. No number lies outside.
double shareOutside(const std::vector<double>& predicted, const Corridor& corridor, std::size_t from, std::size_t bins)
{
    std::size_t outside = 0;
    for (std::size_t i = from; i < bins; ++i) {
        outside += predicted[i] >= corridor.low[i] && predicted[i] <= corridor.high[i] ? 0 : 1;
    }
    return bins > from ? 1e2 * static_cast<double>(outside) / static_cast<double>(bins - from) : NAN;
}

Experiment corridorExperiment(const char* name, const char* what, const std::vector<double>& predicted,
                              const TiplessNeedle& tipless, const Corridor& corridor)
{
    Experiment e;
    e.name = name;
    e.quantity = fmt::format(
        "{}: share of predicted bins of 2 mm in tissue outside the 5 to 95 % corridor of the held-back curves", what);
    e.source = needleSource;
    e.fittedOn = split;
    e.predicted = fmt::format("{} of the curves with odd numbers", what);
    e.bound = 20.0;
    const std::size_t bins = std::min(predicted.size(), corridor.low.size()), from = std::min(tipless.surface, bins);
    const double inTissue = static_cast<double>(bins - from);
    ValidateCurve ours{"predicted", {}, {}, true}, low{"5 %, held back", {}, {}, true},
        high{"95 %, held back", {}, {}, true}, mean{"mean, held back", {}, {}, true};
    double meanSpread = 0.0, meanOff = 0.0, level = 0.0;
    for (std::size_t i = 0; i < bins; ++i) {
        if (i >= from) {
            const double off = predicted[i] - corridor.mean[i];
            meanOff += off / inTissue;
            level += corridor.mean[i] / inTissue;
            meanSpread += 0.5 * (corridor.high[i] - corridor.low[i]) / inTissue;
            e.worst = largerError(e.worst, std::abs(off));
        }
        for (auto [curve, value] : {std::pair(&ours, predicted[i]), std::pair(&low, corridor.low[i]),
                                    std::pair(&high, corridor.high[i]), std::pair(&mean, corridor.mean[i])}) {
            curve->add(1e3 * (static_cast<double>(i) + 0.5) * strokeStep, value);
        }
    }
    e.error = shareOutside(predicted, corridor, from, bins);
    const double withoutTip = shareOutside(tipless.force, corridor, from, bins);
    e.worst *= 1e2 / level;
    e.scatter = 1e2 * meanSpread / level;
    e.parameters = {{"mean_difference_n", meanOff},
                    {"mean_measured_n", level},
                    {"half_corridor_n", meanSpread},
                    {"without_tip_force_pct", withoutTip}};
    e.note = fmt::format(
        "mean {:+.2f} N of {:.2f} N; predicted is the mean of {} insertions; without any force at the tip {:.0f} % would "
        "be "
        "outside",
        meanOff, level, insertions, withoutTip);
    e.picture = {
        fmt::format("Needle into human liver: {}", what), "travel of the stage [mm]", "force [N]", {ours, low, high, mean}};
    e.judge();
    return e;
}

struct Moments {
    double mean = 0, spread = 0;
};

Moments momentsOf(const std::vector<double>& values)
{
    double squares = 0.0;
    const double mean = meanFrom(values, 0);
    for (const double v : values) {
        squares += (v - mean) * (v - mean) / static_cast<double>(values.size());
    }
    return {mean, std::sqrt(squares)};
}

Experiment ruptureExperiment(const std::vector<NeedleStroke>& ours, const std::vector<Curve>& measured,
                             const LiverLaw& liver)
{
    Experiment e;
    e.name = "needle-ruptures";
    e.quantity = "ruptures of over 0.15 N per insertion, difference of the means";
    e.source = needleSource;
    e.fittedOn = "curves with even numbers: distance and mean force of inner walls";
    e.predicted = fmt::format("ruptures of the curves with odd numbers: mean of {} insertions", insertions);
    ValidateCurve points{"measured, held-back curves", {}, {}, false}, line{"predicted, insertions of ours", {}, {}, false};
    std::vector<double> theirCounts, ourCounts;
    for (const Curve& c : measured) {
        theirCounts.push_back(static_cast<double>(rupturesIn(c.fineMax, c.fineMin).size()));
        points.x.push_back(static_cast<double>(theirCounts.size()));
    }
    for (const NeedleStroke& stroke : ours) {
        ourCounts.push_back(static_cast<double>(stroke.falls));
        line.x.push_back(static_cast<double>(ourCounts.size()));
    }
    points.y = theirCounts;
    line.y = ourCounts;
    const Moments theirs = momentsOf(theirCounts), predicted = momentsOf(ourCounts);
    e.error = e.worst = 1e2 * std::abs(predicted.mean - theirs.mean) / theirs.mean;
    e.scatter = e.bound = 1e2 * theirs.spread / theirs.mean;
    e.parameters = {{"measured", theirs.mean},
                    {"measured_spread", theirs.spread},
                    {"predicted", predicted.mean},
                    {"predicted_spread", predicted.spread},
                    {"wall_spacing_mm", 1e3 * liver.wallSpacing},
                    {"wall_n", liver.wallForce}};
    e.note = fmt::format(
        "measured {:.1f} +- {:.1f}, predicted {:.1f} +- {:.1f}: walls every {:.1f} mm that hold {:.2f} N more on average",
        theirs.mean, theirs.spread, predicted.mean, predicted.spread, 1e3 * liver.wallSpacing, liver.wallForce);
    e.picture = {"Ruptures per insertion", "insertion", "ruptures over 0.15 N", {points, line}};
    e.judge();
    return e;
}

// Mean over curves of the held force over that at the start, by seconds.
std::map<double, std::vector<double>> holdRatios(const std::filesystem::path& file, bool even)
{
    const Measurements table(file);
    std::map<double, std::vector<double>> ratios;
    std::map<int, double> starts;  // by curve [N]
    for (std::size_t row = 0; row < table.rows(); ++row) {
        const int curve = static_cast<int>(table.number(row, "curve"));
        const double seconds = table.number(row, "t_hold_s");
        const double force = table.number(row, "F_N");
        if (seconds == 0.0) {
            starts[curve] = force;
        }
        base::failIf(!starts.contains(curve) || starts[curve] <= 0.0,
                     "{}: curve {} must begin with a force above 0 at t_hold_s = 0", file.native(), curve);
        if ((curve % 2 == 0) == even) {
            ratios[seconds].push_back(force / starts[curve]);
        }
    }
    return ratios;
}

// Mean of the curves.
volume::Relaxation heldRelaxation(const std::filesystem::path& file)
{
    std::vector<double> seconds, means;
    for (const auto& [at, ratios] : holdRatios(file, true)) {
        seconds.push_back(at);
        means.push_back(meanFrom(ratios, 0));
    }
    return fittedRelaxation(seconds, means);
}

Experiment holdExperiment(const NeedleStroke& ours, const volume::Relaxation& fit, const std::vector<double>& heldAt,
                          const std::filesystem::path& file)
{
    Experiment e;
    e.name = "needle-hold";
    e.quantity = "held force over that at the start, largest difference at 1 and 10 s";
    e.source = needleSource;
    e.fittedOn = "curves with even numbers: weights of the tissue's Prony series";
    e.predicted = "held force of the curves with odd numbers, 0.1 to 50 s";
    e.bound = 10.0;
    const auto measured = holdRatios(file, false);
    ValidateCurve mean{"measured, mean of held-back curves", {}, {}, false}, line{"predicted", {}, {}, true};
    double spread = 0.0;
    for (std::size_t i = 0; i < heldAt.size(); ++i) {
        const auto found = measured.find(heldAt[i]);
        base::failIf(found == measured.end(), "{}: has no force {} s after the stop", file.native(), heldAt[i]);
        const double wanted = meanFrom(found->second, 0);
        const double off = ours.held[i] / ours.held.front() - wanted;
        if (heldAt[i] == 1.0 || heldAt[i] == 10.0) {
            e.error = largerError(e.error, 1e2 * std::abs(off));
        }
        const auto apart = base::mapped<double>(found->second, [&](const double r) { return 1e2 * (r - wanted); });
        spread = largerError(spread, summaryOf(apart).rms);
        e.worst = largerError(e.worst, 1e2 * std::abs(off));
        mean.add(heldAt[i], wanted);
        line.add(heldAt[i], ours.held[i] / ours.held.front());
    }
    e.scatter = spread;
    e.parameters = {{"relaxing_fast", fit.weights[0]}, {"relaxing_slow", fit.weights[1]}};
    e.note = fmt::format(
        "series {:.2f} + {:.2f} exp(-t / {:g} s) + {:.2f} exp(-t / {:g} s); friction in the guide and "
        "tissue relax together in the curves",
        1.0 - fit.weights[0] - fit.weights[1], fit.weights[0], volume::relaxationTimes[0], fit.weights[1],
        volume::relaxationTimes[1]);
    e.picture = {"Held needle", "time after the stop [s]", "held force over that at the start [-]", {mean, line}};
    e.judge();
    return e;
}

// Insertions at places that are `placesApart` from each other; the first of them is held.
std::vector<NeedleStroke> strokesIn(const LiverLaw& liver, double depth, const std::vector<double>& heldAt)
{
    std::vector<NeedleStroke> strokes;
    for (int i = 0; i < insertions; ++i) {
        const glm::dvec2 aside = placesApart * glm::dvec2(i % 4 - 1.5, i / 4 - 1);
        strokes.push_back(needleStroke(liver, aside, depth, i == 0 ? heldAt : std::vector<double>{}));
    }
    return strokes;
}

// Mean over the insertions of what the way in has over the way out, per bin [N].
std::vector<double> meanTipForce(const std::vector<NeedleStroke>& strokes)
{
    std::vector<double> mean(std::min(strokes.front().in.size(), strokes.front().out.size()), 0.0);
    for (const NeedleStroke& stroke : strokes) {
        for (std::size_t i = 0; i < mean.size(); ++i) {
            mean[i] += (stroke.in[i] - stroke.out[i]) / static_cast<double>(strokes.size());
        }
    }
    return mean;
}

}  // namespace

volume::Relaxation fittedRelaxation(const std::vector<double>& seconds, const std::vector<double>& ratios)
{
    double aa = 0, ab = 0, bb = 0, ay = 0, by = 0;
    for (std::size_t i = 0; i < seconds.size(); ++i) {
        const double a = -std::expm1(-seconds[i] / volume::relaxationTimes[0]);
        const double b = -std::expm1(-seconds[i] / volume::relaxationTimes[1]);
        const double y = 1.0 - ratios[i];
        aa += a * a;
        ab += a * b;
        bb += b * b;
        ay += a * y;
        by += b * y;
    }
    const double determinant = aa * bb - ab * ab;
    const double fast = (ay * bb - by * ab) / determinant, slow = (by * aa - ay * ab) / determinant;
    if (fast < 0.0) {
        return {{0.0, std::max(by / bb, 0.0)}};
    }
    return slow < 0.0 ? volume::Relaxation{{std::max(ay / aa, 0.0), 0.0}} : volume::Relaxation{{fast, slow}};
}

std::vector<Experiment> needleInLiver(const std::filesystem::path& curves, const std::filesystem::path& hold,
                                      const ValidateProgress& progress)
{
    std::vector<Curve> fitCurves, heldBack;
    for (auto& [number, curve] : curvesIn(curves)) {
        (number % 2 == 0 ? fitCurves : heldBack).push_back(std::move(curve));
    }
    base::failIf(fitCurves.size() < 3 || heldBack.size() < 3,
                 "{}: needs three curves with even numbers and three with odd ones", curves.native());
    const Fit fit = fitted(fitCurves);
    std::vector<std::vector<double>> measuredTip, measuredIn;
    for (const Curve& c : heldBack) {
        measuredTip.push_back(tipForce(c));
        measuredIn.push_back(c.in);
    }
    const Corridor tipCorridor = corridorOf(measuredTip, curves), inCorridor = corridorOf(measuredIn, curves);
    progress("needle");
    const std::vector<double> heldAt{0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0};
    const double surface = static_cast<double>(fit.surface) * strokeStep;
    LiverLaw liver = fittedWalls(fit.falls, fit.fallSize, strokeTravel - surface);
    liver.relaxation = heldRelaxation(hold);
    liver.cutting = fit.tip;
    // Walls hold the tip back as well: without their part the cutting force is less than the mean of the curves.
    const double withWalls = meanFrom(meanTipForce(strokesIn(liver, strokeTravel - surface, {})), 0);
    liver.cutting = std::max(fit.tip - (withWalls - fit.tip), 0.1 * fit.tip);
    const std::vector<NeedleStroke> ours = strokesIn(liver, strokeTravel - surface, heldAt);
    const std::vector<double> ourTip = meanTipForce(ours);
    std::vector<double> tip, insertion;
    for (std::size_t i = 0; static_cast<double>(i + 1) * strokeStep < strokeTravel; ++i) {
        const bool cuts = i >= fit.surface && i - fit.surface < ourTip.size();
        tip.push_back(cuts ? ourTip[i - fit.surface] : 0.0);
        if (i < fit.friction.size()) {  // beyond, nothing is predicted
            insertion.push_back(fit.friction[i] + tip.back());
        }
    }
    const std::vector<double> none(tip.size(), 0.0);
    std::vector<Experiment> out{
        corridorExperiment("needle-tip", "tip force", tip, {none, fit.surface}, tipCorridor),
        corridorExperiment("needle-insertion", "force on the way in", insertion, {fit.friction, fit.surface}, inCorridor),
        ruptureExperiment(ours, heldBack, liver), holdExperiment(ours.front(), liver.relaxation, heldAt, hold)};
    out[0].fittedOn = "curves with even numbers: cutting force, inner walls, and where the tissue begins";
    out[1].fittedOn =
        "curves with even numbers: the same, and the friction of guide and shaft: mean of the way out, bin by bin";
    out[0].parameters.insert(out[0].parameters.end(), {{"cutting_n", liver.cutting}, {"surface_mm", 1e3 * surface}});
    out[1].parameters.insert(out[1].parameters.end(),
                             {{"guide_friction_n", fit.guide}, {"friction_n_per_m", fit.perMetre}});
    return out;
}

}  // namespace palpate::studies
