#include <studies/kernel/kernel_trial.h>

#include <base/folds.h>
#include <base/mapped.h>
#include <base/processor_time.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <time.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numeric>
#include <ranges>
#include <utility>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr int wholeWindow = 1023;  // nodes along each side: more than any level has

// Nodes of the finest level that are tissue and free, by z, then y, then x.
std::vector<Index3> freeNodes(const CellLevel& level)
{
    std::vector<Index3> out;
    volume::forEachIndex(Index3(0), level.nodes.size - 1, [&](Index3 n) {
        const std::size_t at = level.nodes.offset(n);
        if (level.diagonal[at] > 0.0F && level.fixed[at] == 0) {
            out.push_back(n);
        }
    });
    return out;
}

Mat3 gradientIn(const Elastic& elastic, const volume::NodeGrid& grid, Index3 cell)
{
    std::array<Vec3, 8> u;
    for (int c = 0; c < 8; ++c) {
        u[static_cast<std::size_t>(c)] = elastic.displacement(grid.position(cell + Index3(c & 1, (c >> 1) & 1, c >> 2)));
    }
    return meanGradient(u, grid.spacing);
}

// ReferenceState::strain, in the near field.
double localStrain(const Elastic& elastic, Vec3 focus)
{
    const CellLevel& level = elastic.stack().body().levels.front();
    const auto& grid = level.nodes;
    const Vec3 last(grid.size - 2);
    const Index3 low(glm::clamp(glm::floor((focus - nearField - grid.origin) / grid.spacing), Vec3(0.0), last));
    const Index3 high(glm::clamp(glm::floor((focus + nearField - grid.origin) / grid.spacing), Vec3(0.0), last));
    std::vector<double> strains;
    volume::forEachIndex(low, high, [&](Index3 cell) {
        if (level.mu[grid.offset(cell)] > 0.0F) {
            strains.push_back(equivalentStrain(gradientIn(elastic, grid, cell)));
        }
    });
    return exceededStrain(std::move(strains), grid.spacing);
}

Vec3 forceOn(const Elastic& elastic, const TrialPath& path)
{
    if (path.ties.empty()) {
        return elastic.toolForce(0);
    }
    return base::sumOf(
        std::views::iota(0UL, path.ties.size()), [&](auto i) { return elastic.tieForce(i); }, Vec3(0.0));
}

double contactForces(const Elastic& elastic)
{
    return base::sumOf(elastic.sites(), [](const ContactSite& s) { return static_cast<double>(glm::length(s.force)); });
}

// From rest, or, where the energy may have more than one minimum, from the state before.
double converge(Elastic& elastic, const ElasticLoad& load, const ReferenceOptions& options, ElasticResult& result)
{
    if (volume::isSmall(options.law)) {
        ElasticLoad none;
        none.focus = load.focus;
        elastic.relax(none, 0, 0.0);
    }
    result = elastic.relax(load, options.maxCycles, options.tolerance);
    return shareLeft(elastic, result);
}

std::vector<TrialPose> looksOf(const TrialPath& path, std::span<const double> speeds)
{
    std::vector<TrialPose> poses;
    for (const double speed : speeds) {
        for (const TrialTick& t : schedule(path, speed)) {
            if (t.look) {
                poses.push_back(t.pose);
            }
        }
    }
    const auto order = [](const TrialPose& p) { return std::pair(p.dragged, p.pressed); };
    std::ranges::sort(poses, {}, order);
    poses.erase(std::unique(poses.begin(), poses.end()), poses.end());
    return poses;
}

ReferenceState stateOf(const Elastic& elastic, const TrialLoad& load, std::span<const Vec3f> position)
{
    ReferenceState state;
    state.pose = load.pose();
    state.focus = load.load().focus.point;
    state.u.reserve(position.size());
    for (const Vec3f& p : position) {
        state.u.emplace_back(elastic.displacement(Vec3(p)));
        state.largest = std::max(state.largest, static_cast<double>(glm::length(state.u.back())));
    }
    state.force = forceOn(elastic, load.path());
    state.sites = static_cast<std::uint32_t>(elastic.sites().size());
    state.strain = localStrain(elastic, state.focus);
    return state;
}

double meanOf(std::span<const double> values)
{
    return std::accumulate(values.begin(), values.end(), 0.0) /
           static_cast<double>(std::max<std::size_t>(values.size(), 1));
}

// Follows a path with a model, and counts and times its ticks in contact.
class TrialRun {
public:
    TrialRun(const TrialModel& model, const TrialPath& path) : model_(model), load_(path) {}

