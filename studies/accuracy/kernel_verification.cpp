#include <studies/accuracy/kernel_verification.h>

#include <base/folds.h>
#include <base/mapped.h>
#include <chainmail/elastic.h>
#include <studies/accuracy/deep_press.h>
#include <studies/accuracy/elastic_formulas.h>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <ranges>
#include <span>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr double youngsModulus = 3000.0;  // [Pa]: no closed form here depends on it
constexpr double noCap = 0.4999;
constexpr int window = 31;      // nodes
constexpr double tight = 1e-5;  // residual, fraction of the contacts' forces
constexpr int maxCycles = 400;
constexpr int air = 8;  // cells around a slab: coarser cells end at its surface, too

/// A square slab, its top at y = 0 and pushed towards +y, bonded to a rigid base.
struct Slab {
    double width = 0, thickness = 0;  // [m]
    double poissonRatio = 0;
    double full = 1;  // of the first layer of cells: the top lies in it
};

double boxDistance(Vec3 p, Vec3 low, Vec3 high)
{
    const Vec3 off = glm::max(low - p, p - high);
    return glm::length(glm::max(off, Vec3(0.0))) + std::min(std::max({off.x, off.y, off.z}), 0.0);
}

// The base is one more layer of cells: all their nodes are fixed, those of the slab's lower face with them.
ElasticBody bodyOf(const Slab& slab, double h)
{
    const int across = static_cast<int>(std::lround(slab.width / h));
    const int deep = static_cast<int>(std::lround(slab.thickness / h + 1.0 - slab.full));
    const Index3 cells(across, deep + 1, across);
    const Vec3 low(-0.5 * slab.width, (slab.full - 1.0) * h, -0.5 * slab.width), top(low.x, 0.0, low.z);
    const volume::NodeGrid grid{cells + 2 * air, low + (0.5 - air) * h, h};
    std::vector<volume::CellMaterial> materials(grid.count());
    volume::DistanceField surface;
    surface.grid = grid;
    surface.values.resize(grid.count());
    volume::forEachIndex(Index3(0), grid.size - 1, [&](Index3 n) {
        const Index3 c = n - air;
        if (c == glm::clamp(c, Index3(0), cells - 1)) {
            const double full = c.y == 0 ? slab.full : 1.0;
            materials[grid.offset(n)] = {.youngsModulus = static_cast<float>(full * youngsModulus),
                                         .poissonRatio = static_cast<float>(slab.poissonRatio),
                                         .fraction = static_cast<float>(full),
                                         .fixed = c.y == deep ? 1.0F : 0.0F};
        }
        surface.values[grid.offset(n)] = static_cast<float>(boxDistance(grid.position(n), top, low + h * Vec3(cells)));
    });
    return elasticBody(grid, materials, surface, noCap);
}

constexpr Vec3 inward(0.0, 1.0, 0.0);

// Force of a rigid sphere that is pressed `depth` into the slab, `beside` its middle [N].
double sphereForce(const ElasticBody& body, double radius, double depth, Vec3 beside = Vec3(0.0))
{
    const Vec3 centre = beside + (depth - radius) * inward;
    ElasticTool tool;
    tool.shape = {centre, centre, radius, radius};
    tool.pushed = depth * inward;
    tool.stiffest = 1e6;
    const ElasticLoad load{{&tool, 1}, {}, {beside, inward, 0.0}};
    Elastic elastic(body, {.window = window, .maxSites = 1U << 16}, load.focus);
    elastic.relax(load, maxCycles, tight);
    return glm::length(elastic.toolForce(0));
}

// Force of ties without side stiffness at these points of the top, all pulled `depth` inward [N].
double tiesForce(const ElasticBody& body, std::span<const Vec3> points, double stiffness, double depth)
{
    const auto ties = base::mapped<Tie>(points, [&](const Vec3& p) {
        return Tie{p, depth * inward, inward, stiffness, 0.0};
    });
    const ElasticLoad load{{}, ties, {Vec3(0.0), inward, 0.0}};
    Elastic elastic(body, {.window = window, .maxSites = ties.size()}, load.focus);
    elastic.relax(load, maxCycles, tight);
    return glm::length(base::sumOf(
        std::views::iota(0UL, ties.size()), [&](auto i) { return elastic.tieForce(i); }, Vec3(0)));
}

// Middles of the top's cells within `radius` of the middle, each cut into `parts` x `parts`.
std::vector<Vec3> discPoints(double radius, double h, int parts)
{
    const double step = h / parts;
    const int reach = static_cast<int>(radius / step) + 1;
    std::vector<Vec3> points;
    for (int k = -reach; k < reach; ++k) {
        for (int i = -reach; i < reach; ++i) {
            const Vec3 p(step * (i + 0.5), 0.0, step * (k + 0.5));
            if (glm::length(p) <= radius) {
                points.push_back(p);
            }
        }
    }
    return points;
}

