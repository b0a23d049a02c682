#include <base/mapped.h>
#include <studies/commands.h>

#include <base/outputs.h>
#include <command/json.h>
#include <command/progress.h>
#include <report/chart/chart.h>
#include <studies/needle/needle_curves.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr double minFall = 0.1;       // of a force that gives way [N]
constexpr double chartStep = 0.1e-3;  // between points of a curve [m]
constexpr double liverBreaks = 1.5;   // where the chart's published curve ends [N]
constexpr double onsetSpeed = 5e-3;   // [m/s]

struct NeedleArguments {
    std::string folder, json;
    bool quick = false;
};

struct Figures {
    LayeredNeedle layered;
    std::vector<LiverNeedle> liver;
    Onset onset;
};

// A curve from its first point to `last`, at most one point per step.
report::ChartSeries seriesOf(const NeedleCurve& curve, std::size_t last)
{
    report::ChartSeries s{curve.name, {}, {}, true};
    double before = -1.0;
    for (std::size_t i = 0; i < last; ++i) {
        if (std::abs(curve.depth[i] - before) >= chartStep || i + 1 == last) {
            s.add(1e3 * curve.depth[i], curve.force[i]);
            before = curve.depth[i];
        }
    }
    return s;
}

// One line up to `top` where each tissue begins, joined along zero.
report::ChartSeries boundarySeries(const std::vector<NeedleBoundary>& boundaries, double top)
{
    report::ChartSeries s{"a tissue begins (at rest)", {}, {}, true, false};
    for (const auto& b : boundaries) {
        s.x.insert(s.x.end(), 3, 1e3 * b.depth);
        s.y.insert(s.y.end(), {0.0, top, 0.0});
        s.written.insert(s.written.end(), {"", b.tissue, ""});
    }
    return s;
}

report::Chart layeredChart(const LayeredNeedle& layered)
{
    double top = 0.0;
    report::Chart chart{"A 14 G needle through phantom 'layered' and out again", "depth of the hand [mm]",
                        "force on the hand against the way in [N]"};
    for (const auto& curve : layered.curves) {
        chart.series.push_back(seriesOf(curve, curve.punctures.empty() ? curve.turn : curve.depth.size()));
        top = std::max(top, *std::ranges::max_element(curve.force));
    }
    chart.series.push_back(boundarySeries(layered.boundaries, 1.1 * top));
    chart.note =
        "Palpate's way out lies below zero: the shaft is held. A boundary is felt deeper than it lies at rest, as the "
        "needle pushes the tissue ahead of it. The layers of the thesis, with 300 N/m each, are removed one after another, "
        "each for good: the gland behind the tumour went with that before it, and on the way out the last layer's force "
        "goes on.";
    return chart;
}

report::Chart liverChart(const std::vector<LiverNeedle>& liver)
{
    report::Chart chart{"A needle into liver", "depth of the hand [mm]", "force on the hand [N]"};
    std::ranges::transform(liver, std::back_inserter(chart.series),
                           [](const auto& l) { return seriesOf(l.curve, l.curve.turn); });
    const auto add = [&](const char* name, double from, double to, auto force) {
        report::ChartSeries s{name, {}, {}, true, false};
        for (double z = from; z <= to; z += 1e-3) {
            s.add(1e3 * z, force(z));
        }
        chart.series.push_back(std::move(s));
    };
    double end = 0.0;
    while (publishedLiverForce(end) < liverBreaks) {
        end += 1e-3;
    }
    add("published, before it breaks", 0.0, end, publishedLiverForce);
    add("and 0.2 N less", 0.0, end, [](double z) { return std::max(publishedLiverForce(z) - liverSpread, 0.0); });
    add("and 0.2 N more", 0.0, end, [](double z) { return publishedLiverForce(z) + liverSpread; });
    add("published, inside, and 0.2 N less", end, 50e-3,
        [](double z) { return liverCutting + liverFrictionLow * z - liverSpread; });
    add("published, inside, and 0.2 N more", end, 50e-3,
        [](double z) { return liverCutting + liverFrictionHigh * z + liverSpread; });
    return chart;
}

report::Chart onsetChart(const Onset& onset)
{
    report::Chart chart{"Pressing beside a vessel", "depth of the ball [mm]", "distance [mm]"};
    const auto add = [&](const char* name, double OnsetPoint::*value) {
        report::ChartSeries s{name, {}, {}, true};
        for (const auto& p : onset.points) {
            s.add(1e3 * p.pressed, 1e3 * (p.*value));
        }
        chart.series.push_back(std::move(s));
    };
    add("to the vessel as it lies now", &OnsetPoint::deformed);
    add("to where it lay at rest", &OnsetPoint::rest);
    add("the vessel gave way by", &OnsetPoint::moved);
    chart.bounds.push_back({"warning distance", 1e3 * onset.warnDistance});
    chart.note = "Distances from the ball's middle. The warning follows the vessel.";
    return chart;
}

json boundariesEntry(const std::vector<NeedleBoundary>& boundaries)
{
    return base::mapped<json>(boundaries, [](const auto& b) -> json {
        return {{"tissue", b.tissue}, {"depth_mm", 1e3 * b.depth}, {"force_n", b.force}};
    });
}

json curveEntry(const NeedleCurve& c)
{
    json falls = base::mapped<json>(fallsOf(c, minFall), [&](const double depth) { return 1e3 * depth; });
    const auto turn = c.force.begin() + static_cast<std::ptrdiff_t>(c.turn);
    return {{"name", c.name},
            {"punctures", boundariesEntry(c.punctures)},
            {"falls_mm", falls},
            {"peak_n", *std::max_element(c.force.begin(), turn)},
            {"withdrawal_n", -*std::min_element(turn, c.force.end())}};
}

