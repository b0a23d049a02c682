#include <planner/tick_costs.h>

#include <base/error.h>
#include <studies/kernel/kernel_rivals.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace palpate::planner {

namespace {

constexpr std::size_t maxSlots = 200000;  // beyond any tick of a millisecond
constexpr double speed = 0.02;            // [m/s]
constexpr double poissonCap = 0.49;
constexpr double nanosecond = 1e-3;  // [us]

using Terms = std::array<double, 4>;

Terms termsOf(const TickWork& w) noexcept
{
    return {w.slots, w.slots * w.cycles, w.contacts, w.contacts * w.cycles};
}

TickSample timed(const chainmail::ElasticBody& body, const studies::TrialPath& path,
                 const chainmail::ElasticOptions& options)
{
    studies::TrialLoad load(path);
    chainmail::Elastic elastic(body, options, load.load().focus);
    const studies::TrialResult result = studies::timeTrial(studies::elasticModel(elastic), path, speed);
    TickSample sample;
    sample.work = {static_cast<double>(slotsOf(elastic.stack())), result.meanCycles, result.meanTouched};
    sample.finite = !volume::isSmall(options.law);
    sample.microseconds = 1e6 * result.cpu;
    return sample;
}

// Every window and law on one body and path.
void addTimes(const studies::TrialBody& body, const studies::TrialPath& path, bool quick, std::vector<TickSample>& out)
{
    const std::vector<int> windows = quick ? std::vector{9, 13} : std::vector{9, 13, 15, 21, 31};
    for (const int window : windows) {
        const chainmail::WindowStack stack(body.body, window, studies::TrialLoad(path).load().focus);
        if (slotsOf(stack) > maxSlots) {
            continue;
        }
        for (const auto& [cycles, finite] : {std::pair(1, false), {2, false}, {1, true}, {2, true}}) {
            const volume::Law law = finite ? volume::finiteOf({}) : volume::Law();
            out.push_back(timed(body.body, path, {.window = window, .cycles = cycles, .law = law}));
            out.back().name =
                fmt::format("{:g} mm, window {}, {} cycle{}{}, sphere {:g} mm", 1e3 * body.cells.spacing, window, cycles,
                            cycles == 1 ? "" : "s", finite ? ", finite strain" : "", 1e3 * path.tool.radius);
        }
    }
}

}  // namespace

double tickTime(const LawCosts& costs, const TickWork& work) noexcept
{
    return nanosecond * (work.slots * (costs.perSlot + work.cycles * costs.perSlotCycle) +
                         work.contacts * (costs.perContact + work.cycles * costs.perContactCycle));
}

LawCosts fitCosts(std::span<const TickSample> samples)
{
    constexpr int sweeps = 20000;
    constexpr std::size_t n = std::tuple_size_v<Terms>;
    base::failIf(samples.size() < n, "costs of a tick: {} samples, at least {} are needed", samples.size(), n);
    // Normal equations of the relative errors, by projected coordinate descent: convex, so that it ends at the minimum.
    std::array<Terms, n> a{};
    Terms b{};
    for (const TickSample& s : samples) {
        Terms t = termsOf(s.work);
        for (std::size_t i = 0; i < n; ++i) {
            t[i] *= nanosecond / s.microseconds;
        }
        for (std::size_t i = 0; i < n; ++i) {
            b[i] += t[i];
            for (std::size_t j = 0; j < n; ++j) {
                a[i][j] += t[i] * t[j];
            }
        }
    }
    Terms x{};
    for (int s = 0; s < sweeps; ++s) {
        for (std::size_t i = 0; i < n; ++i) {
            double rest = b[i] + a[i][i] * x[i];
            for (std::size_t j = 0; j < n; ++j) {
                rest -= a[i][j] * x[j];
            }
            x[i] = a[i][i] > 0.0 ? std::max(0.0, rest / a[i][i]) : 0.0;
        }
    }
    return {x[0], x[1], x[2], x[3]};
}

std::size_t slotsOf(const chainmail::WindowStack& stack) noexcept
{
    std::size_t sum = 0;
    for (const chainmail::Window& w : stack.windows()) {
        sum += w.layout.count;
    }
    return sum;
}

std::vector<TickSample> measureTicks(const haptics::SessionModel& model, bool quick,
                                     const std::function<void(const std::string&)>& progress)
{
    const std::vector<double> spacings = quick ? std::vector{4e-3, 3e-3} : std::vector{4e-3, 3e-3, 2e-3, 1.5e-3, 1e-3};
    const auto place = studies::trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    std::vector<TickSample> out;
    for (const double spacing : spacings) {
        const studies::TrialBody body =
            studies::trialBody(*model.tissue, model.surface, spacing, poissonCap, studies::maxTrialNodes);
        for (const double radius : {5e-3, 10e-3}) {
            progress(fmt::format("{:g} mm, sphere of {:g} mm", 1e3 * body.cells.spacing, 1e3 * radius));
            const studies::TrialPath path =
                studies::trialPath(*model.tissue, model.surface, place, {"sphere", studies::TrialKind::sphere, radius, 0.0},
                                   body.cells.spacing);
            addTimes(body, path, quick, out);
        }
    }
    return out;
}

}  // namespace palpate::planner
