#include <studies/validate/experiment.h>

#include <haptics/session_model.h>
#include <studies/press/press.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <ranges>

namespace palpate::studies {

namespace {

constexpr double reliefBall = 5e-3;    // [m]
constexpr double reliefSpeed = 20e-3;  // [m/s]
constexpr double depth = 4e-3;         // [m]
constexpr double above = 0.5e-3;       // where the ball starts, over the tissue [m]
constexpr double reliefTick = 1e-3;    // [s]
const char* const relaxationSource = "closed form of a generalised Maxwell solid; no measurement";

haptics::SessionModel blockOfLiver(bool relaxes)
{
    auto scene = datasets::parseScene(
        fmt::format("name = \"relaxation\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2\n[volume.parameters]\ntumours = "
                    "0\nwidth_mm = 48\nthickness_mm = 24\ntissue = \"liver\"\n[target]\nstructure = \"base\"\nentry_mm = "
                    "[0, 0, 0]\naim_mm = [0, 24, 0]\n[dffb]\nmode = \"off\"\n[tool]\nkind = \"sphere\"\nradius_mm = 5\n"
                    "[model]\nrelaxation = {}\n",
                    relaxes),
        "relaxation.toml");
    return haptics::buildModel(std::move(scene));
}

volume::Relaxation ofLiver(const haptics::SessionModel& model)
{
    const auto& table = model.tissue->table();
    return table.rows[*table.find("liver")].relaxation();
}

// A ball's force against the way in, tick by tick [N], led by depths [m] that are `apart` seconds from each
// other.
std::vector<double> pressed(const haptics::SessionModel& model, const std::vector<double>& depths, double apart)
{
    PosePath path{"relaxation", {}};
    for (std::size_t i = 0; i < depths.size(); ++i) {
        path.poses.push_back({Vec3(0, depths[i] - reliefBall, 0), Vec3(0, 1, 0), static_cast<double>(i) * apart});
    }
    PressOptions options;
    options.tool.kind = datasets::ToolKind::sphere;
    options.tool.radius = reliefBall;
    options.converge = true;
    std::vector<double> force;
    press(model, path, {}, options, [&](const PressSample& s) { force.push_back(-s.force.y); });
    return force;
}

std::vector<double> pressAndHold(double hold)
{
    std::vector<double> depths;
    const auto ticks = static_cast<int>(std::lround(((depth + above) / reliefSpeed + hold) / reliefTick));
    for (int i = 0; i <= ticks; ++i) {
        depths.push_back(std::min(i * reliefTick * reliefSpeed - above, depth));
    }
    return depths;
}

// Sum of G(t - s) dF(s), F the force right after a step: each term forgets at its own rate.
std::vector<double> hereditary(const std::vector<double>& force, const volume::Relaxation& relaxation)
{
    std::vector<double> out;
    std::array<double, volume::relaxationTerms> lost{};
    for (std::size_t i = 0; i < force.size(); ++i) {
        double left = force[i];
        for (std::size_t term = 0; term < lost.size() && i > 0; ++term) {
            const double fraction = -std::expm1(-reliefTick / volume::relaxationTimes[term]);
            const double mean = 0.5 * (force[i] + force[i - 1]);
            lost[term] += fraction * (relaxation.weights[term] * mean - lost[term]);
            left -= lost[term];
        }
        out.push_back(left);
    }
    return out;
}

Experiment held(bool quick, const ValidateProgress& progress)
{
    const haptics::SessionModel soft = blockOfLiver(false), model = blockOfLiver(true);
    const volume::Relaxation relaxation = ofLiver(model);
    const std::vector<double> depths = pressAndHold(quick ? 1.5 : 5.0);
    progress("relaxation: without");
    std::vector<double> elastic = pressed(soft, depths, reliefTick);
    for (double& force : elastic) {
        force *= relaxation.instantaneous();
    }
    progress("relaxation: held");
    const std::vector<double> ours = pressed(model, depths, reliefTick);
    const std::vector<double> exact = hereditary(elastic, relaxation);
    Experiment e;
    e.name = "relaxation-held";
    e.quantity = "force of a ball pressed in and held, RMS of the difference over the largest force";
    e.source = relaxationSource;
    e.fittedOn = "nothing";
    e.predicted =
        fmt::format("force over time, liver, {:g} mm deep at {:g} mm/s, then held", 1e3 * depth, 1e3 * reliefSpeed);
    e.bound = 5.0;
    e.picture = {"A ball pressed in and held, tissue that relaxes", "time [s]", "force [N]", {}};
    ValidateCurve simulated{"simulated", {}, {}, true}, wanted{"hereditary integral", {}, {}, true};
    std::vector<double> errors;
    for (std::size_t i = 0; i < std::min(ours.size(), exact.size()); ++i) {
        errors.push_back(ours[i] - exact[i]);
        for (const auto& [curve, force] : {std::pair(&simulated, ours[i]), std::pair(&wanted, exact[i])}) {
            curve->add(static_cast<double>(i) * reliefTick, force);
        }
    }
    const double largest = *std::ranges::max_element(exact);
    const ErrorSummary summary = summaryOf(errors);
    e.error = 1e2 * summary.rms / largest;
    e.worst = 1e2 * summary.worst / largest;
    e.parameters = {{"peak_n", largest}, {"held_n", ours.back()}, {"held_exact_n", exact.back()}};
    e.note = fmt::format("held force over the peak {:.3f}, by the series {:.3f}",
                         ours.back() / *std::ranges::max_element(ours), exact.back() / largest);
    e.picture.curves = {simulated, wanted};
    e.judge();
    return e;
}

constexpr double swing = 0.2e-3;  // [m]
constexpr int turns = 3;          // the last counts

// Pressed in, then up and down about there.
std::vector<double> swinging(double frequency)
{
    std::vector<double> depths = pressAndHold(0.0);
    const auto ticks = static_cast<int>(std::lround(turns / frequency / reliefTick));
    std::ranges::transform(std::views::iota(1, ticks + 1), std::back_inserter(depths), [&](int i) {
        return depth - swing + swing * std::cos(2.0 * std::numbers::pi * frequency * i * reliefTick);
    });
    return depths;
}

// Work of the last turn, as if the force at its end were that at its start: the mean still falls [J].
double workOfLastTurn(const std::vector<double>& depths, const std::vector<double>& force, double frequency)
{
    const auto turn = static_cast<std::size_t>(std::lround(1.0 / frequency / reliefTick));
    const std::size_t first = depths.size() - 1 - turn;
    const double drift = (force.back() - force[first]) / static_cast<double>(turn);
    double work = 0.0;
    for (std::size_t i = first + 1; i < depths.size(); ++i) {
        const double mean = 0.5 * (force[i] + force[i - 1]) - drift * (static_cast<double>(i - first) - 0.5);
        work += mean * (depths[i] - depths[i - 1]);
    }
    return work;
}

Experiment lost(bool quick, const ValidateProgress& progress)
{
    const haptics::SessionModel soft = blockOfLiver(false), model = blockOfLiver(true);
    const volume::Relaxation relaxation = ofLiver(model);
    Experiment e;
    e.name = "relaxation-hysteresis";
    e.quantity = "work lost in a turn of a ball that swings in tissue, largest difference over the closed form";
    e.source = relaxationSource;
    e.fittedOn = "nothing";
    e.predicted = fmt::format("work lost at several frequencies, liver, {:g} mm about a depth of {:g} mm", 1e3 * swing,
                              1e3 * (depth - swing));
    e.bound = 10.0;
    ValidateCurve simulated{"simulated", {}, {}, false}, wanted{"closed form", {}, {}, true};
    std::vector<double> errors;
    for (const double frequency : quick ? std::vector{1.0, 3.0} : std::vector{0.3, 1.0, 3.0}) {
        progress(fmt::format("relaxation: {:g} Hz", frequency));
        const std::vector<double> depths = swinging(frequency);
        const std::vector<double> elastic = pressed(soft, pressAndHold(0.0), reliefTick);
        const std::vector<double> force = pressed(model, depths, reliefTick);
        const double ours = workOfLastTurn(depths, force, frequency);
        // F_e' about the middle of the swing.
        const auto back = static_cast<std::size_t>(std::lround(2.0 * swing / reliefSpeed / reliefTick));
        const std::size_t end = elastic.size() - 1;
        const double slope = relaxation.instantaneous() * (elastic[end] - elastic[end - back]) / (2.0 * swing);
        double fraction = 0.0;
        for (std::size_t i = 0; i < relaxation.weights.size(); ++i) {
            const double x = 2.0 * std::numbers::pi * frequency * volume::relaxationTimes[i];
            fraction += relaxation.weights[i] * x / (1.0 + x * x);
        }
        const double exact = std::numbers::pi * swing * swing * slope * fraction;
        errors.push_back(1e2 * (ours - exact) / exact);
        e.parameters.emplace_back(fmt::format("lost_{:g}_hz_uj", frequency), 1e6 * ours);
        e.parameters.emplace_back(fmt::format("exact_{:g}_hz_uj", frequency), 1e6 * exact);
        simulated.add(frequency, 1e6 * ours);
        wanted.add(frequency, 1e6 * exact);
    }
    const ErrorSummary summary = summaryOf(errors);
    e.error = e.worst = summary.worst;
    e.note = fmt::format("RMS {:.1f} %; what is lost has its largest value near {:.2g} Hz", summary.rms,
                         1.0 / (2.0 * std::numbers::pi * volume::relaxationTimes.front()));
    e.picture = {"Work that a swinging ball loses", "frequency [Hz]", "work of a turn [uJ]", {simulated, wanted}};
    e.judge();
    return e;
}

}  // namespace

std::vector<Experiment> relaxation(bool quick, const ValidateProgress& progress)
{
    return {held(quick, progress), lost(quick, progress)};
}

}  // namespace palpate::studies
