#include <studies/accuracy/accuracy.h>

#include <base/error.h>
#include <haptics/contact_law.h>
#include <studies/kernel/kernel_rivals.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace palpate::studies {

using namespace chainmail;

namespace {

constexpr double speed = 20e-3;  // [m/s]

// Windows of level elastic. Those with a name of datasets::elasticSettings() are these settings.
struct Rung {
    const char* name;
    double spacing;  // [m]
    int window, cycles;
    bool small, finite;  // strain: which of the two
};
constexpr Rung coarse[]{{"8 mm", 8e-3, 9, 1, true, false}, {"6 mm", 6e-3, 9, 1, true, false}};
constexpr Rung refined[]{{"2 mm, 1 cycle", 2e-3, 15, 1, true, true},
                         {"2 mm, 25 wide, 4 cycles", 2e-3, 25, 4, true, true},
                         {"1 mm, 2 cycles", 1e-3, 25, 2, true, true},
                         {"1 mm, 6 cycles", 1e-3, 31, 6, true, true}};

std::vector<Rung> rungs()
{
    std::vector<Rung> out(std::begin(coarse), std::end(coarse));
    for (const char* name : {"fast", "default", "fine"}) {
        const datasets::ElasticSettings s = datasets::elasticSetting(name);
        out.push_back({name, s.spacing, s.window, s.cycles, true, true});
    }
    out.insert(out.end(), std::begin(refined), std::end(refined));
    std::ranges::stable_sort(out, std::greater<>(), &Rung::spacing);
    return out;
}

// The last body that was made: settings of equal spacing follow each other.
class BodyShelf {
public:
    explicit BodyShelf(const BaselineScene& scene) : scene_(scene) {}

