#include <planner/planner.h>

#include <base/error.h>
#include <base/folds.h>
#include <studies/kernel/kernel_rivals.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace palpate::planner {

using datasets::ElasticSettings;
using datasets::ModelLevel;

namespace {

// The ladder. Windows fill whole vectors: a row of 15 or 31 nodes takes as long as one of 16 or 32.
constexpr std::array spacings{4e-3, 3e-3, 2e-3, 1.5e-3, 1e-3};
constexpr std::array windows{9, 13, 15, 21, 31};
constexpr std::array cycles{1, 2};
constexpr std::size_t maxReferenceCells = 400000;  // both references take some seconds
constexpr std::size_t maxWindowNodes = 300000;     // no budget under 5 ms pays for more
constexpr std::size_t maxPoints = 60000;           // at which errors are looked at
// What a candidate is taken to need before it is tried, of the least that any of its kind has needed: no more than it will,
// so that none is passed over. Cells of half the size have more contacts, and a needle has one and needs half a cycle.
constexpr double expectedShare = 0.5;

studies::TrialTool sceneTool(const datasets::ToolSpec& tool)
{
    switch (tool.kind) {
        case datasets::ToolKind::sphere:
            return {"sphere", studies::TrialKind::sphere, tool.radius, 0.0};
        case datasets::ToolKind::capsule:
            return {"capsule", studies::TrialKind::capsule, tool.radius, tool.length};
        default:
            return {"needle", studies::TrialKind::needle, 0.0, 0.0};
    }
}

class Planner {
public:
    Planner(const haptics::SessionModel& model, const PlanRequest& request,
            const std::function<void(const std::string&)>& progress)
        : model_(model),
          request_(request),
          progress_(progress),
          place_(studies::trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim))
    {
    }

    Plan run()
    {
        solve();
        collect();
        std::size_t tried = 0;
        while (const auto next = mayBeCheapest()) {
            PlanCandidate& c = plan_.candidates[*next];
            progress_(fmt::format("{} of {}: {}", ++tried, plan_.candidates.size(), c.name()));
            attempt(c);
            expectAtLeast(c);
        }
        std::ranges::stable_sort(plan_.candidates, {}, &PlanCandidate::microseconds);
        plan_.choice = cheapest();
        findNearest();
        return std::move(plan_);
    }

private:
    // The cheapest that holds both.
    std::optional<std::size_t> cheapest() const
    {
        std::optional<std::size_t> best;
        for (std::size_t i = 0; i < plan_.candidates.size(); ++i) {
            const PlanCandidate& c = plan_.candidates[i];
            if (c.holdsError && c.holdsBudget && (!best || c.microseconds < plan_.candidates[*best].microseconds)) {
                best = i;
            }
        }
        return best;
    }

    // The one to try next; nothing when the rest cannot be cheaper than the best so far, or is over the budget for certain.
    std::optional<std::size_t> mayBeCheapest() const
    {
        const auto best = request_.all ? std::nullopt : cheapest();
        double bound = best ? plan_.candidates[*best].microseconds : 1e6 * request_.budget;
        std::optional<std::size_t> next;
        for (std::size_t i = 0; i < plan_.candidates.size(); ++i) {
            const PlanCandidate& c = plan_.candidates[i];
            if (!c.tried && c.microseconds <= bound) {
                bound = c.microseconds;
                next = i;
            }
        }
        return next;
    }

    const studies::TrialBody& bodyAt(double spacing)
    {
        const auto found = bodies_.find(spacing);
        return found != bodies_.end() ? found->second
                                      : bodies_
                                            .emplace(spacing, studies::trialBody(*model_.tissue, model_.surface, spacing,
                                                                                 poissonCap(), studies::maxTrialNodes))
                                            .first->second;
    }

    double poissonCap() const { return model_.scene.model.elastic.poissonCap; }

    volume::Law finiteLaw() const { return volume::finiteOf(model_.scene.model.elastic.law); }

    // To a twentieth of the least error that is asked for in earnest.
    studies::ReferenceOptions optionsOf(const volume::Law& law, const char* what) const
    {
        return {
            .law = law,
            .tolerance = 5e-4,
            .maxCycles = 60,
            .maxPoints = maxPoints,
            .progress = [=, this](auto look, auto looks) { progress_(fmt::format("{}, {} of {}", what, look, looks)); }};
    }

