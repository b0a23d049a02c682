#include <studies/validate/relaxation.h>

#include <haptics/session_model.h>
#include <studies/press/press.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <memory>

namespace palpate::studies {

namespace {

constexpr double ballRadius = 5e-3;    // [m]
constexpr double speed = 20e-3;        // [m/s]
constexpr double viscousTime = 50e-3;  // [s]
constexpr double hold = 50e-3;         // [s]

haptics::SessionModel blockWith(double viscosity)
{
    auto scene = datasets::parseScene(
        fmt::format("name = \"relaxation\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 2\n[volume.parameters]\ntumours = "
                    "0\nwidth_mm = 48\nthickness_mm = 24\n[target]\nstructure = \"base\"\nentry_mm = [0, 0, 0]\naim_mm = "
                    "[0, 24, 0]\n[dffb]\nmode = \"off\"\n[tool]\nkind = \"sphere\"\nradius_mm = 5\n[model.elastic]\n"
                    "viscosity_ms = {:g}\n",
                    1e3 * viscosity),
        "relaxation.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

// Force against the way in, tick by tick [N].
std::vector<double> pressed(double viscosity, double depth)
{
    const haptics::SessionModel model = blockWith(viscosity);
    const double way = depth + 0.5e-3;
    PosePath path{"relaxation", {}};
    const auto at = [&](double y, double seconds) {
        path.poses.push_back({Vec3(0, y - ballRadius, 0), Vec3(0, 1, 0), seconds});
    };
    at(-0.5e-3, 0.0);
    at(depth, way / speed);
    at(depth, way / speed + hold);
    PressOptions options;
    options.tool.kind = datasets::ToolKind::sphere;
    options.tool.radius = ballRadius;
    options.converge = true;
    std::vector<double> force;
    press(model, path, {}, options, [&](const PressSample& s) { force.push_back(-s.force.y); });
    return force;
}

}  // namespace

Experiment kelvinVoigt(bool quick, const ValidateProgress& progress)
{
    const double depth = quick ? 1.5e-3 : 4e-3;
    progress("relaxation: without viscosity");
    const std::vector<double> elastic = pressed(0.0, depth);
    progress("relaxation: with viscosity");
    const std::vector<double> viscous = pressed(viscousTime, depth);
    Experiment e;
    e.name = "relaxation-kelvin-voigt";
    e.quantity = "force of a ball pressed in and held, RMS of the difference over the largest force";
    e.source = "closed form of a Kelvin-Voigt solid, F = F_e + T dF_e/dt; no measurement";
    e.fittedOn = "nothing";
    e.predicted = fmt::format("force over time at T = {:g} ms, {:g} mm deep at {:g} mm/s, then held", 1e3 * viscousTime,
                              1e3 * depth, 1e3 * speed);
    e.bound = 5.0;
    e.picture = {"A ball pressed in and held, viscous tissue", "time [ms]", "force [N]", {}};
    ValidateCurve ours{"simulated", {}, {}, true}, wanted{"Kelvin-Voigt", {}, {}, true},
        without{"without viscosity", {}, {}, true};
    double largest = 0.0;
    std::vector<double> errors;
    constexpr std::size_t apart = 5;  // ticks of the difference quotient
    for (std::size_t i = apart; i + apart < std::min(elastic.size(), viscous.size()); ++i) {
        const double rate = (elastic[i] - elastic[i - apart]) / (1e-3 * apart);
        const bool turns = std::abs(elastic[i + apart] - 2.0 * elastic[i] + elastic[i - apart]) >
                           0.3 * std::abs(elastic[i] - elastic[i - apart]) + 1e-6;
        const double exact = elastic[i] + viscousTime * rate;
        largest = std::max(largest, exact);
        if (!turns) {
            errors.push_back(viscous[i] - exact);
        }
        const double now = static_cast<double>(i);
        ours.x.push_back(now);
        ours.y.push_back(viscous[i]);
        wanted.x.push_back(now);
        wanted.y.push_back(exact);
        without.x.push_back(now);
        without.y.push_back(elastic[i]);
    }
    const ErrorSummary summary = summaryOf(errors);
    e.error = 1e2 * summary.rms / largest;
    e.worst = 1e2 * summary.worst / largest;
    e.parameters = {{"peak_n", largest}, {"held_n", viscous.back()}, {"elastic_n", elastic.back()}};
    e.note = fmt::format(
        "held force over the peak {:.2f}, from the first moment on: Kelvin-Voigt has no slow relaxation, which tissue has "
        "(needle-hold)",
        viscous.back() / largest);
    e.picture.curves = {ours, wanted, without};
    e.judge();
    return e;
}

}  // namespace palpate::studies