    std::shared_ptr<const TrialBody> body(double spacing)
    {
        if (!body_ || spacing != spacing_) {
            body_.reset();  // two at a time may be more than the memory holds
            spacing_ = spacing;
            body_ = std::make_shared<const TrialBody>(
                trialBody(scene_.tissue, scene_.surface, spacing, scene_.poissonCap, maxTrialNodes));
        }
        return body_;
    }
    const TrialPath& path() const { return scene_.path; }

private:
    BaselineScene scene_;
    std::shared_ptr<const TrialBody> body_;
    double spacing_ = 0;
};

// elasticModel() with all that it needs.
struct HeldElastic {
    HeldElastic(std::shared_ptr<const TrialBody> of, const ElasticOptions& options, const Focus& focus)
        : body(std::move(of)), elastic(body->body, options, focus)
    {
    }
    std::shared_ptr<const TrialBody> body;
    Elastic elastic;
};

Baseline elasticBaseline(const std::shared_ptr<BodyShelf>& shelf, const std::string& method, const std::string& setting,
                         double spacing, const ElasticOptions& options)
{
    return {method, setting, [=] {
                const Focus focus = TrialLoad(shelf->path()).load().focus;
                auto held = std::make_shared<HeldElastic>(shelf->body(spacing), options, focus);
                TrialModel model = elasticModel(held->elastic);
                model.tick = [held, tick = std::move(model.tick)](const TrialLoad& load) { return tick(load); };
                return model;
            }};
}

double secondsSince(std::chrono::steady_clock::time_point start)
{
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Refuses to go on when all ticks together have taken too long.
TrialModel limited(TrialModel model, double maxSeconds)
{
    model.tick = [tick = std::move(model.tick), maxSeconds, used = 0.0, count = 0](const TrialLoad& load) mutable {
        base::failIf(used > maxSeconds, "takes {:.0f} ms per tick: stopped after {:.0f} s", 1e3 * used / count, used);
        const auto start = std::chrono::steady_clock::now();
        const ElasticResult result = tick(load);
        used += secondsSince(start);
        ++count;
        return result;
    };
    return model;
}

// Throws where a look's errors are no numbers: the method has come apart.
void checkFinite(std::span<const TrialResult> results)
{
    for (const TrialResult& result : results) {
        for (const TrialErrors& e : result.looks) {
            for (const double figure : {e.rms, e.near, e.max, e.force, e.volume}) {
                base::failIf(!std::isfinite(figure), "its displacements or forces are no finite numbers");
            }
        }
    }
}

// Level spring where the tool is the path's sphere: the force of equation 2, out of the surface at rest.
TrialModel springModel(const haptics::SessionModel& model, const TrialPath& path)
{
    auto own = std::make_shared<haptics::SessionModel>(model);
    own->scene.model.level = datasets::ModelLevel::spring;
    own->scene.tool.kind = datasets::ToolKind::sphere;
    own->scene.tool.radius = path.tool.radius;
    auto force = std::make_shared<Vec3>(0.0);
    TrialModel out = nothingModel();
    out.tick = [own, force, &path](const TrialLoad& load) {
        const Vec3 at = path.at(load.pose());
        const Vec3 normal = path.surface->normal(at);
        const double depth = path.tool.radius - path.surface->distance(at);
        const auto under = haptics::tissueUnder(*own, volume::Tissue::Reader(*own->tissue), at - path.tool.radius * normal,
                                                -normal, path.tool.radius);
        *force = depth > 0.0 ? haptics::sphereForce(*own, under, depth) * normal : Vec3(0.0);
        return ElasticResult{};
    };
    out.force = [force] { return *force; };
    return out;
}

}  // namespace

AccuracySubject accuracySubject(std::shared_ptr<const haptics::SessionModel> model)
{
    constexpr double anySpacing = 2e-3;  // a sphere has no ties that it would matter to [m]
    const auto tools = trialTools();
    const auto tool = std::ranges::find(tools, "sphere_10mm", &TrialTool::name);
    AccuracySubject out{std::move(model), {}, speed, {}};
    const haptics::SessionModel& m = *out.model;
    const TrialPlace place = trialPlace(*m.tissue, m.surface, m.approach.entry, m.approach.aim);
    out.path = trialPath(*m.tissue, m.surface, place, *tool, anySpacing);
    return out;
}

std::vector<Baseline> rigidMethods(const AccuracySubject& subject)
{
    return {{"nothing", "", nothingModel},
            {"spring", "", [&subject] { return springModel(*subject.model, subject.path); }}};
}

std::vector<Baseline> elasticMethods(const AccuracySubject& subject)
{
    const auto shelf = std::make_shared<BodyShelf>(subject.scene());
    const volume::Law law = volume::finiteOf(subject.model->scene.model.elastic.law);
    std::vector<Baseline> out;
    for (const Rung& rung : rungs()) {
        for (const bool finite : {false, true}) {
            if (finite ? rung.finite : rung.small) {
                out.push_back(
                    elasticBaseline(shelf, finite ? "elastic_finite" : "elastic", rung.name, rung.spacing,
                                    {.window = rung.window, .cycles = rung.cycles, .law = finite ? law : volume::Law()}));
            }
        }
    }
    return out;
}

std::vector<Baseline> singleGridMethods(const AccuracySubject& subject)
{
    constexpr std::pair<double, int> grids[]{{8e-3, 1}, {6e-3, 1}, {4e-3, 1}, {4e-3, 4}, {3e-3, 1}, {2e-3, 1}, {2e-3, 4}};
    const auto shelf = std::make_shared<BodyShelf>(subject.scene());
    const volume::Law law = volume::finiteOf(subject.model->scene.model.elastic.law);
    std::vector<Baseline> out;
    for (const auto& [spacing, cycles] : grids) {
        const std::string name = fmt::format("{:g} mm, {} cycle{}", 1e3 * spacing, cycles, cycles == 1 ? "" : "s");
        for (const bool finite : {false, true}) {
            out.push_back(elasticBaseline(shelf, finite ? "single_grid_finite" : "single_grid", name, spacing,
                                          wholeGrid(cycles, finite ? law : volume::Law())));
        }
    }
    return out;
}

std::vector<Baseline> accuracyMethods(const AccuracySubject& subject)
{
    std::vector<Baseline> out = rigidMethods(subject);
    const auto scene = std::make_shared<const BaselineScene>(subject.scene());
    for (auto&& more :
         {elasticMethods(subject), singleGridMethods(subject), latticeBaselines(*scene), tetBaselines(*scene)}) {
        out.insert(out.end(), more.begin(), more.end());
    }
    for (Baseline& method : out) {
        method.build = [scene, build = std::move(method.build)] { return build(); };
    }
    return out;
}

AccuracyRun runAccuracy(const Baseline& method, const AccuracySubject& subject,
                        std::span<const Reference* const> references, double maxSeconds)
{
    AccuracyRun run;
    try {
        const auto start = std::chrono::steady_clock::now();
        const TrialModel model = limited(method.build(), maxSeconds);
        run.buildSeconds = secondsSince(start);
        run.hasForce = static_cast<bool>(model.force);
        auto results = runTrials(model, subject.path, subject.speed, references);
        checkFinite(results);
        run.results = std::move(results);
    } catch (const std::runtime_error& e) {
        run.failure = e.what();
    } catch (const std::bad_alloc&) {
        run.failure = "needs more memory than there is";
    }
    return run;
}

std::vector<std::size_t> paretoFront(std::span<const AccuracyPoint> points)
{
    std::vector<std::size_t> order(points.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::erase_if(order, [&](auto i) { return !std::isfinite(points[i].seconds) || !std::isfinite(points[i].error); });
    std::ranges::stable_sort(order, {}, [&](std::size_t i) { return std::pair(points[i].seconds, points[i].error); });
    std::vector<std::size_t> front;
    double best = std::numeric_limits<double>::infinity();
    for (const std::size_t i : order) {
        if (points[i].error < best) {
            best = points[i].error;
            front.push_back(i);
        }
    }
    return front;
}

}  // namespace palpate::studies
