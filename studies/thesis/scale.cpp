#include <studies/commands.h>

#include <base/outputs.h>
#include <command/json.h>
#include <command/options.h>
#include <command/progress.h>
#include <session/figures.h>
#include <studies/thesis/tasks_measure.h>
#include <studies/thesis/tasks_scene.h>
#include <studies/thesis/tasks_search.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace palpate::studies {

namespace {

using nlohmann::json;

struct ScaleArguments {
    double memoryGb = 1.0;
    int frames = 6;
    std::string json;
};

constexpr double tick = 1e-3;                           // [s]
constexpr std::array<double, 2> bounds{80e-6, 500e-6};  // of the haptic part: chapter VI, and half of a tick [s]
constexpr std::size_t fewObjects = 1000;
constexpr std::uint64_t maxObjects = 16'000'000;
constexpr std::uint64_t fewVoxels = 64, maxVoxels = 1024;  // along a side; a phantom takes no more
constexpr double bytesPerVoxel = 14.0;           // of labels, grids, and what building them takes, at the peak: measured
constexpr double bisection = 0.1;                // sizes this near each other are one
constexpr int firstWindow = 9, lastWindow = 41;  // nodes; see ElasticSettings
constexpr double windowSpacing = 2e-3;           // [m]

/// A tissue model to be tried.
struct Model {
    std::string name;
    datasets::ModelSettings settings;
};

Model elastic(const std::string& setting)
{
    Model m{"elastic, " + setting, {}};
    m.settings.setting = setting;
    m.settings.elastic = datasets::elasticSetting(setting);
    return m;
}

// From the most that a scene may ask for to the least.
std::vector<Model> ladder()
{
    std::vector<Model> models{elastic("fine"), elastic("default"), elastic("fast"), {"chainmail", {}}, {"spring", {}}};
    models[3].settings.level = datasets::ModelLevel::chainmail;
    models[4].settings.level = datasets::ModelLevel::spring;
    return models;
}

/// A scene that was measured.
struct Measured {
    std::size_t objects = 0, voxels = 0, nodes = 0;
    double p50 = 0, p99 = 0;  // of the haptic part: H2 to H7 and the deformation, touching, additional force on [s]
    double build = 0;         // [s]

    bool holds(double bound) const noexcept { return p50 < bound && p99 < tick; }
};

// Nodes of the elastic level's windows around the needle; 0 for other levels.
std::size_t activeNodes(const haptics::SessionModel& model)
{
    if (!model.elastic) {
        return 0;
    }
    chainmail::ElasticOptions options;
    options.window = model.scene.model.elastic.window;
    return chainmail::Elastic(*model.elastic, options, chainmail::focusAt(model.surface, model.approach.entry)).nodes();
}

Measured measure(const InclusionSpec& spec, const datasets::ModelSettings& settings, int frames)
{
    const auto start = std::chrono::steady_clock::now();
    auto model = haptics::buildModel(inclusionScene(settings), inclusionTissue(spec));
    Measured m;
    m.build = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    m.objects = spec.inclusions;
    m.voxels = base::countOf(model.tissue->size());
    m.nodes = activeNodes(model);
    const auto a8 = *std::ranges::find(taskEvents, "A8", &TaskEvent::name);
    const auto times = timeEvents(model, std::span(&a8, 1), nullptr, {frames});
    m.p50 = times.front().p50;
    m.p99 = times.front().p99;
    return m;
}

/// How far one size of the scene can grow.
struct Largest {
    std::optional<Measured> scene;
    std::string limit;  // in words
};

class Search {
public:
    Search(const ScaleArguments& o, command::Progress& progress) : o_(o), progress_(progress) {}

    /// The best model under which the smallest scene holds; nothing where none does.
    std::optional<Model> modelFor(double bound)
    {
        const auto models = ladder();
        for (std::size_t i = 0; i < models.size(); ++i) {
            if (smallest_.size() == i) {
                progress_.show(models[i].name);
                smallest_.push_back(measure({fewObjects, 0, 1}, models[i].settings, o_.frames));
            }
            if (smallest_[i].holds(bound)) {
                return models[i];
            }
        }
        return std::nullopt;
    }

