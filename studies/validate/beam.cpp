#include <base/folds.h>
#include <studies/validate/experiment.h>

#include <base/error.h>
#include <studies/validate/cell_body.h>
#include <studies/validate/measurements.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

namespace palpate::studies {

namespace {

constexpr double length = 100e-3, width = 30e-3;  // [m]
constexpr double stalk = 6e-3;                    // of a marker off the surface [m]

// A marker stands on a point of the surface; both sides of the surface there, in the sense of its outward normal.
struct Marker {
    Vec3 foot;           // beam's own frame, x from the clamp [m]
    Vec3 normal;         // outward
    Vec3 first, second;  // along the surface into the beam: first x second points as `turn` times the normal
    double turn;
};
const std::array<Marker, 3> markers{{
    {{length, 15e-3, width}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}, 1.0},
    {{length, 0.0, 24e-3}, {0, -1, 0}, {-1, 0, 0}, {0, 0, -1}, -1.0},
    {{length, width, 6e-3}, {0, 1, 0}, {-1, 0, 0}, {0, 0, 1}, -1.0},
}};

// Trilinear between nodes.
Vec3 displacementAt(const CellBody& body, Vec3 at, double cell)
{
    const Vec3 scaled = at / cell;
    const Index3 most = body.nodes() - 2;
    const Index3 low(std::clamp(static_cast<int>(scaled.x), 0, most.x), std::clamp(static_cast<int>(scaled.y), 0, most.y),
                     std::clamp(static_cast<int>(scaled.z), 0, most.z));
    Vec3 sum(0.0);
    for (int corner = 0; corner < 8; ++corner) {
        const Index3 side(corner & 1, corner >> 1 & 1, corner >> 2);
        double weight = 1.0;
        for (int axis = 0; axis < 3; ++axis) {
            const double part = scaled[axis] - low[axis];
            weight *= side[axis] != 0 ? part : 1.0 - part;
        }
        sum += weight * body.displacement(low + side);
    }
    return sum;
}

// The foot goes with the surface, and the stalk with the surface's normal.
Vec3 markerDisplacement(const CellBody& body, const Marker& marker, double cell)
{
    constexpr double reach = 10e-3;
    const Vec3 at = displacementAt(body, marker.foot, cell);
    const auto along = [&](Vec3 way) { return reach * way + displacementAt(body, marker.foot + reach * way, cell) - at; };
    const Vec3 normal = marker.turn * glm::normalize(glm::cross(along(marker.first), along(marker.second)));
    return at + stalk * (normal - marker.normal);
}

// What is measured of one load: drop of each marker, over its runs [mm].
struct MeasuredDrop {
    double tipLoad = 0;  // [N]
    std::array<std::vector<double>, 3> runs;
    double mean(std::size_t marker) const
    {
        return base::sumOf(runs[marker], std::identity()) / static_cast<double>(runs[marker].size());
    }
};

std::vector<MeasuredDrop> dropsIn(const std::filesystem::path& file)
{
    const Measurements table(file);
    std::map<double, MeasuredDrop> byLoad;
    for (std::size_t row = 0; row < table.rows(); ++row) {
        const double load = table.number(row, "tip_load_N");
        byLoad[load].tipLoad = load;
        const auto marker = static_cast<std::size_t>(table.number(row, "marker"));
        base::failIf(marker >= markers.size(), "{}: marker {} of three", file.native(), marker);
        byLoad[load].runs[marker].push_back(table.number(row, "settled_down_mm"));
    }
    std::vector<MeasuredDrop> out;
    for (const auto& [load, drop] : byLoad) {
        for (const auto& runs : drop.runs) {
            base::failIf(runs.empty(), "{}: a marker is missing at {} N", file.native(), load);
        }
        out.push_back(drop);
    }
    base::failIf(out.size() < 2 || out[0].tipLoad != 0.0, "{}: needs a run without load and one with", file.native());
    return out;
}

// Half the difference of two runs, fraction of their mean [%].
double scatterOf(const std::vector<MeasuredDrop>& drops)
{
    std::vector<double> relative;
    for (const MeasuredDrop& drop : drops) {
        for (std::size_t m = 0; m < markers.size(); ++m) {
            for (const double run : drop.runs[m]) {
                relative.push_back(1e2 * (run / drop.mean(m) - 1.0));
            }
        }
    }
    return summaryOf(relative).rms;
}

// Young's modulus under which the mean drop without load is the measured one [Pa].
double fittedModulus(Beam beam, double drop)
{
    beam.youngsModulus = 250e3;
    for (int i = 0; i < 3; ++i) {
        const auto at = beamMarkers(beam);
        beam.youngsModulus *= -1e3 * (at[0].z + at[1].z + at[2].z) / 3.0 / drop;
    }
    return beam.youngsModulus;
}

}  // namespace

