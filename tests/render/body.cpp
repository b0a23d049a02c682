#include <tests/render/body.h>

#include <render/deformation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

namespace palpate::render {
namespace {

enum Row : std::uint8_t { air, skin, fat, gland, artery, tumour };

constexpr double bodyRadius = 45e-3, skinThickness = 2e-3, glandRadius = 30e-3, arteryRadius = 2.5e-3, tumourRadius = 8e-3;
constexpr glm::dvec3 tumourCentre{8e-3, -6e-3, 0};
constexpr glm::dvec3 entryPoint{-14e-3, -42.77e-3, 0};

// The artery runs along z beside the planned line.
double arteryDistance(glm::dvec3 p)
{
    return std::hypot(p.x - 6e-3, p.y + 22e-3) - arteryRadius;
}

double tumourDistance(glm::dvec3 p)
{
    return glm::distance(p, tumourCentre) - tumourRadius;
}

glm::dvec3 planAxis()
{
    return glm::normalize(tumourCentre - entryPoint);
}

double fraction(double t, double from, double to)
{
    return std::clamp((t - from) / (to - from), 0.0, 1.0);
}

// Way of the tip along the planned line, 0 at the entry [m].
double wayAt(double t)
{
    constexpr double start = -25e-3, pressed = 9e-3;
    const double reach = glm::distance(entryPoint, tumourCentre);
    if (t < contactAt)
        return start * (1 - fraction(t, 0, contactAt));
    if (t < punctureAt)
        return pressed * fraction(t, contactAt, punctureAt);
    return pressed + (reach - pressed) * fraction(t, punctureAt, arrivalAt);
}

}  // namespace

channel::Name named(const std::string& words)
{
    channel::Name name{};
    std::strncpy(name.data(), words.c_str(), name.size() - 1);
    return name;
}

channel::Scenery bodyScenery(int voxels, double spacing)
{
    channel::Scenery s;
    s.scene = named("test body");
    const double half = 0.5 * (voxels - 1) * spacing;
    s.labels = {{voxels, voxels, voxels}, 0, {-half, -half, -half}, spacing};
    constexpr double nodes = 2.5e-3;
    const auto side = static_cast<std::int32_t>(std::ceil(2 * half / nodes)) + 1;
    s.lattice = {{side, side, side}, 0, {-half, -half, -half}, nodes};
    s.tissue[skin] = {named("skin"), {0.90F, 0.68F, 0.56F}, 0.35F};
    s.tissue[fat] = {named("fat"), {0.95F, 0.85F, 0.50F}, 0.04F};
    s.tissue[gland] = {named("gland"), {0.85F, 0.52F, 0.52F}, 0.10F};
    s.tissue[artery] = {named("artery"), {0.85F, 0.10F, 0.10F}, 0.90F};
    s.tissue[tumour] = {named("tumour"), {0.55F, 0.25F, 0.75F}, 0.90F};
    s.tissues = 6;
    s.structure[0] = named("tumour");
    s.structure[1] = named("artery");
    s.structures = 2;
    s.warnDistance[1] = 8e-3;
    s.toolRadius = 1.05e-3;
    s.toolLength = 0.12;
    s.entry = {entryPoint.x, entryPoint.y, entryPoint.z};
    s.aim = {tumourCentre.x, tumourCentre.y, tumourCentre.z};
    s.forceCap = 8.5;
    return s;
}

std::vector<std::uint8_t> bodyLabels(const channel::Scenery& scenery)
{
    const channel::Grid& grid = scenery.labels;
    std::vector<std::uint8_t> labels;
    for (int z = 0; z < grid.size[2]; ++z)
        for (int y = 0; y < grid.size[1]; ++y)
            for (int x = 0; x < grid.size[0]; ++x) {
                const glm::dvec3 p = vec(grid.origin) + grid.spacing * glm::dvec3(x, y, z);
                const double r = glm::length(p);
                const Row row = r > bodyRadius                   ? air
                                : r > bodyRadius - skinThickness ? skin
                                : tumourDistance(p) < 0          ? tumour
                                : arteryDistance(p) < 0          ? artery
                                : r < glandRadius                ? gland
                                                                 : fat;
                const bool shell = std::abs(arteryDistance(p) - scenery.warnDistance[1]) < 0.5 * grid.spacing;
                labels.push_back(row != air && shell ? row | channel::shellBit : row);
            }
    return labels;
}

std::vector<std::uint16_t> bodyImage(channel::Scenery& scenery)
{
    const channel::Grid& grid = scenery.labels;
    constexpr double most = 1000, codes = 65535;
    scenery.windows = 2;
    scenery.window[0] = {named("all"), 0, most};
    scenery.window[1] = {named("upper half"), most / 2, most};
    scenery.imageUnit = named("HU");
    scenery.imageStep = most / codes;
    std::vector<std::uint16_t> image;
    for (int i = 0; i < grid.size[0] * grid.size[1] * grid.size[2]; ++i)
        image.push_back(static_cast<std::uint16_t>(std::lround(codes * (i % grid.size[0]) / (grid.size[0] - 1))));
    return image;
}

channel::State storyState(const channel::Scenery& scenery, double t)
{
    const glm::dvec3 axis = planAxis(), tip = entryPoint + wayAt(t) * axis;
    channel::State s;
    s.tick = static_cast<std::uint64_t>(std::llround(t * 1000)) + 1;
    s.time = t;
    s.tip = {tip.x, tip.y, tip.z};
    s.axis = {axis.x, axis.y, axis.z};
    s.phase = t < contactAt ? channel::Phase::free : t < punctureAt ? channel::Phase::contact : channel::Phase::inserted;
    s.proxy = s.phase == channel::Phase::contact ? scenery.entry : s.tip;
    const double force = s.phase == channel::Phase::contact ? 4.5 * fraction(t, contactAt, punctureAt)
                         : t < punctureAt                   ? 0.0
                                                            : 1.2 + 1.4 * fraction(t, punctureAt, arrivalAt);
    s.distance[0] = tumourDistance(tip);
    s.distance[1] = arteryDistance(tip);
    const double guide = std::max(0.0, 1 - s.distance[1] / 12e-3);
    s.basic = {-force * axis.x, -force * axis.y, 0};
    s.additional = {-guide, 0.3 * guide, 0};
    for (std::size_t k = 0; k < 3; ++k)
        s.total[k] = s.basic[k] + s.additional[k];
    s.warning = s.distance[1] < scenery.warnDistance[1] ? channel::Warning::near : channel::Warning::none;
    s.warned = 1;
    s.tissue = s.phase != channel::Phase::inserted ? air
               : s.distance[0] < 0                 ? tumour
               : glm::length(tip) < glandRadius    ? gland
                                                   : fat;
    s.inserted = s.phase == channel::Phase::inserted ? wayAt(t) : 0;
    constexpr double curvature = 2.5;  // [1/m]
    const double bend = 0.5 * curvature * s.inserted * s.inserted;
    s.bend = {axis.y * bend, -axis.x * bend, 0};
    s.ahead[0] = tumourDistance(tip);
    s.ahead[1] = std::numeric_limits<double>::infinity();
    s.aheadSpeed = t > punctureAt && t < arrivalAt ? 20e-3 : 0;
    s.cores = t >= fireAt ? 1 : 0;
    s.coreTarget = s.bestTarget = t >= fireAt ? 0.83 : 0;
    s.bestCore = s.cores;
    s.coreLength = t >= fireAt ? 14.2e-3 : 0;
    s.tickP99 = 312e-6;
    s.status = t >= storySeconds ? channel::Status::finished : channel::Status::running;
    return s;
}

void storyDisplaced(const channel::Scenery& scenery, double t, channel::Displaced& out)
{
    const glm::dvec3 axis = planAxis();
    const double pressed = 9e-3 * fraction(t, contactAt, punctureAt);
    const double depth = t < punctureAt ? pressed : 9e-3 - 6e-3 * fraction(t, punctureAt, punctureAt + 0.2);
    constexpr double width = 9e-3, least = 5e-5;
    out.count = 0;
    for (std::uint32_t n = 0; depth > 0; ++n) {
        const auto side = static_cast<std::uint32_t>(scenery.lattice.size[0]);
        if (n >= side * side * side)
            break;
        const glm::dvec3 p =
            vec(scenery.lattice.origin) + scenery.lattice.spacing * glm::dvec3(n % side, n / side % side, n / side / side);
        const glm::dvec3 off = p - entryPoint;
        const double length = depth * std::exp(-glm::dot(off, off) / (2 * width * width));
        if (length < least || glm::length(p) > bodyRadius || out.count >= channel::maxDisplaced)
            continue;
        const glm::vec3 u(length * axis);
        out.nodes[out.count++] = {n, {u.x, u.y, u.z}};
    }
    out.tick = static_cast<std::uint64_t>(std::llround(t * 1000)) + 1;
}

void waveDisplaced(const channel::Scenery& scenery, double t, double amplitude, channel::Displaced& out)
{
    const auto side = static_cast<std::uint32_t>(scenery.lattice.size[0]);
    out.count = std::min<std::uint32_t>(side * side * side, channel::maxDisplaced);
    for (std::uint32_t n = 0; n < out.count; ++n) {
        const double x = 20 * scenery.lattice.spacing * static_cast<double>(n % side);
        out.nodes[n] = {n, {0, static_cast<float>(amplitude * std::sin(20 * x + 6 * t)), 1e-5F}};
    }
    out.tick = static_cast<std::uint64_t>(std::llround(t * 1000)) + 1;
}

}  // namespace palpate::render