    Largest objects(const Model& model, double bound)
    {
        return grow(
            fewObjects, maxObjects, bound,
            [&](std::uint64_t n) {
                return std::pair(InclusionSpec{n, 0, 1}, model.settings);
            },
            "objects", "more was not tried");
    }

    Largest voxels(const Model& model, double bound)
    {
        return grow(
            fewVoxels, maxVoxels, bound,
            [&](std::uint64_t n) {
                return std::pair(InclusionSpec{fewObjects, static_cast<int>(n), 1}, model.settings);
            },
            "voxels a side", "a phantom has no more");
    }

    /// Windows of 2 mm spacing, with the cycles of the model; where it has none, of the fast one.
    Largest nodes(const Model& model, double bound)
    {
        const bool own = model.settings.level == datasets::ModelLevel::elastic;
        datasets::ModelSettings settings = own ? model.settings : elastic("fast").settings;
        settings.elastic.spacing = windowSpacing;
        return grow(
            1, (lastWindow - firstWindow) / 2 + 1, bound,
            [&](std::uint64_t n) {
                auto wider = settings;
                wider.elastic.window = firstWindow + 2 * (static_cast<int>(n) - 1);
                return std::pair(InclusionSpec{fewObjects, 0, 1}, wider);
            },
            "", fmt::format("no window has over {} nodes along its depth", lastWindow));
    }

private:
    // Voxels that a scene will have, before it is made.
    static double voxelsOf(const InclusionSpec& spec)
    {
        const double side = spec.voxelsPerSide > 0 ? spec.voxelsPerSide : voxelsFor(spec.inclusions);
        return side * side * side * (1.0 + inclusionBase / inclusionBlockSide);
    }

    // What a scene will need at its peak [GB].
    double needed(const InclusionSpec& spec) const
    {
        const double more = std::max(0.0, voxelsOf(spec) - maxVoxels_);
        return 1e-3 * session::peakMemoryMb() + 1e-9 * bytesPerVoxel * more;
    }

    template <typename SceneOf>
    Largest grow(std::uint64_t first, std::uint64_t last, double bound, SceneOf&& sceneOf, const char* what,
                 const std::string& end)
    {
        Largest largest;
        std::uint64_t worst = std::numeric_limits<std::uint64_t>::max();
        const auto holds = [&](std::uint64_t n) {
            const auto [spec, settings] = sceneOf(n);
            progress_.show(fmt::format(
                "under {:.0f} us: {} objects, {} voxels a side, window {}", 1e6 * bound, spec.inclusions,
                spec.voxelsPerSide > 0 ? spec.voxelsPerSide : voxelsFor(spec.inclusions), settings.elastic.window));
            const double gb = needed(spec);
            if (gb > o_.memoryGb) {
                tell(largest, n, worst,
                     fmt::format("memory: {} {} would take about {:.1f} of {:g} GB", n, what, gb, o_.memoryGb));
                return false;
            }
            const Measured m = measure(spec, settings, o_.frames);
            maxVoxels_ = std::max(maxVoxels_, voxelsOf(spec));
            if (!m.holds(bound)) {
                const std::string size =
                    *what == '\0' ? fmt::format("{} active nodes", m.nodes) : fmt::format("{} {}", n, what);
                tell(largest, n, worst,
                     fmt::format("time: {} take {:.0f} us (p50), {:.0f} us (p99)", size, 1e6 * m.p50, 1e6 * m.p99));
                return false;
            }
            largest.scene = m;
            return true;
        };
        const auto found = largestThatHolds(first, last, bisection, holds);
        if (found == last) {
            largest.limit = "size: " + end;
        }
        return largest;
    }