    ElasticResult tick(const TrialTick& t)
    {
        using Clock = std::chrono::steady_clock;
        load_.set(t.pose);
        const auto start = Clock::now();
        const double cpuStart = base::processorTime();
        const ElasticResult result = model_.tick(load_);
        const double cpu = base::processorTime() - cpuStart;
        const double took = std::chrono::duration<double>(Clock::now() - start).count();
        const std::size_t touched = model_.touched();
        if (touched > 0) {
            ++out_.ticks;
            out_.meanTouched += static_cast<double>(touched);
            out_.meanCycles += result.cycles;
            out_.shortened += result.shortened;
            out_.windowMoves += result.moved ? 1 : 0;
        }
        if (touched > 0 && !cold_) {
            seconds_.push_back(took);
            cpuSeconds_.push_back(cpu);
        }
        cold_ = t.look;
        return result;
    }

    TrialResult finish()
    {
        const auto ticks = static_cast<double>(std::max<std::size_t>(out_.ticks, 1));
        out_.meanTouched /= ticks;
        out_.meanCycles /= ticks;
        out_.mean = meanOf(seconds_);
        out_.cpu = meanOf(cpuSeconds_);
        const TickTimes times = tickTimes(std::move(seconds_));
        out_.p50 = times.p50;
        out_.p99 = times.p99;
        return std::move(out_);
    }

private:
    const TrialModel& model_;
    TrialLoad load_;
    TrialResult out_;
    std::vector<double> seconds_, cpuSeconds_;
    bool cold_ = true;  // a look at the errors leaves other things in the caches
};

TrialErrors look(const TrialModel& model, const Reference& reference, const PositionCells& cells, const TrialTick& t,
                 const ElasticResult& result)
{
    const ReferenceState& state = stateAt(reference, t.pose);
    auto u = base::mapped<Vec3>(reference.position, [&](const Vec3f& p) { return model.displacement(Vec3(p)); });
    const auto force = model.force ? std::optional(model.force()) : std::nullopt;
    TrialErrors errors = errorsOf(u, force, reference, cells, state);
    errors.phase = t.phase;
    errors.energy = state.energy > 0.0 ? 100.0 * (result.energy / state.energy - 1.0) : 0.0;
    return errors;
}

}  // namespace

Vec3 nearestTissue(const CellLevel& level, Vec3 rest)
{
    const auto& grid = level.nodes;
    const Vec3 at = (rest - grid.origin) / grid.spacing;
    const Index3 own(glm::floor(at));
    const auto isTissue = [&](Index3 c) { return grid.contains(c) && level.mu[grid.offset(c)] > 0.0F; };
    if (isTissue(own)) {
        return rest;
    }
    Vec3 nearest = at;
    double least = std::numeric_limits<double>::max();
    volume::forEachIndex(own - 1, own + 1, [&](Index3 c) {
        const Vec3 p = glm::clamp(at, Vec3(c), Vec3(c + 1));
        if (const double d = glm::distance(p, at); d < least && isTissue(c)) {
            least = d;
            nearest = p;
        }
    });
    return grid.origin + grid.spacing * nearest;
}

double shareLeft(const Elastic& elastic, const ElasticResult& result)
{
    const double force = contactForces(elastic);
    return force > 0.0 ? result.residual / force : 0.0;
}

ElasticOptions wholeGrid(int cycles, const volume::Law& law)
{
    return {.window = wholeWindow, .cycles = cycles, .law = law};
}

Reference solveReference(const ElasticBody& body, const TrialPath& path, std::span<const double> speeds,
                         const ReferenceOptions& options)
{
    Reference reference;
    const auto& level = body.levels.front();
    const std::vector<Index3> nodes = freeNodes(level);
    const std::size_t stride = nodes.size() / options.maxPoints + 1;
    for (std::size_t i = 0; i < nodes.size(); i += stride) {
        reference.position.emplace_back(level.nodes.position(nodes[i]));
    }
    TrialLoad load(path);
    Elastic elastic(body, wholeGrid(1, options.law), load.load().focus);
    reference.nodes = elastic.nodes();
    const auto looks = looksOf(path, speeds);
    for (const TrialPose& pose : looks) {
        if (options.progress) {
            options.progress(reference.states.size() + 1, looks.size());
        }
        load.set(pose);
        ElasticResult result;
        const double residual = converge(elastic, load.load(), options, result);
        reference.states.push_back(stateOf(elastic, load, reference.position));
        ReferenceState& state = reference.states.back();
        state.energy = result.energy;
        state.residual = residual;
        reference.peakForce = std::max(reference.peakForce, glm::length(state.force));
        reference.strain = std::max(reference.strain, state.strain);
        reference.residual = std::max(reference.residual, residual);
    }
    return reference;
}