std::array<Vec3, 3> beamMarkers(const Beam& beam)
{
    const Index3 cells(static_cast<int>(std::lround(length / beam.cell)), static_cast<int>(std::lround(width / beam.cell)),
                       static_cast<int>(std::lround(width / beam.cell)));
    constexpr int loadSteps = 4;
    constexpr double tolerance = 4e-4;
    constexpr int evaluations = 8000;
    CellBody body(cells, beam.cell);
    const double mass = beam.density * std::pow(beam.cell, 3) / 8.0;
    volume::forEachIndex(Index3(0), cells - 1, [&](Index3 cell) {
        body.fill(cell, {beam.youngsModulus, beam.poisson, 0.0});
    });
    volume::forEachIndex(Index3(0), Index3(0, cells.y, cells.z), [&](Index3 node) {
        for (int axis = 0; axis < 3; ++axis) {
            body.prescribe(node, axis, 0.0);
        }
    });
    for (int step = 1; step <= loadSteps; ++step) {
        volume::forEachIndex(Index3(0), cells - 1, [&](Index3 cell) {
            for (int corner = 0; corner < 8; ++corner) {
                body.load(cell + Index3(corner & 1, corner >> 1 & 1, corner >> 2), mass / loadSteps * beam.gravity);
            }
        });
        for (int y = 0; y <= cells.y; ++y) {
            const double fraction = (y == 0 || y == cells.y ? 0.5 : 1.0) / cells.y;
            body.load({cells.x, y, cells.z}, Vec3(0, 0, -fraction * beam.tipLoad / loadSteps));
        }
        if (step > 1) {
            body.scale(static_cast<double>(step) / (step - 1));
        }
        if (!body.solve(tolerance, evaluations)) {
            throw base::error("beam: no equilibrium at {} of {} of its load, residual {:.1e}", step, loadSteps,
                              body.unbalanced());
        }
    }
    std::array<Vec3, 3> out;
    for (std::size_t m = 0; m < markers.size(); ++m) {
        out[m] = markerDisplacement(body, markers[m], beam.cell);
    }
    return out;
}

Experiment siliconeBeam(const std::filesystem::path& file, bool quick, const ValidateProgress& progress)
{
    progress("beam");
    const std::vector<MeasuredDrop> drops = dropsIn(file);
    Beam beam;
    beam.cell = quick ? 10e-3 : 5e-3;
    Experiment e;
    e.name = "beam";
    e.quantity = "drop of three markers near the free end under a tip load, RMS";
    e.source =
        "Dubied et al. 2022, Sim-to-Real for Differentiable Projective Dynamics on Soft Robots (MIT): Dragon Skin 10 beam "
        "100 x 30 x 30 mm, clamped, marker displacements";
    e.fittedOn = "Young's modulus: mean drop under its own weight";
    e.predicted = "drop of each marker under its weight and a tip load, kernel's cells, neo-Hookean";
    e.bound = 6.0;
    e.scatter = scatterOf(drops);
    const MeasuredDrop& own = drops.front();
    beam.youngsModulus = fittedModulus(beam, (own.mean(0) + own.mean(1) + own.mean(2)) / 3.0);
    e.parameters.emplace_back("youngs_kpa", 1e-3 * beam.youngsModulus);
    e.picture = {"Silicone beam", "tip load [N]", "drop of a marker [mm]", {}};
    std::vector<double> errors;
    for (const bool predicted : {false, true}) {
        for (std::size_t m = 0; m < markers.size(); ++m) {
            const char* const what = predicted ? "predicted" : "measured";
            e.picture.curves.push_back({fmt::format("marker {}, {}", m, what), {}, {}, predicted});
        }
    }
    for (const MeasuredDrop& drop : drops) {
        beam.tipLoad = drop.tipLoad;
        const std::array<Vec3, 3> at = beamMarkers(beam);
        for (std::size_t m = 0; m < markers.size(); ++m) {
            const double predicted = -1e3 * at[m].z;
            if (drop.tipLoad > 0.0) {
                errors.push_back(1e2 * (predicted / drop.mean(m) - 1.0));
                e.parameters.emplace_back(fmt::format("drop_{}_mm_at_{:.2f}_n", m, drop.tipLoad), predicted);
            }
            for (const double run : drop.runs[m]) {
                e.picture.curves[m].add(drop.tipLoad, run);
            }
            e.picture.curves[markers.size() + m].add(drop.tipLoad, predicted);
        }
    }
    const ErrorSummary summary = summaryOf(errors);
    e.error = summary.rms;
    e.worst = summary.worst;
    e.note = fmt::format("Young's modulus {:.0f} kPa; its authors fitted 263.8 kPa on a heavier load",
                         1e-3 * beam.youngsModulus);
    e.judge();
    return e;
}

}  // namespace palpate::studies