    // The smallest size that does not hold says what limits.
    static void tell(Largest& largest, std::uint64_t size, std::uint64_t& worst, std::string limit)
    {
        if (size < worst) {
            worst = size;
            largest.limit = std::move(limit);
        }
    }

    const ScaleArguments& o_;
    command::Progress& progress_;
    std::vector<Measured> smallest_;  // scenes, by model of the ladder
    double maxVoxels_ = 0;            // of a scene that was made
};

json entryOf(const Largest& l)
{
    if (!l.scene) {
        return {{"holds", false}, {"limit", l.limit}};
    }
    const Measured& m = *l.scene;
    return {{"holds", true},
            {"objects", m.objects},
            {"voxels", m.voxels},
            {"active_nodes", m.nodes},
            {"haptic_us_p50", 1e6 * m.p50},
            {"haptic_us_p99", 1e6 * m.p99},
            {"build_s", m.build},
            {"limit", l.limit}};
}

void print(const char* what, const json& e)
{
    if (!e["holds"].get<bool>()) {
        fmt::print("  {:<13} none; {}\n", what, e["limit"].get<std::string>());
        return;
    }
    fmt::print("  {:<13} {:>9} {:>11} {:>9} {:>8.1f} {:>8.1f} {:>8.1f}  {}\n", what, e["objects"].get<std::size_t>(),
               e["voxels"].get<std::size_t>(), e["active_nodes"].get<std::size_t>(), e["haptic_us_p50"].get<double>(),
               e["haptic_us_p99"].get<double>(), e["build_s"].get<double>(), e["limit"].get<std::string>());
}

void benchScale(const ScaleArguments& o)
{
    base::checkOutput(o.json);
    const bool tell = o.json != "-";
    command::Progress progress;
    Search search(o, progress);
    json largest;
    if (tell) {
        fmt::print(
            "the largest scene with a haptic part under a bound (median; p99 under a tick), times in us, build in s\n");
        fmt::print("  {:<13} {:>9} {:>11} {:>9} {:>8} {:>8} {:>8}  {}\n", "grown", "objects", "voxels", "active", "p50",
                   "p99", "build", "limited by");
    }
    for (const double bound : bounds) {
        const auto model = search.modelFor(bound);
        json entry{{"bound_us", 1e6 * bound}, {"model", model ? json(model->name) : json()}};
        progress.clear();
        if (tell) {
            fmt::print("under {:.0f} us: {}\n", 1e6 * bound,
                       model ? "model " + model->name : "no model, too slow a machine");
        }
        const auto add = [&](const char* key, const Largest& l) {
            entry[key] = entryOf(l);
            progress.clear();
            if (tell) {
                print(key, entry[key]);
                std::fflush(stdout);
            }
        };
        if (model) {
            add("objects", search.objects(*model, bound));
            add("voxels", search.voxels(*model, bound));
            add("active_nodes", search.nodes(*model, bound));
        }
        largest[fmt::format("under_{:.0f}_us", 1e6 * bound)] = entry;
    }
    command::writeJson(o.json,
                       {{"largest", largest}, {"memory_gb", o.memoryGb}, {"cores", std::thread::hardware_concurrency()}});
}

}  // namespace

void addBenchScale(CLI::App& bench)
{
    auto o = std::make_shared<ScaleArguments>();
    auto* c = bench.add_subcommand("scale",
                                   "Find the largest scene (objects, voxels, active nodes) that runs at 1 kHz with a "
                                   "haptic part under 0.08 ms and under 0.5 ms, and what limits it");
    command::addNumber(*c, "--memory-gb", o->memoryGb, "Maximum memory of a scene [GB]", 0.1, 1000.0);
    command::addNumber(*c, "--frames", o->frames, "Frames of 33 ticks, for each scene", 1, 1000);
    c->add_option("--json", o->json, "Write figures to this file (- = standard output)");
    c->final_callback([o] { benchScale(*o); });
}

}  // namespace palpate::studies