TrialModel elasticModel(Elastic& elastic)
{
    // The load's path lives as long as the load: what it says of ties is asked for after the tick.
    auto path = std::make_shared<const TrialPath*>(nullptr);
    return {[&elastic, path](const TrialLoad& load) {
                *path = &load.path();
                return elastic.relax(load.load());
            },
            [&elastic](Vec3 rest) { return elastic.displacement(nearestTissue(elastic.body().levels.front(), rest)); },
            [&elastic, path] { return *path != nullptr ? forceOn(elastic, **path) : Vec3(0.0); },
            [&elastic] { return elastic.sites().size(); }};
}

TrialModel nothingModel()
{
    return {[](const TrialLoad&) { return ElasticResult{}; }, [](Vec3) { return Vec3(0.0); }, {}, [] { return 1; }};
}

std::vector<TrialResult> runTrials(const TrialModel& model, const TrialPath& path, double speed,
                                   std::span<const Reference* const> references)
{
    const auto cells = base::mapped<PositionCells>(
        references, [&](const Reference* reference) { return positionCells(reference->position); });
    std::vector<std::vector<TrialErrors>> looks(references.size());
    TrialRun run(model, path);
    for (const TrialTick& t : schedule(path, speed)) {
        const ElasticResult result = run.tick(t);
        for (std::size_t i = 0; t.look && i < references.size(); ++i) {
            looks[i].push_back(look(model, *references[i], cells[i], t, result));
        }
    }
    std::vector<TrialResult> out(references.size(), run.finish());
    for (std::size_t i = 0; i < out.size(); ++i) {
        out[i].looks = std::move(looks[i]);
    }
    return out;
}

TrialResult runTrial(const TrialModel& model, const TrialPath& path, double speed, const Reference& reference)
{
    const std::array references{&reference};
    return std::move(runTrials(model, path, speed, references).front());
}

TrialResult timeTrial(const TrialModel& model, const TrialPath& path, double speed)
{
    TrialRun run(model, path);
    for (const TrialTick& t : schedule(path, speed)) {
        run.tick(t);
    }
    return run.finish();
}

Spread spreadOf(std::span<const TrialErrors> looks, double TrialErrors::*figure)
{
    std::vector<double> values;
    Spread spread;
    for (const TrialErrors& look : looks) {
        const double value = look.*figure;
        values.push_back(value);
        const bool worse = std::isnan(value) || std::abs(value) > std::abs(spread.worst);
        spread.worst = worse ? value : spread.worst;
    }
    spread.median = median(std::move(values));
    return spread;
}

TrialErrors atRest(const TrialResult& result)
{
    return result.looks.empty() ? TrialErrors{} : result.looks.back();
}

double median(std::vector<double> values)
{
    if (values.empty()) {
        return 0.0;
    }
    if (std::ranges::any_of(values, [](double v) { return std::isnan(v); })) {
        return std::numeric_limits<double>::quiet_NaN();
    }
    std::ranges::sort(values);
    const std::size_t n = values.size();
    return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

TickTimes tickTimes(std::vector<double> seconds)
{
    if (seconds.empty()) {
        return {};
    }
    std::ranges::sort(seconds);
    return {seconds[seconds.size() / 2], seconds[seconds.size() * 99 / 100], seconds.back()};
}

FullSolve fullSolve(const ElasticBody& body, const TrialPath& path, double speed, const volume::Law& law)
{
    using Clock = std::chrono::steady_clock;
    constexpr int few = 5;
    constexpr double thousandth = 1e-3;
    constexpr int enough = 200;
    TrialLoad load(path);
    Elastic elastic(body, wholeGrid(1, law), load.load().focus);
    const double step = speed * 1e-3;
    const auto solve = [&](int tick) {
        load.set({0.6 * path.press + tick * step, 0.0});
        const auto start = Clock::now();
        elastic.relax(load.load(), enough, thousandth);
        return std::chrono::duration<double>(Clock::now() - start).count();
    };
    FullSolve times;
    times.fromRest = solve(-2);
    solve(-1);
    solve(0);  // from here on there is an increment to go on from
    const auto seconds = base::mapped<double>(std::views::iota(1, few + 1), solve);
    times.warm = median(seconds);
    return times;
}

}  // namespace palpate::studies