    void solve()
    {
        progress_("the bodies");
        const studies::TrialBody finest =
            studies::trialBody(*model_.tissue, model_.surface, spacings.back(), poissonCap(), maxReferenceCells);
        path_ =
            studies::trialPath(*model_.tissue, model_.surface, place_, sceneTool(model_.scene.tool), finest.cells.spacing);
        const std::array speeds{request_.speed};
        reference_ =
            studies::solveReference(finest.body, path_, speeds, optionsOf(volume::SmallStrain{}, "the converged solution"));
        plan_.strain = reference_.strain;
        plan_.finiteReference = reference_.strain > largeStrain;
        if (plan_.finiteReference) {
            reference_ = studies::solveReference(finest.body, path_, speeds,
                                                 optionsOf(finiteLaw(), "the converged solution at finite strain"));
        }
        plan_.referenceSpacing = finest.cells.spacing;
        plan_.referenceNodes = reference_.nodes;
    }

    void collect()
    {
        add({});
        for (const double spacing : {spacings[2], spacings[0]}) {
            PlanCandidate c;
            c.level = ModelLevel::chainmail;
            c.spacing = spacing;
            add(c);
        }
        for (const double spacing : spacings) {
            for (const int window : windows) {
                addElastic(spacing, window);
            }
        }
    }

    void addElastic(double spacing, int window)
    {
        // Finer than the reference there is nothing to be told about errors.
        if (spacing < 0.99 * plan_.referenceSpacing) {
            return;
        }
        const studies::TrialBody& body = bodyAt(spacing);
        PlanCandidate c;
        c.level = ModelLevel::elastic;
        c.elastic = model_.scene.model.elastic;
        c.elastic.spacing = spacing;
        c.elastic.window = window;
        const chainmail::Elastic elastic(body.body, {.window = window}, studies::TrialLoad(path_).load().focus);
        c.nodes = elastic.nodes();
        c.slots = slotsOf(elastic.stack());
        if (c.nodes > maxWindowNodes) {
            return;
        }
        for (const int n : cycles) {
            c.elastic.cycles = n;
            c.elastic.law = volume::SmallStrain{};
            add(c);
            if (plan_.finiteReference) {
                c.elastic.law = finiteLaw();
                add(c);
            }
        }
    }

    void add(PlanCandidate c)
    {
        predict(c);
        plan_.candidates.push_back(std::move(c));
    }

    studies::TrialResult push(const PlanCandidate& c)
    {
        if (c.level == ModelLevel::spring) {
            return studies::runTrial(studies::nothingModel(), path_, request_.speed, reference_);
        }
        if (c.level == ModelLevel::chainmail) {
            const auto cells = volume::coveringGrid(model_.tissue->box(), c.spacing, 2.0 * c.spacing);
            const chainmail::Lattice lattice(cells, model_.tissue->tissueOn(cells), model_.tissue->table());
            return studies::chainMailTrial(lattice, path_, request_.speed, reference_, model_.scene.model.maxMoves);
        }
        return studies::elasticTrial(bodyAt(c.elastic.spacing).body, path_, request_.speed, reference_,
                                     {.window = c.elastic.window, .cycles = c.elastic.cycles, .law = c.elastic.law});
    }

    void attempt(PlanCandidate& c)
    {
        const studies::TrialResult result = push(c);
        c.tried = true;
        c.touched = c.level == ModelLevel::spring ? 0.0 : result.meanTouched;
        c.meanCycles = result.meanCycles;
        predict(c);
        c.rms = studies::spreadOf(result.looks, &studies::TrialErrors::rms).worst;
        c.near = studies::spreadOf(result.looks, &studies::TrialErrors::near).worst;
        c.error = std::hypot(c.near, referenceError);
        if (c.level == ModelLevel::elastic) {
            c.force = studies::spreadOf(result.looks, &studies::TrialErrors::force).worst;
        }
        c.holdsError = overError(c) <= 1.0;
    }

