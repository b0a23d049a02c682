#include <reference/verification.h>

#include <base/folds.h>
#include <base/mapped.h>
#include <reference/box_mesh.h>
#include <reference/solve.h>
#include <studies/accuracy/elastic_formulas.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <ranges>
#include <utility>

namespace palpate::reference {

namespace {

using Rows = std::vector<VerificationRow>;

constexpr double modulus = 3e3;       // [Pa]
constexpr double unitPerMetre = 1e3;  // mm
const std::array<Elements, 2> bothElements{Elements::p2, Elements::p2p1};

const char* nameOf(Elements elements)
{
    return elements == Elements::p2 ? "P2" : "P2/P1";
}

SolveOptions mirroredIn(std::array<bool, 3> planes, Law law, Elements elements)
{
    SolveOptions options;
    options.law = law;
    options.elements = elements;
    options.mirrored = planes;
    return options;
}

std::vector<double> even(double high, int cells)
{
    return base::mapped<double>(std::views::iota(0, cells + 1), [&](int i) { return high * i / cells; });
}

VerificationRow rowOf(const char* problem, const char* quantity, double ours, double reference, double bound)
{
    return {problem, quantity, ours, reference, 1e2 * std::abs(ours / reference - 1.0), bound, "", ""};
}

// Points all over an eighth of a ball or box, off the elements' corners.
std::vector<Vec3> sampled(double side)
{
    std::vector<Vec3> points;
    volume::forEachIndex(Index3(0), Index3(10),
                         [&](Index3 at) { points.push_back(side / 11.0 * (Vec3(at) + Vec3(0.47))); });
    return points;
}

// |u - exact| / |exact| over the samples.
double relativeError(const Solver& solver, const std::vector<Vec3>& points, const std::function<Vec3(Vec3)>& exact)
{
    const std::vector<Vec3> u = solver.displacement(points);
    double wrong = 0.0, all = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Vec3 right = exact(points[i]);
        wrong += glm::dot(u[i] - right, u[i] - right);
        all += glm::dot(right, right);
    }
    return std::sqrt(wrong / all);
}

double meanSize(const std::vector<Vec3>& points, const std::function<Vec3(Vec3)>& exact)
{
    const double sum = base::sumOf(points, [&](Vec3 p) { return glm::dot(exact(p), exact(p)); });
    return std::sqrt(sum / static_cast<double>(points.size()));
}

// A row for a field: its quadratic mean, and the error's fraction of it.
VerificationRow fieldRow(const char* problem, const std::vector<Vec3>& points, const std::function<Vec3(Vec3)>& exact,
                         double error, double bound)
{
    const double size = unitPerMetre * meanSize(points, exact);
    VerificationRow row{problem, "displacement, rms [mm]", size * (1.0 + error), size, 1e2 * error, bound, "", ""};
    return row;
}

Patch pulledTop(double side, double by)
{
    Patch patch;
    patch.in = [side](Vec3 p) { return p.z > (1.0 - 1e-9) * side; };
    patch.u = [by](Vec3) { return Vec3(0.0, 0.0, by); };
    patch.components = {false, false, true};
    return patch;
}

// A bar under tension: every field of it is uniform, and any element exact.
Rows bars()
{
    constexpr double side = 20e-3, poisson = 0.49;
    const std::vector<double> ends = even(side, 2);
    const TetMesh mesh = boxMesh(ends, ends, ends, {});
    Rows rows;
    for (const Elements elements : bothElements) {
        Solver bar(mesh, std::vector<Material>{{modulus, poisson, 0.0}},
                   mirroredIn({true, true, true}, SmallStrain{}, elements));
        bar.prescribe(pulledTop(side, 0.01 * side));
        rows.push_back(rowOf("bar pulled by 1 %", "force [N]", -bar.force().z, 0.01 * modulus * side * side, 1e-4));
        rows.back().source = "Hooke's law, F = E A eps";
        rows.back().setting = fmt::format("linear, {}, nu {}", nameOf(elements), poisson);
        using Far = std::tuple<Law, double, double>;
        for (const auto& [law, stiffening, stretch] :
             {Far(NeoHookean{}, 0.0, 1.5), Far(NeoHookean{}, 1.0, 1.5), Far(NeoHookean{}, -0.2, 2.0),
              Far(Exponential{}, 2.0, 1.5), Far(Exponential{}, 18.0, 1.5), Far(Exponential{}, -0.2, 2.0)}) {
            Solver stretched(mesh, std::vector<Material>{{modulus, poisson, stiffening}},
                             mirroredIn({true, true, true}, law, elements));
            stretched.prescribe(pulledTop(side, (stretch - 1.0) * side));
            const double stress = studies::uniaxialTension(law, modulus, poisson, stiffening, stretch);
            rows.push_back(rowOf("bar pulled far", "force [N]", -stretched.force().z, stress * side * side, 1e-4));
            rows.back().source = "uniaxial stretch of its energy density (Ogden 1984)";
            rows.back().setting = fmt::format("{}, stiffening {}, to {}, {}, nu {}", volume::nameOf(law), stiffening,
                                              stretch, nameOf(elements), poisson);
        }
    }
    return rows;
}

// Eight point forces around a cube, each the mirror image of the next ones, make a smooth and symmetric field in it:
// quadratic elements converge to it by the third power.
Rows pointForce(Fineness fineness)
{
    constexpr double side = 20e-3, poisson = 0.3;
    const double shear = modulus / (2.0 * (1.0 + poisson));
    const Vec3 away(1.6 * side, 1.4 * side, 1.8 * side);
    const auto exact = [&](Vec3 x) {
        Vec3 u(0.0);
        for (int image = 0; image < 8; ++image) {
            const Vec3 sign(image & 1 ? -1.0 : 1.0, image & 2 ? -1.0 : 1.0, image & 4 ? -1.0 : 1.0);
            u += studies::kelvinDisplacement(shear, poisson, sign * Vec3(0.02, 0.01, 0.03), x - sign * away);
        }
        return u;
    };
    const std::vector<Vec3> points = sampled(side);
    const std::vector<int> cells = fineness == Fineness::quick ? std::vector<int>{2, 4} : std::vector<int>{2, 4, 8};
    Rows rows;
    for (const Elements elements : bothElements) {
        std::vector<double> sizes, errors;
        for (const int n : cells) {
            const std::vector<double> ends = even(side, n);
            Solver solver(boxMesh(ends, ends, ends, {}), std::vector<Material>{{modulus, poisson, 0.0}},
                          mirroredIn({true, true, true}, SmallStrain{}, elements));
            solver.prescribe({[](Vec3) { return true; }, exact, {true, true, true}});
            sizes.push_back(1.0 / n);
            errors.push_back(relativeError(solver, points, exact));
        }
        rows.push_back(fieldRow("point forces around a cube", points, exact, errors.back(), 0.1));
        rows.back().source = "Kelvin 1848";
        rows.back().setting = fmt::format("linear, {}, {} cells a side", nameOf(elements), cells.back());
        const double order = studies::convergenceOrder(sizes, errors);
        rows.push_back(rowOf("point forces around a cube", "order of convergence [-]", order, 3.0, 15.0));
        rows.back().source = "quadratic elements, a smooth field";
        rows.back().setting =
            fmt::format("linear, {}, {} to {} cells a side", nameOf(elements), cells.front(), cells.back());
    }
    return rows;
}

Rows inclusion(Fineness fineness)
{
    constexpr double ball = 10e-3, side = 30e-3, poisson = 0.45;
    constexpr double ratio = 10.0;
    const studies::Inclusion problem{ball, poisson, ratio, ratio, 0.01};
    const auto exact = [&](Vec3 x) { return studies::inclusionDisplacement(problem, x); };
    const std::vector<Vec3> points = sampled(side);
    const int cells = fineness == Fineness::quick ? 3 : 5;
    Rows rows;
    for (const Elements elements : bothElements) {
        Solver solver(ballInBox(ball, side, cells),
                      std::vector<Material>{{modulus, poisson, 0.0}, {ratio * modulus, poisson, 0.0}},
                      mirroredIn({true, true, true}, SmallStrain{}, elements));
        const auto outside = [](Vec3 p) { return std::max({p.x, p.y, p.z}) > (1.0 - 1e-9) * side; };
        solver.prescribe({outside, exact, {true, true, true}});
        rows.push_back(fieldRow("stiff ball in a matrix", points, exact, relativeError(solver, points, exact), 0.5));
        rows.back().source = "Goodier 1933, Eshelby 1957";
        rows.back().setting = fmt::format("linear, {}, nu {}, ball {} times as stiff, {} unknowns", nameOf(elements),
                                          poisson, ratio, solver.unknowns());
    }
    return rows;
}

struct SphereCase {
    const char* problem;
    double thickness;  // [m]
    double poisson;
    Elements elements;
    double factor;  // of Hertz's force
    const char* source;
};

VerificationRow sphere(const SphereCase& c, double radius, double depth, Fineness fineness)
{
    const bool quick = fineness == Fineness::quick;
    const double contact = std::sqrt(radius * depth);
    const int cells = quick ? 5 : 8;
    const DiscInSlab shape{.radius = 1.2 * contact,
                           .side = 4.0 * c.thickness,
                           .thickness = c.thickness,
                           .fine = contact / cells,
                           .growth = quick ? 1.9 : 1.4,
                           .fineTo = 0.3 * contact,
                           .around = quick ? 3 : 5};
    Solver solver(discInSlab(shape), std::vector<Material>{{modulus, c.poisson, 0.0}},
                  mirroredIn({true, true, false}, SmallStrain{}, c.elements));
    solver.press({{0.0, 0.0, radius - depth}, radius});
    const double force = studies::hertzForce(modulus, c.poisson, radius, depth) * c.factor;
    VerificationRow row = rowOf(c.problem, "force [mN]", 1e3 * 4.0 * solver.force().z, 1e3 * force, quick ? 2.0 : 1.0);
    row.source = c.source;
    row.setting = fmt::format("linear, {}, nu {}, {} cells in the contact's radius", nameOf(c.elements), c.poisson, cells);
    return row;
}

Rows spheres(Fineness fineness)
{
    // So shallow that the sphere is a paraboloid and the strain small; the contact's radius is 1 mm.
    constexpr double radius = 40e-3, depth = 0.025e-3, contact = 1e-3;
    const auto bonded = [&](double poisson, double thickness) {
        return studies::bondedLayerFactor(poisson, contact / thickness);
    };
    const std::array<SphereCase, 3> cases{
        {{"sphere on a thick layer", 15e-3, 0.45, Elements::p2, bonded(0.45, 15e-3),
          "Hertz 1882, depth by Dimitriadis et al. 2002"},
         {"sphere on a bonded layer, chi 0.125", 8e-3, 0.45, Elements::p2, bonded(0.45, 8e-3), "Dimitriadis et al. 2002"},
         {"sphere on a bonded layer, chi 0.25", 4e-3, 0.4999, Elements::p2p1, studies::incompressibleLayerFactor(0.25),
          "Garcia, Garcia 2018"}}};
    return base::mapped<VerificationRow>(cases, [&](const SphereCase& c) { return sphere(c, radius, depth, fineness); });
}

VerificationRow punch(double perThickness, double poisson, Fineness fineness)
{
    const bool quick = fineness == Fineness::quick;
    constexpr double radius = 5e-3, depth = 0.1e-3;
    const double thickness = radius / perThickness;
    const DiscInSlab shape{
        radius,       radius + 5.0 * thickness, thickness, radius / (quick ? 24.0 : 100.0), quick ? 2.0 : 1.6, 0.0,
        quick ? 3 : 5};
    Solver solver(discInSlab(shape), std::vector<Material>{{modulus, poisson, 0.0}},
                  mirroredIn({true, true, false}, SmallStrain{}, Elements::p2));
    Patch patch;
    patch.in = [&](Vec3 p) { return p.z > -1e-9 && std::hypot(p.x, p.y) < radius + 0.5 * shape.fine; };
    patch.u = [](Vec3) { return Vec3(0.0, 0.0, -depth); };
    patch.components = {false, false, true};
    solver.prescribe(patch);
    const double plain = studies::flatPunchForce(modulus, poisson, radius, depth);
    const double ours = 4.0 * solver.force().z;
    if (perThickness < 0.2) {
        const double factor = studies::deepPunchFactor(poisson, perThickness);
        VerificationRow row =
            rowOf("flat punch on a thick layer", "force [mN]", 1e3 * ours, 1e3 * plain * factor, quick ? 3.0 : 1.0);
        row.source = "Sneddon 1965, finite depth to first order";
        row.setting = fmt::format("linear, P2, nu {}, a/h {:g}", poisson, perThickness);
        return row;
    }
    const double factor = studies::thinLayerPunchFactor(poisson, perThickness);
    VerificationRow row =
        rowOf("flat punch on a thin bonded layer", "force, half-spaces [-]", ours / plain, factor, quick ? 4.0 : 1.0);
    row.source = "Hayes et al. 1972, table";
    row.setting = fmt::format("linear, P2, nu {}, a/h {:g}", poisson, perThickness);
    return row;
}

Rows punches(Fineness fineness)
{
    const std::vector<double> fractions = fineness == Fineness::quick ? std::vector<double>{0.05, 0.2, 1.0}
                                                                      : std::vector<double>{0.05, 0.2, 0.4, 0.6, 0.8, 1.0};
    Rows rows;
    for (const double poisson : {0.3, 0.45}) {
        std::ranges::transform(fractions, std::back_inserter(rows), [&](double f) { return punch(f, poisson, fineness); });
    }
    return rows;
}

}  // namespace

std::vector<VerificationRow> verifyReference(Fineness fineness, const std::function<void(const std::string&)>& progress)
{
    const std::vector<std::pair<const char*, std::function<Rows()>>> problems{
        {"bars", bars},
        {"point force", [&] { return pointForce(fineness); }},
        {"inclusion", [&] { return inclusion(fineness); }},
        {"sphere on layers", [&] { return spheres(fineness); }},
        {"flat punch on layers", [&] { return punches(fineness); }},
    };
    Rows rows;
    for (const auto& [name, solve] : problems) {
        if (progress) {
            progress(name);
        }
        const Rows own = solve();
        rows.insert(rows.end(), own.begin(), own.end());
    }
    return rows;
}

}  // namespace palpate::reference