json figuresJson(const Figures& f)
{
    json curves = base::mapped<json>(f.layered.curves, curveEntry), liver = json::array();
    for (const auto& l : f.liver) {
        liver.push_back({{"name", l.curve.name},
                         {"youngs_kpa", 1e-3 * l.youngsModulus},
                         {"radius_mm", 1e3 * l.radius},
                         {"speed_mm_s", 1e3 * l.speed},
                         {"broken_at_mm", l.curve.punctures.empty() ? json() : json(1e3 * l.curve.punctures[0].depth)},
                         {"furthest_before_n", l.furthestBefore},
                         {"outside_after_n", l.outsideAfter}});
    }
    return {{"layers", {{"boundaries", boundariesEntry(f.layered.boundaries)}, {"curves", curves}}},
            {"liver", liver},
            {"onset",
             {{"vessel_moved_mm", 1e3 * f.onset.points.back().moved},
              {"warned_at_mm", 1e3 * f.onset.warnedAt},
              {"deformed_onset_mm", 1e3 * f.onset.deformedOnset},
              {"rest_onset_mm", 1e3 * f.onset.restOnset}}}};
}

void print(const json& f)
{
    fmt::print("phantom 'layered'\n{:<26} {:>8} {:>10}\n", "tissue begins", "mm", "");
    for (const auto& b : f["layers"]["boundaries"]) {
        fmt::print("{:<26} {:>8.1f}\n", b["tissue"].get<std::string>(), b["depth_mm"].get<double>());
    }
    for (const auto& c : f["layers"]["curves"]) {
        fmt::print("{}: at most {:.2f} N in, {:.2f} N held on the way out; gives way at", c["name"].get<std::string>(),
                   c["peak_n"].get<double>(), c["withdrawal_n"].get<double>());
        for (const auto& fall : c["falls_mm"]) {
            fmt::print(" {:.1f}", fall.get<double>());
        }
        fmt::print(" mm\n");
        for (const auto& p : c["punctures"]) {
            fmt::print("  into {:<20} {:>8.1f} mm {:>7.2f} N\n", p["tissue"].get<std::string>(),
                       p["depth_mm"].get<double>(), p["force_n"].get<double>());
        }
    }
    fmt::print("\nliver beside the published curve\n{:<22} {:>6} {:>9} {:>6} {:>10} {:>12} {:>12}\n", "", "kPa",
               "radius mm", "mm/s", "breaks mm", "before N", "inside N");
    for (const auto& l : f["liver"]) {
        fmt::print("{:<22} {:>6.1f} {:>9.2f} {:>6.0f} {:>10.1f} {:>12.2f} {:>12.2f}\n", l["name"].get<std::string>(),
                   l["youngs_kpa"].get<double>(), l["radius_mm"].get<double>(), l["speed_mm_s"].get<double>(),
                   l["broken_at_mm"].is_null() ? NAN : l["broken_at_mm"].get<double>(),
                   l["furthest_before_n"].get<double>(), l["outside_after_n"].get<double>());
    }
    const auto& o = f["onset"];
    fmt::print("\nbeside a vessel that gives way by {:.1f} mm: warned {:.2f} mm deep; by distances at rest {:.2f} mm\n",
               o["vessel_moved_mm"].get<double>(), o["warned_at_mm"].get<double>(), o["rest_onset_mm"].get<double>());
}

void writeFolder(const std::filesystem::path& folder, const Figures& f, const json& figures)
{
    std::filesystem::create_directories(folder);
    const std::vector<report::Chart> charts{layeredChart(f.layered), liverChart(f.liver), onsetChart(f.onset)};
    const char* const names[]{"needle-layers.png", "needle-liver.png", "needle-onset.png"};
    for (std::size_t i = 0; i < charts.size(); ++i) {
        report::writeChartPng(charts[i], folder / names[i]);
    }
    report::writeChartHtml(charts, "Needle", folder / "needle.html");
    command::writeJson(folder / "needle.json", figures);
}

void benchNeedle(const NeedleArguments& o)
{
    base::checkOutput(o.json);
    base::checkOutputFolder(o.folder);
    using datasets::ModelLevel;
    const auto level = o.quick ? ModelLevel::chainmail : ModelLevel::elastic;
    command::Progress progress;
    Figures f;
    progress.show("layers");
    f.layered = layeredNeedle(level, o.quick ? 40e-3 : 10e-3);
    progress.show("liver");
    f.liver = liverNeedles(level);
    progress.show("beside a vessel");
    f.onset = warningOnset(o.quick ? 4.0 * onsetSpeed : onsetSpeed);
    progress.clear();
    const json figures = figuresJson(f);
    if (o.json != "-") {
        print(figures);
    }
    if (!o.folder.empty()) {
        writeFolder(o.folder, f, figures);
    }
    command::writeJson(o.json, figures);
}

}  // namespace

void addBenchNeedle(CLI::App& bench)
{
    auto o = std::make_shared<NeedleArguments>();
    auto* c = bench.add_subcommand(
        "needle",
        "Compute a needle's force against depth in layers and in liver, and where warnings begin beside a vessel");
    c->add_option("-o,--output", o->folder, "Folder for needle.html, .json and charts (PNG)");
    c->add_flag("--quick", o->quick, "Faster hand, level chainmail for the needle: seconds");
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o] { benchNeedle(*o); });
}

}  // namespace palpate::studies
