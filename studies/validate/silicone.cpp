#include <base/mapped.h>
#include <studies/validate/experiment.h>

#include <base/error.h>
#include <studies/validate/cell_body.h>
#include <studies/validate/measurements.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numbers>

namespace palpate::studies {

double Incompressible::energy(double invariant) const noexcept
{
    return 0.5 * shear * invariant + volume::beyond(law, shear, stiffening, invariant).energy;
}

double Incompressible::slope(double invariant) const noexcept
{
    return 0.5 * (shear + volume::beyond(law, shear, stiffening, invariant).slope);
}

double uniaxialStress(const Incompressible& law, double stretch) noexcept
{
    const double invariant = stretch * stretch + 2.0 / stretch - 3.0;
    return 2.0 * law.slope(invariant) * (stretch - 1.0 / (stretch * stretch));
}

double scaleOf(const std::vector<double>& shape, const std::vector<double>& values) noexcept
{
    double mixed = 0.0, own = 0.0;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        mixed += shape[i] * values[i];
        own += shape[i] * shape[i];
    }
    return mixed / own;
}

namespace {

constexpr double fitFrom = 0.02, fitTo = 0.10;     // strains that the modulus is fitted on
constexpr double boundFrom = 0.05, boundTo = 0.3;  // strains that the bound is on
constexpr double last = 0.4;                       // strain that loads are predicted to
constexpr double tiny = 1e-9;
const char* const source =
    "Dawood et al. 2026, Hyperelastic Characterisation of Silicone Tissue Phantoms (CC BY 4.0): Ecoflex cylinders 50 x 30 "
    "mm, 10 mm/min, 10 tests each; friction of the platens not stated";

// Mean load of one material at each strain.
struct Material {
    std::string name;
    std::vector<double> strain, load, scatter;  // [-], [N], standard deviation [N]
};

std::vector<Material> materialsIn(const std::filesystem::path& file)
{
    const Measurements table(file);
    constexpr double area = std::numbers::pi * 25e-3 * 25e-3;
    std::vector<Material> all;
    for (std::size_t row = 0; row < table.rows(); ++row) {
        const std::string& name = table.text(row, "phantom");
        if (all.empty() || all.back().name != name) {
            all.push_back({name, {}, {}, {}});
        }
        if (const double strain = table.number(row, "strain"); strain < last + tiny) {
            all.back().strain.push_back(strain);
            all.back().load.push_back(table.number(row, "load_mean_N"));
            all.back().scatter.push_back(1e3 * area * table.number(row, "stress_sd_kPa"));
        }
    }
    for (const Material& m : all) {
        base::failIf(m.strain != all.front().strain, "{}: {} is measured at other strains than {}", file.native(), m.name,
                     all.front().name);
    }
    return all;
}

// Loads of shear modulus 1 Pa as a parabola in b, through three computed ones.
class LoadCurves {
public:
    LoadCurves(const Cylinder& shape, bool bonded, const std::vector<double>& strains)
    {
        for (std::size_t i = 0; i < at_.size(); ++i) {
            loads_[i] = compressionLoads(shape, at_[i], bonded, strains);
        }
    }

    std::vector<double> operator()(double b) const
    {
        std::vector<double> out(loads_[0].size());
        for (std::size_t i = 0; i < at_.size(); ++i) {
            double weight = 1.0;
            for (std::size_t j = 0; j < at_.size(); ++j) {
                weight *= i == j ? 1.0 : (b - at_[j]) / (at_[i] - at_[j]);
            }
            for (std::size_t k = 0; k < out.size(); ++k) {
                out[k] += weight * loads_[i][k];
            }
        }
        return out;
    }

private:
    static constexpr std::array<double, 3> at_{0.0, -0.12, -0.24};
    std::array<std::vector<double>, 3> loads_;
};

// Of a material under a law with this b: the modulus from the first strains, and the errors beyond.
struct Prediction {
    double shear = 0;            // [Pa]
    std::vector<double> load;    // [N]
    std::vector<double> errors;  // within the bound's strains [%]
};

Prediction predict(const Material& m, const std::vector<double>& shape)
{
    std::vector<double> fitShape, fitLoad;
    for (std::size_t i = 0; i < shape.size(); ++i) {
        if (m.strain[i] > fitFrom - tiny && m.strain[i] < fitTo + tiny) {
            fitShape.push_back(shape[i]);
            fitLoad.push_back(m.load[i]);
        }
    }
    Prediction p{scaleOf(fitShape, fitLoad), {}, {}};
    for (std::size_t i = 0; i < shape.size(); ++i) {
        p.load.push_back(p.shear * shape[i]);
        if (m.strain[i] > boundFrom - tiny && m.strain[i] < boundTo + tiny) {
            p.errors.push_back(1e2 * (p.load[i] / m.load[i] - 1.0));
        }
    }
    return p;
}

// Yeoh's b that fits all materials but one best.
double stiffeningWithout(const std::vector<Material>& all, std::size_t left, const LoadCurves& curves)
{
    constexpr double step = 0.005;
    double best = 0.0, least = INFINITY;
    for (double b = -0.25; b < 0.25; b += step) {
        const auto shape = curves(b);
        double sum = 0.0;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const double rms = i == left ? 0.0 : summaryOf(predict(all[i], shape).errors).rms;
            sum += rms * rms;
        }
        if (sum < least) {
            least = sum;
            best = b;
        }
    }
    return best;
}