// Of an error that the halved spacing leaves.
double orderOf(double before, double now)
{
    constexpr double formsOwn = 1.0;  // what the closed forms leave out: free sides, higher orders [%]
    return std::abs(now) > formsOwn && std::abs(before) > formsOwn ? std::log2(std::abs(before / now)) : 0.0;
}

// A problem that is solved at every spacing.
struct Problem {
    const char* name;
    Slab slab;
    double closedForm = 0;  // [N]
    double bounds[3]{};     // at 2, 1 and 0.5 mm [%]
    const char* source;
    std::function<double(const ElasticBody&, double h)> force;
    bool firstOrder = false;  // the error is that of a disc's edge on a grid: it halves with the spacing
};

KernelVerification rowOf(const Problem& problem, const std::string& setting, double spacing, double force, double bound)
{
    KernelVerification row;
    row.problem = problem.name;
    row.quantity = "force [N]";
    row.setting = setting;
    row.spacing = spacing;
    row.ours = force;
    row.reference = problem.closedForm;
    row.errorPercent = 100.0 * (force / problem.closedForm - 1.0);
    row.bound = bound;
    row.source = problem.source;
    return row;
}

// All points of a square slab's top, of one stiffness: they share the force by their areas.
Problem patch()
{
    constexpr double side = 24e-3, depth = 0.5e-3, stiffness = 1000.0;
    const Slab slab{side, side, 0.0};
    // The ties are a spring in a row with the bar, E A / L.
    const double bar = youngsModulus * side;
    const auto force = [=](const ElasticBody& body, double h) {
        std::vector<Vec3> points = discPoints(side, h, 1);
        std::erase_if(points, [&](Vec3 p) { return std::max(std::abs(p.x), std::abs(p.z)) > 0.5 * side; });
        return tiesForce(body, points, stiffness / static_cast<double>(points.size()), depth);
    };
    return {
        "patch: bar under uniaxial stress, nu 0",           slab, depth / (1.0 / bar + 1.0 / stiffness), {0.1, 0.1, 0.1},
        "F = E A d / L, with the ties' stiffness in a row", force};
}

Problem sphere(const char* name, const Slab& slab, double radius, double depth, const char* source)
{
    const double chi = std::sqrt(radius * depth) / slab.thickness;
    return {name,
            slab,
            hertzForce(youngsModulus, slab.poissonRatio, radius, depth) * bondedLayerFactor(slab.poissonRatio, chi),
            {2.5, 1.5, 1.0},
            source,
            [=](const ElasticBody& body, double) { return sphereForce(body, radius, depth); }};
}

Problem punch(const char* name, const Slab& slab, double radius, double factor, const char* source)
{
    constexpr double depth = 0.2e-3;
    const auto force = [=](const ElasticBody& body, double h) {
        const auto points = discPoints(radius, h, 2);
        return tiesForce(body, points, 50.0 * youngsModulus * h, depth);
    };
    return {
        name,  slab, factor * flatPunchForce(youngsModulus, slab.poissonRatio, radius, depth), {20.0, 10.0, 5.0}, source,
        force, true};
}

constexpr Slab wide{160e-3, 64e-3, 0.45};  // its free sides make a sphere's force 0.3 % lower; 96 mm: 1.5 %

// A contact as small as the cells: the force depends on where it is in the grid.
struct FirstTouch {
    double cells = 0;                // its radius by Hertz
    double mean = 0.0, worst = 0.0;  // bounds of the error [%]
};

// What touches tissue of a Poisson's ratio whose surface lies on nodes, or cuts its cells.
struct FirstTouches {
    const char* where;
    double poissonRatio = 0;
    std::vector<double> full;  // Slab::full
    std::vector<FirstTouch> sizes;
};

// Two rows per size: the mean over the places of a cell, and the worst of them.
std::vector<KernelVerification> touchRows(const FirstTouches& touches,
                                          const std::function<void(const std::string&)>& progress)
{
    constexpr double h = 2e-3, radius = 20e-3;
    std::vector<Slab> slabs;
    for (const double full : touches.full) {
        slabs.push_back({wide.width, wide.thickness + (full < 1.0 ? full * h : 0.0), touches.poissonRatio, full});
    }
    const auto bodies = base::mapped<ElasticBody>(slabs, [](const Slab& s) { return bodyOf(s, h); });
    std::vector<KernelVerification> rows;
    for (const FirstTouch& t : touches.sizes) {
        const double depth = t.cells * h * t.cells * h / radius;
        const Problem problem = sphere("sphere that just touches a deep block", slabs.front(), radius, depth,
                                       "Hertz 1882, with the depth's factor of Dimitriadis et al. 2002");
        const std::string setting = fmt::format("2 mm, {}, a/h {:g}", touches.where, t.cells);
        progress(fmt::format("kernel: {}, {}", problem.name, setting));
        double mean = 0.0, worst = 1.0;  // of the closed form
        for (std::size_t i = 0; i < slabs.size(); ++i) {
            const double closed = sphere("", slabs[i], radius, depth, "").closedForm;
            for (const GridPlace& place : gridPlaces()) {
                const double force =
                    sphereForce(bodies[i], radius, depth, h * Vec3(place.across, 0.0, place.along)) / closed;
                mean += place.weight * force / 16.0 / static_cast<double>(slabs.size());
                worst = std::abs(force - 1.0) > std::abs(worst - 1.0) ? force : worst;
            }
        }
        rows.push_back(rowOf(problem, setting, h, mean * problem.closedForm, t.mean));
        rows.back().quantity = "mean force [N]";
        rows.push_back(rowOf(problem, setting, h, worst * problem.closedForm, t.worst));
        rows.back().quantity = "worst place [N]";
    }
    return rows;
}

