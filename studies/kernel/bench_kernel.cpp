#include <studies/kernel/bench_kernel.h>

#include <fmt/format.h>

#include <algorithm>

namespace palpate::studies {

using namespace chainmail;

namespace {

// Of the same ticks again, with arithmetic that counts.
std::vector<KernelWork> workOf(const ElasticBody& body, const TrialPath& path, double speed, ElasticOptions options)
{
    const CountedKernels counting;
    options.kernels = &counting.kernels();
    Elastic elastic(body, options, TrialLoad(path).load().focus);
    const TrialResult result = timeTrial(elasticModel(elastic), path, speed);
    return counting.work(static_cast<double>(std::max<std::size_t>(result.ticks, 1)));
}

class SceneBench {
public:
    SceneBench(const haptics::SessionModel& model, const KernelRequest& request, const KernelProgress& progress,
               const KernelSink& sink)
        : model_(model),
          request_(request),
          progress_(progress),
          sink_(sink),
          place_(trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim))
    {
    }

    void run(const std::string& setting)
    {
        const auto elastic = datasets::elasticSetting(setting, model_.scene.model.elastic);
        progress_(fmt::format("{}: body of setting {}", model_.scene.name, setting));
        const TrialBody body =
            trialBody(*model_.tissue, model_.surface, elastic.spacing, elastic.poissonCap, maxTrialNodes);
        for (const TrialTool& tool : request_.tools) {
            runTool(setting, elastic, body, tool);
        }
    }

private:
    void runTool(const std::string& setting, const datasets::ElasticSettings& elastic, const TrialBody& body,
                 const TrialTool& tool)
    {
        const TrialPath path = trialPath(*model_.tissue, model_.surface, place_, tool, body.cells.spacing);
        progress_(fmt::format("{}: {}, {}: reference", model_.scene.name, tool.name, setting));
        const Reference reference = solveReference(body.body, path, request_.speeds, {.law = elastic.law});
        const ElasticOptions options{.window = elastic.window, .cycles = elastic.cycles, .law = elastic.law};
        for (const double speed : request_.speeds) {
            progress_(fmt::format("{}: {}, {}: {:g} mm/s", model_.scene.name, tool.name, setting, 1e3 * speed));
            KernelCase c;
            c.scene = model_.scene.name;
            c.tool = tool.name;
            c.setting = setting;
            c.speed = speed;
            c.spacing = body.cells.spacing;
            c.window = elastic.window;
            c.cycles = elastic.cycles;
            c.nodes = Elastic(body.body, options, TrialLoad(path).load().focus).nodes();
            c.fullNodes = reference.nodes;
            c.strain = reference.strain;
            c.residual = reference.residual;
            c.result = elasticTrial(body.body, path, speed, reference, options);
            c.work = workOf(body.body, path, speed, options);
            if (setting == request_.rivalsOf && speed == request_.speeds.front()) {
                c.rivals = rivals(body, path, speed, reference, elastic, options);
            }
            sink_(c);
        }
    }

    KernelRivals rivals(const TrialBody& body, const TrialPath& path, double speed, const Reference& reference,
                        const datasets::ElasticSettings& elastic, const ElasticOptions& options)
    {
        progress_(fmt::format("{}: {}: rivals", model_.scene.name, path.tool.name));
        const Lattice lattice(body.cells, model_.tissue->tissueOn(body.cells), model_.tissue->table());
        KernelRivals r;
        r.full = fullSolve(body.body, path, speed, elastic.law);
        r.singleGrids =
            singleGridTrials(*model_.tissue, model_.surface, body, path, speed, reference, elastic, request_.rivalCycles);
        ElasticOptions standing = options;
        standing.warmStart = false;
        r.standing = elasticTrial(body.body, path, speed, reference, standing);
        r.chainMail = chainMailTrial(lattice, path, speed, reference, model_.scene.model.maxMoves);
        r.nothing = runTrial(nothingModel(), path, speed, reference);
        return r;
    }

    const haptics::SessionModel& model_;
    const KernelRequest& request_;
    const KernelProgress& progress_;
    const KernelSink& sink_;
    TrialPlace place_;
};

}  // namespace

void benchKernel(const haptics::SessionModel& model, const KernelRequest& request, const KernelProgress& progress,
                 const KernelSink& sink)
{
    SceneBench bench(model, request, progress, sink);
    for (const std::string& setting : request.settings) {
        bench.run(setting);
    }
}

}  // namespace palpate::studies