double scatterOf(const std::vector<Material>& all)
{
    std::vector<double> relative;
    for (const Material& m : all) {
        for (std::size_t i = 0; i < m.strain.size(); ++i) {
            if (m.strain[i] > boundFrom - tiny && m.strain[i] < boundTo + tiny) {
                relative.push_back(1e2 * m.scatter[i] / m.load[i]);
            }
        }
    }
    return summaryOf(relative).rms;
}

std::vector<double> inPercent(std::vector<double> values)
{
    for (double& v : values) {
        v *= 1e2;
    }
    return values;
}

Experiment loadExperiment(const std::vector<Material>& all, const LoadCurves& curves, bool bonded, bool yeoh)
{
    Experiment e;
    const std::string platens = bonded ? "bonded to the platens" : "without friction";
    const std::string law = yeoh ? "Yeoh, two terms" : "neo-Hookean";
    e.name = fmt::format("silicone-{}-{}", bonded ? "bonded" : "frictionless", yeoh ? "yeoh" : "neo-hookean");
    e.quantity = fmt::format("load under compression, {}, {}: RMS of the worst of {} materials, 5 to 30 % strain", platens,
                             law, all.size());
    e.source = source;
    e.fittedOn = yeoh ? "modulus of each material: 2 to 10 % strain; b: the other materials, 5 to 30 %"
                      : "modulus of each material: 2 to 10 % strain";
    e.predicted = "load to 40 % strain, by the kernel's cells on the specimen";
    e.scatter = scatterOf(all);
    e.bound = yeoh ? 5.0 : 10.0;
    e.picture = {fmt::format("Silicone under compression, {}, {}", platens, law), "strain [%]", "load [N]", {}};
    std::vector<double> everything, atForty;
    for (std::size_t i = 0; i < all.size(); ++i) {
        const double b = yeoh ? stiffeningWithout(all, i, curves) : 0.0;
        const Prediction p = predict(all[i], curves(b));
        const ErrorSummary own = summaryOf(p.errors);
        e.error = largerError(e.error, own.rms);
        e.worst = largerError(e.worst, own.worst);
        everything.insert(everything.end(), p.errors.begin(), p.errors.end());
        atForty.push_back(1e2 * (p.load.back() / all[i].load.back() - 1.0));
        e.parameters.emplace_back(all[i].name + "_shear_kpa", 1e-3 * p.shear);
        if (yeoh) {
            e.parameters.emplace_back(all[i].name + "_b", b);
        }
        e.parameters.emplace_back(all[i].name + "_rms_pct", own.rms);
        if (i % 4 == 0) {
            const std::vector<double> strain = inPercent(all[i].strain);
            e.picture.curves.push_back({all[i].name + ", measured", strain, all[i].load, false});
            e.picture.curves.push_back({all[i].name + ", predicted", strain, p.load, true});
        }
    }
    const double mean = summaryOf(everything).rms;
    e.note =
        fmt::format("all materials together {:.1f} % RMS; at 40 % strain at most {:.1f} %", mean, summaryOf(atForty).worst);
    e.judge();
    return e;
}

// What bonding makes of a modulus at small strain, beside Gent and Lindley 1959: 1 + 2 S^2, S = D / 4H.
Experiment ratioExperiment(const Cylinder& shape)
{
    constexpr double small = 1e-3;
    const double smooth = compressionLoads(shape, 0.0, false, {small})[0];
    const double bonded = compressionLoads(shape, 0.0, true, {small})[0];
    const double s = 2.0 * shape.radius / (4.0 * shape.height);
    const double wanted = 1.0 + 2.0 * s * s;
    const double closed = -std::numbers::pi * shape.radius * shape.radius * uniaxialStress({1.0, 0.0}, 1.0 - small);
    Experiment e;
    e.name = "silicone-bonded-ratio";
    e.quantity = "load of the bonded specimen over that without friction, 0.1 % strain";
    e.source = "A. N. Gent, P. B. Lindley, Proc. Inst. Mech. Eng. 173, 1959: 1 + 2 S^2 for rubber blocks";
    e.fittedOn = "nothing";
    e.predicted = fmt::format("{:.3f} by the kernel's cells, {:.3f} by the formula", bonded / smooth, wanted);
    e.error = e.worst = 1e2 * std::abs(bonded / smooth / wanted - 1.0);
    e.bound = 3.0;
    e.parameters = {{"ratio", bonded / smooth}, {"formula", wanted}, {"frictionless_over_closed_form", smooth / closed}};
    e.note = fmt::format("without friction the cells are {:+.2f} % from the closed form", 1e2 * (smooth / closed - 1.0));
    e.picture = {"Bonded cylinder under compression", "strain [%]", "load over shear modulus and area [-]", {}};
    const std::vector<double> strains{0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4};
    const double area = std::numbers::pi * shape.radius * shape.radius;
    for (const bool isBonded : {false, true}) {
        auto loads = compressionLoads(shape, 0.0, isBonded, strains);
        for (double& load : loads) {
            load /= area;
        }
        e.picture.curves.push_back(
            {isBonded ? "kernel, bonded" : "kernel, no friction", inPercent(strains), std::move(loads), true});
    }
    ValidateCurve exact{"closed form, no friction", inPercent(strains), {}, false};
    exact.y = base::mapped<double>(strains, [](double strain) { return -uniaxialStress({1.0, 0.0}, 1.0 - strain); });
    e.picture.curves.push_back(std::move(exact));
    e.judge();
    return e;
}

