#include <studies/validate/needle.h>

#include <datasets/tables.h>
#include <studies/needle/needle_curves.h>
#include <studies/stability/method.h>
#include <studies/validate/measurements.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <stdexcept>

namespace palpate::studies {

namespace {

constexpr double speed = 5e-3;           // [m/s]
constexpr double travel = 85.3e-3;       // of the stage [m]
constexpr double minRupture = 0.15;      // [N]
constexpr double needleRadius = 0.5e-3;  // inner needle of an 18 G set [m]
const char* const source =
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
        const auto bin = static_cast<std::size_t>(millimetre * table.number(row, "x_mm") / strokeStep);
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

// Falls of `minRupture` within 1 mm, from a peak to the least force after it.
int rupturesOf(const Curve& curve)
{
    int count = 0;
    for (std::size_t i = 0; i + 2 < curve.fineMax.size(); ++i) {
        const double low = std::min(curve.fineMin[i + 1], curve.fineMin[i + 2]);
        const bool peak = i == 0 || curve.fineMax[i] >= curve.fineMax[i - 1];
        if (peak && curve.fineMax[i] >= curve.fineMax[i + 1] && curve.fineMax[i] - low >= minRupture) {
            ++count;
        }
    }
    return count;
}

// What is fitted: where the tissue begins in the stage's travel, the tip's force, friction of guide and shaft.
struct Fit {
    std::size_t surface = 0;         // bin
    double tip = 0;                  // [N]
    std::vector<double> friction;    // of guide and shaft, mean of the way out per bin [N]
    double guide = 0, perMetre = 0;  // the same as a line: of the guide [N], and growing with travel [N/m]
};

Fit fitted(const std::vector<Curve>& curves)
{
    Fit fit;
    std::vector<double> onsets;
    for (const Curve& c : curves) {
        onsets.push_back(static_cast<double>(onsetOf(tipForce(c))));
    }
    std::ranges::sort(onsets);
    fit.surface = static_cast<std::size_t>(onsets[onsets.size() / 2]);
    double n = 0, x = 0, y = 0, xx = 0, xy = 0;
    std::vector<double> counts;
    for (const Curve& c : curves) {
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

// 5 and 95 % of the curves in each bin.
Corridor corridorOf(const std::vector<std::vector<double>>& curves)
{
    Corridor c;
    for (std::size_t bin = 0; bin < curves.front().size(); ++bin) {
        std::vector<double> here;
        for (const auto& curve : curves) {
            if (bin < curve.size() && std::isfinite(curve[bin])) {
                here.push_back(curve[bin]);
            }
        }
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

// Fraction of the predicted bins that lie in the corridor of the measured ones.
Experiment corridorExperiment(const char* name, const char* what, const std::vector<double>& predicted,
                              const std::vector<std::vector<double>>& measured)
{
    Experiment e;
    e.name = name;
    e.quantity =
        fmt::format("{}: share of predicted bins of 2 mm outside the 5 to 95 % corridor of the held-back curves", what);
    e.source = source;
    e.fittedOn = split;
    e.predicted = fmt::format("{} of the curves with odd numbers", what);
    e.bound = 20.0;
    const Corridor corridor = corridorOf(measured);
    const std::size_t bins = std::min(predicted.size(), corridor.low.size());
    std::size_t outside = 0;
    ValidateCurve ours{"predicted", {}, {}, true}, low{"5 %, held back", {}, {}, true},
        high{"95 %, held back", {}, {}, true}, mean{"mean, held back", {}, {}, true};
    double meanSpread = 0.0, meanOff = 0.0, level = 0.0;
    for (std::size_t i = 0; i < bins; ++i) {
        const double off = predicted[i] - corridor.mean[i];
        outside += predicted[i] < corridor.low[i] || predicted[i] > corridor.high[i] ? 1 : 0;
        meanOff += off / static_cast<double>(bins);
        level += corridor.mean[i] / static_cast<double>(bins);
        meanSpread += 0.5 * (corridor.high[i] - corridor.low[i]) / static_cast<double>(bins);
        e.worst = std::max(e.worst, std::abs(off));
        for (auto [curve, value] : {std::pair(&ours, predicted[i]), std::pair(&low, corridor.low[i]),
                                    std::pair(&high, corridor.high[i]), std::pair(&mean, corridor.mean[i])}) {
            curve->x.push_back(1e3 * (static_cast<double>(i) + 0.5) * strokeStep);
            curve->y.push_back(value);
        }
    }
    e.error = bins > 0 ? 1e2 * static_cast<double>(outside) / static_cast<double>(bins) : NAN;
    e.worst *= 1e2 / level;
    e.scatter = 1e2 * meanSpread / level;
    e.parameters = {{"mean_difference_n", meanOff}, {"mean_measured_n", level}, {"half_corridor_n", meanSpread}};
    e.note = fmt::format("mean {:+.2f} N of {:.2f} N; one curve is predicted, without the spread from place to place",
                         meanOff, level);
    e.picture = {
        fmt::format("Needle into human liver: {}", what), "travel of the stage [mm]", "force [N]", {ours, low, high, mean}};
    e.judge();
    return e;
}

Experiment ruptureExperiment(const NeedleStroke& ours, const std::vector<Curve>& measured)
{
    Experiment e;
    e.name = "needle-ruptures";
    e.quantity = "ruptures of over 0.15 N per insertion, difference of the means";
    e.source = source;
    e.fittedOn = "nothing: the needle's law has no parameter for them";
    e.predicted = "ruptures of one insertion";
    ValidateCurve points{"measured, curve by curve", {}, {}, false}, line{"predicted", {}, {}, true};
    double sum = 0.0, squares = 0.0;
    for (const Curve& c : measured) {
        const double n = rupturesOf(c);
        sum += n;
        squares += n * n;
        points.x.push_back(static_cast<double>(points.x.size() + 1));
        points.y.push_back(n);
        line.x.push_back(points.x.back());
        line.y.push_back(static_cast<double>(ours.falls));
    }
    const auto count = static_cast<double>(measured.size());
    const double mean = sum / count;
    const double spread = std::sqrt(std::max(squares / count - mean * mean, 0.0));
    e.error = e.worst = 1e2 * std::abs(static_cast<double>(ours.falls) - mean) / mean;
    e.scatter = e.bound = 1e2 * spread / mean;
    e.parameters = {{"measured", mean}, {"measured_spread", spread}, {"predicted", static_cast<double>(ours.falls)}};
    e.note = fmt::format(
        "measured {:.1f} +- {:.1f}, predicted {}: inside one tissue the law cuts evenly, and only boundaries of tissues "
        "give way",
        mean, spread, ours.falls);
    e.picture = {"Ruptures per insertion", "held-back curve", "ruptures over 0.15 N", {points, line}};
    e.judge();
    return e;
}

// Mean over curves of the held force over that at the start, by seconds.
std::map<double, std::vector<double>> holdRatios(const std::filesystem::path& file, bool even)
{
    const Measurements table(file);
    std::map<double, std::vector<double>> ratios;
    double start = NAN;
    for (std::size_t row = 0; row < table.rows(); ++row) {
        const double seconds = table.number(row, "t_hold_s");
        const double force = table.number(row, "F_N");
        start = seconds == 0.0 ? force : start;
        if ((static_cast<int>(table.number(row, "curve")) % 2 == 0) == even) {
            ratios[seconds].push_back(force / start);
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
    e.source = source;
    e.fittedOn = "curves with even numbers: weights of the tissue's Prony series";
    e.predicted = "held force of the curves with odd numbers, 0.1 to 50 s";
    e.bound = 10.0;
    const auto measured = holdRatios(file, false);
    ValidateCurve mean{"measured, mean of held-back curves", {}, {}, false}, line{"predicted", {}, {}, true};
    double spread = 0.0;
    for (std::size_t i = 0; i < heldAt.size(); ++i) {
        const auto found = measured.find(heldAt[i]);
        if (found == measured.end()) {
            throw std::runtime_error(fmt::format("{}: has no force {} s after the stop", file.string(), heldAt[i]));
        }
        const double wanted = meanFrom(found->second, 0);
        const double off = ours.held[i] / ours.held.front() - wanted;
        if (heldAt[i] == 1.0 || heldAt[i] == 10.0) {
            e.error = std::max(e.error, 1e2 * std::abs(off));
        }
        std::vector<double> apart;
        for (const double r : found->second) {
            apart.push_back(1e2 * (r - wanted));
        }
        spread = std::max(spread, summaryOf(apart).rms);
        e.worst = std::max(e.worst, 1e2 * std::abs(off));
        mean.x.push_back(heldAt[i]);
        mean.y.push_back(wanted);
        line.x.push_back(heldAt[i]);
        line.y.push_back(ours.held[i] / ours.held.front());
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

haptics::SessionModel liverBlock(double cutting, const volume::Relaxation& relaxation)
{
    auto table = datasets::defaultTissues();
    auto& liver = table.rows[*table.find("liver")];
    liver.cuttingForce = cutting;
    liver.punctureForce = cutting;  // the curves show no capsule: the surface was not recorded
    liver.relaxingFast = relaxation.weights[0];
    liver.relaxingSlow = relaxation.weights[1];
    auto scene = datasets::parseScene(
        "name = \"liver\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2\n[volume.parameters]\ntissue = \"liver\"\ntumours = "
        "0\nwidth_mm = 80\nthickness_mm = 110\n[target]\nstructure = \"base\"\nentry_mm = [0, 0, 0]\naim_mm = [0, 112, "
        "0]\n[dffb]\nmode = \"off\"\n[model]\nlevel = \"chainmail\"\nrelaxation = true\n",
        "liver.toml");
    scene.tool.radius = needleRadius;
    scene.tool.notchRadius = std::min(scene.tool.notchRadius, 0.8 * needleRadius);
    auto tissue = std::make_shared<const volume::Tissue>(datasets::makePhantom(scene.source.phantom, table));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

// Means of a force over the steps of depth.
class Binned {
public:
    void add(double depth, double force)
    {
        if (depth >= 0.0) {
            const auto bin = static_cast<std::size_t>(depth / strokeStep);
            sum_.resize(std::max(sum_.size(), bin + 1));
            count_.resize(sum_.size());
            sum_[bin] += force;
            count_[bin] += 1.0;
        }
    }
    std::vector<double> means() const
    {
        std::vector<double> out(sum_.size(), NAN);
        for (std::size_t i = 0; i < out.size(); ++i) {
            out[i] = count_[i] > 0.0 ? sum_[i] / count_[i] : NAN;
        }
        return out;
    }

private:
    std::vector<double> sum_, count_;
};

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

NeedleStroke needleStroke(double cutting, double depth, const volume::Relaxation& relaxation,
                          const std::vector<double>& heldAt)
{
    const haptics::SessionModel model = liverBlock(cutting, relaxation);
    const auto methods = ourMethods();
    const StabilityMethod& method = *std::ranges::find(methods, datasets::ModelLevel::chainmail, &StabilityMethod::level);
    const MethodScene scene{model, haptics::deviceParameters(model.scene.device)};
    const RunningMethod running = method.start(scene);
    const Vec3 axis(0, 1, 0);
    const auto force = [&](double at) {
        haptics::DeviceSample sample;
        sample.position = model.approach.entry + at * axis;
        sample.axis = axis;
        sample.buttons = haptics::buttonDeadMan;
        return -glm::dot(running.tick(sample), axis);
    };
    constexpr double outside = 5e-3;
    for (double t = 0.0; t < haptics::settledAfter; t += scene.period) {
        force(-outside);
    }
    const double step = speed * scene.period;
    const auto steps = static_cast<int>(std::ceil((depth + outside) / step));
    NeedleCurve in;
    Binned inBins, outBins;
    for (int i = 0; i <= steps; ++i) {
        in.depth.push_back(std::min(-outside + i * step, depth));
        in.force.push_back(force(in.depth.back()));
        inBins.add(in.depth.back(), in.force.back());
    }
    in.turn = in.depth.size();
    NeedleStroke out;
    out.falls = fallsOf(in, minRupture).size();
    double t = 0.0, last = in.force.back();
    for (const double at : heldAt) {
        for (; t < at - 0.5 * scene.period; t += scene.period) {
            last = force(depth);
        }
        out.held.push_back(last);
    }
    for (int i = 1; i <= steps; ++i) {
        const double at = depth - i * step;
        outBins.add(at, -force(at));
    }
    out.in = inBins.means();
    out.out = outBins.means();
    return out;
}

std::vector<Experiment> needleInLiver(const std::filesystem::path& curves, const std::filesystem::path& hold,
                                      const ValidateProgress& progress)
{
    std::vector<Curve> fitCurves, heldBack;
    for (auto& [number, curve] : curvesIn(curves)) {
        (number % 2 == 0 ? fitCurves : heldBack).push_back(std::move(curve));
    }
    if (fitCurves.size() < 3 || heldBack.size() < 3) {
        throw std::runtime_error(curves.string() + ": needs three curves with even numbers and three with odd ones");
    }
    const Fit fit = fitted(fitCurves);
    progress("needle");
    const std::vector<double> heldAt{0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0};
    const double surface = static_cast<double>(fit.surface) * strokeStep;
    const volume::Relaxation relaxation = heldRelaxation(hold);
    const NeedleStroke ours = needleStroke(fit.tip, travel - surface, relaxation, heldAt);
    std::vector<double> tip, insertion;
    for (std::size_t i = 0; static_cast<double>(i + 1) * strokeStep < travel; ++i) {
        const std::size_t inside = i - fit.surface;
        const bool cuts = i >= fit.surface && inside < ours.in.size() && inside < ours.out.size();
        tip.push_back(cuts ? ours.in[inside] - ours.out[inside] : 0.0);
        insertion.push_back(i < fit.friction.size() ? fit.friction[i] + tip.back() : NAN);
    }
    std::vector<std::vector<double>> measuredTip, measuredIn;
    for (const Curve& c : heldBack) {
        measuredTip.push_back(tipForce(c));
        measuredIn.push_back(c.in);
    }
    std::vector<Experiment> out{corridorExperiment("needle-tip", "tip force", tip, measuredTip),
                                corridorExperiment("needle-insertion", "force on the way in", insertion, measuredIn),
                                ruptureExperiment(ours, heldBack), holdExperiment(ours, relaxation, heldAt, hold)};
    out[0].fittedOn = "curves with even numbers: cutting force, and where the tissue begins";
    out[1].fittedOn =
        "curves with even numbers: the same, and the friction of guide and shaft: mean of the way out, bin by bin";
    out[0].parameters.insert(out[0].parameters.end(), {{"cutting_n", fit.tip}, {"surface_mm", 1e3 * surface}});
    out[1].parameters.insert(out[1].parameters.end(),
                             {{"guide_friction_n", fit.guide}, {"friction_n_per_m", fit.perMetre}});
    return out;
}

}  // namespace palpate::studies
