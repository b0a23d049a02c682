#include <studies/accuracy/deep_press.h>

#include <base/error.h>
#include <base/processor_time.h>
#include <chainmail/elastic.h>
#include <haptics/simulation.h>
#include <studies/kernel/kernel_rivals.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr int holdTicks = 200;

constexpr std::array<GridPlace, 6> sixPlaces{
    {{0.0, 0.0, 1}, {0.25, 0.0, 4}, {0.5, 0.0, 2}, {0.25, 0.25, 4}, {0.5, 0.25, 4}, {0.5, 0.5, 1}}};

// The force of every tick, by depth.
struct Felt {
    PressWay way;
    double depth;  // below the first touch; negative above it [m]
    Vec3 force;    // [N]
};

// In, hold, out.
std::vector<std::pair<PressWay, double>> wayOf(const TrialPath& path, double speed)
{
    const int in = std::max(1, static_cast<int>(std::lround(path.press / (speed * haptics::tickSeconds))));
    std::vector<std::pair<PressWay, double>> pressed;
    for (int t = 1; t <= in; ++t) {
        pressed.emplace_back(PressWay::in, path.press * t / in);
    }
    pressed.insert(pressed.end(), holdTicks, {PressWay::hold, path.press});
    for (int t = in; t >= 0; --t) {
        pressed.emplace_back(PressWay::out, path.press * t / in);
    }
    return pressed;
}

std::vector<Felt> feel(Elastic& elastic, const TrialPath& path, double speed, DeepPress& out, std::vector<double>& seconds)
{
    std::vector<Felt> felt;
    TrialLoad load(path);
    for (const auto& [way, pressed] : wayOf(path, speed)) {
        load.set({pressed, 0.0});
        const double start = base::processorTime();
        elastic.relax(load.load());
        const double took = base::processorTime() - start;
        const Vec3 force = elastic.toolForce(0);
        base::failIf(!std::isfinite(glm::length(force)), "the force {:.2f} mm below the surface is no number",
                     1e3 * (pressed - path.gap));
        if (!elastic.atRest()) {
            seconds.push_back(took);
        }
        out.pull = std::max(out.pull, glm::dot(force, path.inward));
        felt.push_back({way, pressed - path.gap, force});
    }
    return felt;
}

// Where this part of the way passes a depth.
Vec3 forceAt(std::span<const Felt> felt, PressWay way, double depth)
{
    constexpr double rounding = 1e-9;  // [m]
    const Felt* before = nullptr;
    for (const Felt& f : felt) {
        if (f.way != way) {
            continue;
        }
        if (std::abs(f.depth - depth) < rounding) {
            return f.force;
        }
        if (before != nullptr && (before->depth - depth) * (f.depth - depth) < 0.0) {
            const double fraction = (depth - before->depth) / (f.depth - before->depth);
            return (1.0 - fraction) * before->force + fraction * f.force;
        }
        before = &f;
    }
    return before != nullptr ? before->force : Vec3(0.0);
}

void addLooks(std::span<const Felt> felt, const DeepCase& what, std::size_t place, DeepPress& out)
{
    const auto add = [&](PressWay way, const DeepReference& r) {
        const Vec3 force = way == PressWay::hold ? std::ranges::find(felt.rbegin(), felt.rend(), way, &Felt::way)->force
                                                 : forceAt(felt, way, r.depth);
        out.looks.push_back({place, way, r.depth, force, r.force, r.edges});
    };
    for (const DeepReference& r : what.references) {
        add(r.way, r);
        if (r.way == PressWay::out) {
            continue;
        }
        const bool own = std::ranges::any_of(what.references, [&](const DeepReference& other) {
            return other.way == PressWay::out && other.depth == r.depth;
        });
        if (r.depth == what.deepest()) {
            add(PressWay::hold, r);
        } else if (!own) {
            add(PressWay::out, r);
        }
    }
}

}  // namespace

std::span<const GridPlace> gridPlaces() noexcept
{
    return sixPlaces;
}

double DeepLook::errorPercent() const noexcept
{
    return 100.0 * (glm::length(force) / glm::length(reference) - 1.0);
}

double DeepLook::directionDegrees() const noexcept
{
    const double across = glm::length(glm::cross(force, reference)), along = glm::dot(force, reference);
    return std::atan2(across, along) * 180.0 / std::numbers::pi;
}

DeepZone zoneOf(double depth, double radius, double spacing) noexcept
{
    constexpr double half = 0.5, most = 1.5, rounding = 1e-9;
    const double cells = std::sqrt(radius * depth) / spacing, radii = depth / radius;
    if (cells < half) {
        return DeepZone::faint;
    }
    if (radii > most + rounding) {
        return DeepZone::deepest;
    }
    if (radii > 1.0 + rounding) {
        return DeepZone::deep;
    }
    return cells <= most ? DeepZone::touch : DeepZone::middle;
}

DeepPress pressDeep(const haptics::SessionModel& model, const DeepCase& what, const datasets::ElasticSettings& settings,
                    const DeepOptions& options)
{
    DeepPress out;
    std::vector<double> seconds;
    const TrialPlace entry = trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    for (std::size_t i = 0; i < options.places.size(); ++i) {
        const GridPlace& at = options.places[i];
        const TrialBody body = trialBody(*model.tissue, model.surface, settings.spacing, settings.poissonCap, maxTrialNodes,
                                         Vec3(at.across, 0.0, at.along));
        out.spacing = body.cells.spacing;
        TrialPath path = trialPath(*model.tissue, model.surface, entry, what.tool, out.spacing);
        path.press = path.gap + what.deepest();
        path.drag = 0.0;
        Elastic elastic(body.body, haptics::elasticOptions(settings), TrialLoad(path).load().focus);
        addLooks(feel(elastic, path, options.speed, out, seconds), what, i, out);
    }
    out.ticks = seconds.size();
    out.times = tickTimes(std::move(seconds));
    return out;
}

}  // namespace palpate::studies