    // What a tried candidate needed bounds those of its kind that are not tried.
    void expectAtLeast(const PlanCandidate& tried)
    {
        for (PlanCandidate& c : plan_.candidates) {
            if (c.tried || c.level != tried.level || volume::isSmall(c.elastic.law) != volume::isSmall(tried.elastic.law)) {
                continue;
            }
            const bool first = c.meanCycles == 0.0 && c.touched == 0.0;
            const double cycles = expectedShare * tried.meanCycles, touched = expectedShare * tried.touched;
            c.meanCycles = first ? cycles : std::min(c.meanCycles, cycles);
            c.touched = first ? touched : std::min(c.touched, touched);
            predict(c);
        }
    }

    void predict(PlanCandidate& c) const
    {
        c.microseconds = predictedTime(c, request_.costs);
        c.holdsBudget = c.microseconds <= 1e6 * request_.budget;
    }

    // By what factor the worse of both errors is over what may be. A force that is not known may be off by anything.
    double overError(const PlanCandidate& c) const
    {
        constexpr double unknown = std::numeric_limits<double>::infinity();
        const double force = request_.forceError ? c.force.value_or(unknown) / (100.0 * *request_.forceError) : 0.0;
        return std::max(c.error / (100.0 * request_.error), force);
    }

    void findNearest()
    {
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < plan_.candidates.size(); ++i) {
            const PlanCandidate& c = plan_.candidates[i];
            const double over = std::max(overError(c), c.microseconds / (1e6 * request_.budget));
            if (c.tried && over < least) {
                least = over;
                plan_.nearest = i;
            }
        }
    }

    const haptics::SessionModel& model_;
    const PlanRequest& request_;
    const std::function<void(const std::string&)>& progress_;
    studies::TrialPlace place_;
    studies::TrialPath path_;
    studies::Reference reference_;
    std::map<double, studies::TrialBody> bodies_;
    Plan plan_;
};

constexpr std::size_t maxSlots = 200000;  // beyond any tick of a millisecond
constexpr double speed = 0.02;            // [m/s]
constexpr double poissonCap = 0.49;
constexpr double nanosecond = 1e-3;  // [us]

using Terms = std::array<double, 4>;

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

std::string PlanCandidate::name() const
{
    switch (level) {
        case ModelLevel::spring:
            return "spring";
        case ModelLevel::chainmail:
            return fmt::format("chainmail, {:g} mm", 1e3 * spacing);
        default:
            return fmt::format("elastic, {:g} mm, window {}, {} cycle{}{}", 1e3 * elastic.spacing, elastic.window,
                               elastic.cycles, elastic.cycles == 1 ? "" : "s",
                               volume::isSmall(elastic.law) ? "" : ", finite strain");
    }
}

LawCosts PlanCosts::of(const volume::Law& law) const noexcept
{
    return std::visit(
        [this](auto of) {
            if constexpr (decltype(of)::finite) {
                LawCosts costs = finite;
                costs.perSlot *= of.work;
                costs.perSlotCycle *= of.work;
                return costs;
            } else {
                return small;
            }
        },
        law);
}

double predictedTime(const PlanCandidate& c, const PlanCosts& costs) noexcept
{
    constexpr double microsecond = 1e-3;  // in nanoseconds
    switch (c.level) {
        case ModelLevel::spring:
            return costs.usPerTick;
        case ModelLevel::chainmail:
            return costs.usPerTick + microsecond * costs.nsPerMove * c.touched;
        default:
            break;
    }
    return costs.usPerTick + tickTime(costs.of(c.elastic.law), {static_cast<double>(c.slots), c.meanCycles, c.touched});
}

Plan planModel(const haptics::SessionModel& model, const PlanRequest& request,
               const std::function<void(const std::string&)>& progress)
{
    // What the spring takes, every model does.
    base::failIf(1e6 * request.budget < request.costs.usPerTick,
                 "budget: {:g} us: every model takes over {:g} us per tick: give more", 1e6 * request.budget,
                 request.costs.usPerTick);
    return Planner(model, request, progress).run();
}

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
        const TickWork& w = s.work;
        Terms t{w.slots, w.slots * w.cycles, w.contacts, w.contacts * w.cycles};
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
    return base::sumOf(
        stack.windows(), [](const chainmail::Window& w) { return w.layout.count; }, std::size_t{0});
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