// Fraction of a cell that lies in the cylinder, by 8 x 8 lines along the axis.
double shareInside(const Cylinder& shape, Index3 cell)
{
    constexpr int lines = 8;
    int inside = 0;
    for (int i = 0; i < lines * lines; ++i) {
        const double x = shape.cell * (cell.x + (i % lines + 0.5) / lines);
        const double y = shape.cell * (cell.y + (i / lines + 0.5) / lines);
        inside += x * x + y * y < shape.radius * shape.radius ? 1 : 0;
    }
    return static_cast<double>(inside) / (lines * lines);
}

// A quarter of the upper half: the planes x, y, z = 0 are of symmetry, and without friction the lower half is the same.
struct Quarter {
    Quarter(const Cylinder& shape, double stiffening)
        : cells(Index3(static_cast<int>(std::ceil(shape.radius / shape.cell - tiny)),
                       static_cast<int>(std::ceil(shape.radius / shape.cell - tiny)),
                       static_cast<int>(std::lround(0.5 * shape.height / shape.cell)))),
          body(cells, shape.cell)
    {
        const double youngs = 2.0 * (1.0 + shape.poisson);
        volume::forEachIndex(Index3(0), cells - 1, [&](Index3 cell) {
            if (const double fraction = shareInside(shape, cell); fraction > 0.0) {
                body.fill(cell, {youngs, shape.poisson, stiffening}, fraction);
            }
        });
        volume::forEachIndex(Index3(0), cells, [&](Index3 node) {
            for (int axis = 0; axis < 3; ++axis) {
                if (node[axis] == 0) {
                    body.prescribe(node, axis, 0.0);
                }
            }
        });
    }

    void press(double way, bool bonded)
    {
        volume::forEachIndex(Index3(0, 0, cells.z), cells, [&](Index3 node) {
            body.prescribe(node, 2, -way);
            for (int axis = 0; bonded && axis < 2; ++axis) {
                body.prescribe(node, axis, 0.0);
            }
        });
    }

    double load() const
    {
        double sum = 0.0;
        volume::forEachIndex(Index3(0, 0, cells.z), cells, [&](Index3 node) { sum -= body.reaction(node).z; });
        return 4.0 * sum;
    }

    Index3 cells;
    CellBody body;
};

}  // namespace

std::vector<double> compressionLoads(const Cylinder& shape, double stiffening, bool bonded,
                                     const std::vector<double>& strains)
{
    constexpr double tolerance = 2e-4;
    constexpr int evaluations = 6000;
    constexpr double longest = 0.02;  // strain of a load step
    Quarter quarter(shape, stiffening);
    std::vector<double> loads;
    double before = 0.0;
    for (const double strain : strains) {
        const int steps = std::max(1, static_cast<int>(std::ceil((strain - before) / longest - tiny)));
        for (int i = 1; i <= steps; ++i) {
            const double now = before + (strain - before) / steps * i;
            const double last = before + (strain - before) / steps * (i - 1);
            if (last > 0.0) {
                quarter.body.scale(now / last);
            }
            quarter.press(0.5 * now * shape.height, bonded);
            if (!quarter.body.solve(tolerance, evaluations)) {
                throw base::error("cylinder at {:.1f} % strain: no equilibrium, residual {:.1e}", 1e2 * now,
                                  quarter.body.unbalanced());
            }
        }
        before = strain;
        loads.push_back(quarter.load());
    }
    return loads;
}

std::vector<Experiment> siliconeCompression(const std::filesystem::path& file, bool quick, const ValidateProgress& progress)
{
    const std::vector<Material> all = materialsIn(file);
    Cylinder shape;
    shape.cell = quick ? 5e-3 : shape.cell;
    std::vector<Experiment> out;
    for (const bool bonded : {false, true}) {
        progress(bonded ? "silicone: bonded" : "silicone: without friction");
        const LoadCurves curves(shape, bonded, all.front().strain);
        std::ranges::transform(std::initializer_list{false, true}, std::back_inserter(out),
                               [&](bool yeoh) { return loadExperiment(all, curves, bonded, yeoh); });
    }
    progress("silicone: ratio");
    out.push_back(ratioExperiment(shape));
    return out;
}

}  // namespace palpate::studies
