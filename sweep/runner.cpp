#include <sweep/case.h>

#include <base/error.h>
#include <datasets/scene_text.h>
#include <haptics/recorder.h>
#include <haptics/replay.h>
#include <session/open.h>
#include <sweep/formula.h>
#include <sweep/plan_checks.h>
#include <sweep/procedure.h>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <chrono>
#include <cmath>
#include <map>
#include <optional>

namespace palpate::sweep {

namespace {

constexpr std::size_t modelsKept = 2;       // a case's and its reference's
constexpr std::size_t referencesKept = 64;  // numbers only

// The value of `key`, made where it is not there; the least recently used goes.
template <class Value, class Make>
const Value& kept(std::list<std::pair<std::string, Value>>& all, const std::string& key, std::size_t most, const Make& make)
{
    for (auto i = all.begin(); i != all.end(); ++i) {
        if (i->first == key) {
            all.splice(all.begin(), all, i);
            return all.front().second;
        }
    }
    Value made = make();
    all.emplace_front(key, std::move(made));
    if (all.size() > most) {
        all.pop_back();
    }
    return all.front().second;
}

std::string procedureText(const Procedure& p)
{
    return fmt::format("{} {} {} {} {} {} {} {} {}", static_cast<int>(p.kind), p.trainee, p.seed.value_or(0), p.delay,
                       p.seconds, p.depth, p.speed, p.hold, p.aside);
}

}  // namespace

CaseRunner::CaseRunner(const SweepPlan& plan, std::string build) : plan_(plan), build_(std::move(build)) {}

CaseRunner::~CaseRunner() = default;

std::shared_ptr<const volume::Tissue> CaseRunner::volumeOf(const datasets::Scene& scene)
{
    return kept(volumes_, datasets::volumeText(scene), modelsKept,
                [&] { return std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene)); });
}

std::shared_ptr<const CaseRunner::Modelled> CaseRunner::modelOf(const datasets::Scene& scene)
{
    return kept(models_, scene.text, modelsKept, [&] {
        auto model = haptics::buildModel(scene, volumeOf(scene));
        haptics::SessionInfo info = haptics::infoOf(model);
        info.sceneOrigin = "sweep";
        info.build = build_;
        return std::make_shared<const Modelled>(Modelled{std::move(model), std::move(info)});
    });
}

CaseRunner::Measured CaseRunner::measure(const datasets::Scene& scene, const Procedure& procedure, std::uint64_t seed,
                                         const std::filesystem::path& record)
{
    const auto modelled = modelOf(scene);
    haptics::SessionInfo info = modelled->info;
    info.device = fmt::format("{} {}", procedureNames[static_cast<std::size_t>(procedure.kind)], procedure.trainee);
    info.seed = procedure.seed.value_or(seed);
    std::optional<haptics::Recorder> recorder;
    if (!record.empty()) {
        session::startHere(info);
        try {
            recorder.emplace(record, info);
        } catch (const std::runtime_error& e) {
            throw RecordFailed(e.what());
        }
    }
    const auto watch = [&](const haptics::TickRecord&, const haptics::ServoTiming&) {
        base::failIf(std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count() > plan_.caseLimit,
                     "took over {:g} s and was aborted (case_limit_s in the plan)", plan_.caseLimit);
    };
    auto result = carryOut(modelled->model, info, procedure, seed, recorder ? &*recorder : nullptr, watch);
    if (recorder) {
        recorder->finish({});
        if (!recorder->error().empty()) {
            throw RecordFailed(recorder->error());
        }
    }
    return {std::move(result.values), result.tickTime};
}

const CaseRunner::Measured& CaseRunner::referenceOf(const SweepCase& c)
{
    const bool seeded = c.referenceProcedure.kind == ProcedureKind::session;
    const std::string key =
        fmt::format("{}\n{}\n{}", seeded ? c.seed : 0, procedureText(c.referenceProcedure), c.reference.text);
    return kept(references_, key, referencesKept, [&] { return measure(c.reference, c.referenceProcedure, c.seed, {}); });
}

CaseRow CaseRunner::run(std::size_t index, const std::filesystem::path& record)
{
    began_ = std::chrono::steady_clock::now();
    const SweepCase c = sweepCase(plan_, index);
    const Measured own = measure(c.scene, c.procedure, c.seed, record);
    const Measured* const reference = plan_.reference.empty() ? nullptr : &referenceOf(c);
    std::map<std::string, double> numbers = c.variables;
    const auto infos = outputsOf(c.procedure.kind);
    for (std::size_t i = 0; i < infos.size(); ++i) {
        numbers[infos[i].name] = own.values[i];
        if (reference != nullptr) {
            const double before = reference->values[i];
            const auto names = namesOf(infos[i], true);
            numbers[names[1]] = before;
            numbers[names[2]] = 100.0 * (own.values[i] - before) / std::abs(before);
        }
    }
    CaseRow row;
    row.tickTime = own.tickTime;
    for (const SweepOutput& output : plan_.outputs) {
        row.outputs.push_back(output.formula.empty() ? numbers.at(output.name) : evaluate(output.formula, numbers));
        numbers[output.name] = row.outputs.back();
    }
    return row;
}

std::shared_ptr<void> oneThread()
{
    return std::make_shared<tbb::global_control>(tbb::global_control::max_allowed_parallelism, 1);
}

}  // namespace palpate::sweep