std::vector<KernelVerification> touchRows(bool quick, const std::function<void(const std::string&)>& progress)
{
    const std::vector<FirstTouch> soft{{0.25, 3.0, 7.0}, {0.5, 2.0, 4.0}, {0.75, 2.0, 2.5},
                                       {1.0, 2.0, 2.0},  {1.5, 2.0, 2.0}, {2.0, 1.5, 2.5}};
    const std::vector<FirstTouch> compressible{{0.5, 3.0, 5.0}, {0.75, 3.0, 4.0}, {1.0, 3.0, 3.0}, {1.5, 3.0, 3.0}};
    const std::vector<double> onNodes{1.0}, cut = quick ? std::vector{0.5} : std::vector{0.75, 0.5, 0.25};
    std::vector<KernelVerification> rows;
    for (const FirstTouches& t : {FirstTouches{"surface on nodes", wide.poissonRatio, onNodes, soft},
                                  FirstTouches{"surface in its cells", wide.poissonRatio, cut, soft},
                                  FirstTouches{"the same, nu 0.2", 0.2, cut, compressible}}) {
        const auto own = touchRows(t, progress);
        rows.insert(rows.end(), own.begin(), own.end());
    }
    return rows;
}

std::vector<Problem> problems()
{
    constexpr double radius = 8e-3;
    const Slab deep{96e-3, 64e-3, 0.45}, soft{96e-3, 20e-3, 0.3}, stiff{96e-3, 20e-3, 0.45};
    return {patch(),
            sphere("sphere on a deep block (Hertz)", wide, 20e-3, 0.5e-3,
                   "Hertz 1882, with the depth's factor of Dimitriadis et al. 2002"),
            sphere("sphere on a thin layer, chi 0.25", stiff, 40e-3, 0.625e-3, "Dimitriadis et al. 2002"),
            punch("flat punch on a deep block", deep, 4e-3, deepPunchFactor(0.45, 4.0 / 64.0),
                  "Boussinesq 1885, with the depth's factor of first order"),
            punch("flat punch on a thin layer, nu 0.30, a/h 0.4", soft, radius, thinLayerPunchFactor(0.3, 0.4),
                  "Hayes et al. 1972, table"),
            punch("flat punch on a thin layer, nu 0.45, a/h 0.4", stiff, radius, thinLayerPunchFactor(0.45, 0.4),
                  "Hayes et al. 1972, table")};
}

}  // namespace

bool KernelVerification::holds() const noexcept
{
    return std::abs(errorPercent) <= bound;
}

std::vector<KernelVerification> verifyKernel(bool quick, const std::function<void(const std::string&)>& progress)
{
    constexpr std::array spacings{2e-3, 1e-3, 0.5e-3};
    std::vector<KernelVerification> rows;
    for (const Problem& problem : problems()) {
        std::vector<KernelVerification> own;
        for (std::size_t i = 0; i < spacings.size() - (quick ? 1 : 0); ++i) {
            const double h = spacings[i];
            const std::string setting = fmt::format("{:g} mm", 1e3 * h);
            progress(fmt::format("kernel: {}, {}", problem.name, setting));
            own.push_back(rowOf(problem, setting, h, problem.force(bodyOf(problem.slab, h), h), problem.bounds[i]));
            own.back().order = i > 0 ? orderOf(own[i - 1].errorPercent, own[i].errorPercent) : 0.0;
        }
        if (problem.firstOrder) {
            const double limit = 2.0 * own.back().ours - own[own.size() - 2].ours;
            own.push_back(rowOf(problem, "extrapolated to 0 mm", 0.0, limit, 0.5 * own.back().bound));
        }
        rows.insert(rows.end(), own.begin(), own.end());
    }
    const auto touches = touchRows(quick, progress);
    rows.insert(rows.end(), touches.begin(), touches.end());
    return rows;
}

}  // namespace palpate::studies
