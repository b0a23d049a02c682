#include <studies/stability/matrix.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/split.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cmath>
#include <future>
#include <set>

namespace palpate::studies {

namespace {

using datasets::ModelLevel;

// The names of `all`, or those of them that are asked for; throws for one that there is none of.
std::vector<std::string> chosen(const std::vector<std::string>& all, const std::vector<std::string>& asked,
                                const char* what)
{
    for (const auto& name : asked) {
        base::failIf(std::ranges::find(all, name) == all.end(), "--{} {}: there is no such name; there are {}", what, name,
                     fmt::join(all, ", "));
    }
    if (asked.empty()) {
        return all;
    }
    std::vector<std::string> out;
    std::ranges::copy_if(all, std::back_inserter(out),
                         [&](const auto& n) { return std::ranges::find(asked, n) != asked.end(); });
    return out;
}

template <typename T>
const T& named(const std::vector<T>& all, const std::string& name, const char* what)
{
    const auto found = std::ranges::find(all, name, &T::name);
    if (found == all.end()) {
        const auto names = base::mapped<std::string>(all, &T::name);
        throw base::error("{}: there is no such {}; there are {}", name, what, fmt::join(names, ", "));
    }
    return *found;
}

// The names of scenes that are asked for, by name or by kind.
std::vector<std::string> chosenScenes(const StabilityModels& models, const MatrixChoice& choice)
{
    std::vector<std::string> all;
    std::set<std::string> kinds;
    for (const auto& scene : models.scenes()) {
        all.push_back(scene.name);
        kinds.insert(scene.kind);
    }
    std::vector<std::string> asked;
    for (const auto& name : choice.scenes) {
        for (const auto& scene : models.scenes()) {
            if (scene.kind == name) {
                asked.push_back(scene.name);
            }
        }
        if (!kinds.contains(name)) {
            asked.push_back(name);
        }
    }
    auto names = chosen(all, asked, "scenes");
    if (choice.quick && asked.empty()) {
        std::erase_if(names, [&](const std::string& n) { return !models.scene(n).quick; });
    }
    return names;
}

// Cells of a method in a scene. The short matrix takes the hand that the scene is about.
void addCells(const StabilityScene& scene, const std::string& method, const std::vector<std::string>& devices,
              const MatrixChoice& choice, std::vector<Cell>& cells)
{
    for (const auto& device : devices) {
        for (const bool held : {true, false}) {
            if ((held && scene.onlyReleased) || (choice.quick && held == scene.onlyReleased)) {
                continue;
            }
            for (const int rate : choice.rates) {
                cells.push_back({scene.name, method, device, held, rate});
            }
        }
    }
}

// Whether poses are stale at `time`.
bool stale(const StabilityScene& scene, double time) noexcept
{
    return scene.staleEvery > 0.0 && time > haptics::settledAfter &&
           std::fmod(time, scene.staleEvery) >= scene.staleEvery - scene.staleFor;
}

}  // namespace

std::string Cell::id() const
{
    return fmt::format("{}/{}/{}/{}/{}", scene, method, device, grip(), rate);
}

StabilityModels::StabilityModels() : scenes_(stabilityScenes()), methods_(stabilityMethods()) {}

void StabilityModels::add(std::vector<StabilityScene> scenes)
{
    for (StabilityScene& s : scenes) {
        if (std::ranges::find(others_, s.name, &StabilityScene::name) == others_.end()) {
            others_.push_back(std::move(s));
        }
    }
}

const StabilityScene& StabilityModels::scene(const std::string& name) const
{
    if (const auto other = std::ranges::find(others_, name, &StabilityScene::name); other != others_.end()) {
        return *other;
    }
    return named(scenes_, name, "scene");
}

const StabilityMethod& StabilityModels::method(const std::string& name) const
{
    return named(methods_, name, "method");
}

// Scenes that share a body and a tool share their models.
std::string StabilityModels::bodyOf(const StabilityScene& scene)
{
    const auto& tool = scene.session.tool;
    return fmt::format("{} {} {:a} {:a}", static_cast<const void*>(scene.tissue.get()), static_cast<int>(tool.kind),
                       tool.radius, tool.length);
}

const haptics::SessionModel& StabilityModels::model(const StabilityScene& scene, ModelLevel level) const
{
    return *models_.at({bodyOf(scene), level});
}

void StabilityModels::prepare(const std::vector<Cell>& cells)
{
    std::map<Key, const StabilityScene*> wanted;
    for (const Cell& cell : cells) {
        const auto& at = scene(cell.scene);
        const Key key{bodyOf(at), method(cell.method).level};
        if (!models_.contains(key)) {
            wanted.emplace(key, &at);
        }
    }
    for (const auto& [key, at] : wanted) {
        auto session = at->session;
        session.model.level = key.second;
        models_[key] = std::make_unique<const haptics::SessionModel>(haptics::buildModel(std::move(session), at->tissue));
    }
}

std::vector<Cell> matrixCells(const StabilityModels& models, const MatrixChoice& choice)
{
    const auto methodNames = base::mapped<std::string>(models.methods(), &StabilityMethod::name);
    auto devices = chosen(haptics::deviceNames(), choice.devices, "devices");
    if (choice.quick && choice.devices.empty()) {
        devices.resize(1);
    }
    const auto methods = chosen(methodNames, choice.methods, "methods");
    std::vector<Cell> cells;
    for (const auto& sceneName : chosenScenes(models, choice)) {
        const auto& scene = models.scene(sceneName);
        for (const auto& method : methods) {
            if (!scene.pierced || models.method(method).pierces) {
                addCells(scene, method, devices, choice, cells);
            }
        }
    }
    return cells;
}

Cell cellOf(const StabilityModels& models, const std::string& id)
{
    const auto found = base::splitAt('/', id);
    const std::vector<std::string> parts(found.begin(), found.end());
    const bool grip = parts.size() == 5 && (parts[3] == "grip" || parts[3] == "released");
    int rate = 0;
    const char* end = grip ? parts[4].data() + parts[4].size() : nullptr;
    const bool whole = grip && std::from_chars(parts[4].data(), end, rate).ptr == end;
    base::failIf(!whole || rate < 100 || rate > 20000,
                 "--case {}: is no cell: give SCENE/METHOD/DEVICE/grip or released/RATE, such as "
                 "plate-1mm/elastic/premium/grip/1000",
                 id);
    base::failIf(models.scene(parts[0]).pierced && !models.method(parts[1]).pierces,
                 "--case {}: the needle pierces tissue in this scene, and {} does not support that: choose another method",
                 id, parts[1]);
    haptics::deviceParameters(parts[2]);
    return {parts[0], parts[1], parts[2], parts[3] == "grip", rate};
}

Trace runSession(const Cell& cell, const StabilityScene& scene, const StabilityMethod& method,
                 const haptics::SessionModel& model, const TickVisit& visit)
{
    const auto& device = haptics::deviceParameters(cell.device);
    const double period = 1.0 / cell.rate;
    const MethodScene at{model, device, period};
    const RunningMethod running = method.start(at);
    haptics::Arm arm(device, scene.grip, scene.hand.start, period);
    Trace trace;
    trace.period = period;
    trace.cap = capOf(at);
    trace.encoder = device.encoder;
    trace.stiffest = haptics::stableLimits({device, period, trace.cap}).stiffness;
    trace.handSpring = std::sqrt(scene.grip.stiffness * (device.mass + scene.grip.mass));
    const auto ticks = static_cast<std::size_t>(std::ceil(scene.hand.seconds() / period));
    haptics::DeviceSample sample;
    sample.axis = scene.axis;
    sample.buttons = haptics::buttonDeadMan;
    bool gone = false;
    for (std::size_t i = 0; i < ticks; ++i) {
        const double time = trace.time(i);
        if (!cell.held && !gone && time >= scene.letGo) {
            arm.letGo();
            gone = true;
        }
        arm.pull(scene.hand.at(time));
        const Vec3 read = arm.read();
        sample.fresh = i == 0 || !stale(scene, time);
        sample.position = sample.fresh ? read : sample.position;
        const Vec3 force = running.tick(sample);
        arm.write(force);
        trace.position.push_back(arm.position());
        trace.speed.push_back(glm::length(arm.velocity()));
        trace.work.push_back(arm.work() - arm.friction());
        trace.force.push_back(force);
        trace.tissue.push_back(running.tissue ? running.tissue() : force);
        if (visit) {
            visit(sample, force, running);
        }
    }
    trace.residue = running.residue ? running.residue() : 0.0;
    return trace;
}

CellResult runCell(const Cell& cell, const StabilityModels& models)
{
    const auto& scene = models.scene(cell.scene);
    const auto& method = models.method(cell.method);
    const Bounded bounded = cell.held ? scene.held : scene.released;
    const Trace trace = runSession(cell, scene, method, models.model(scene, method.level));
    return {cell, bounded, figureOf(bounded.figure, trace, scene)};
}

void onThreads(std::size_t count, int jobs, const std::function<void(std::size_t)>& work,
               const std::function<void(std::size_t)>& told)
{
    std::atomic<std::size_t> done{0};
    // An arena alone has no more threads than the machine has cores.
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(jobs) + 1);
    tbb::task_arena arena(jobs);
    auto all = std::async(std::launch::async, [&] {
        arena.execute([&] {
            tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
                work(i);
                ++done;
            });
        });
    });
    while (all.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) {
        told(done);
    }
    all.get();
}

}  // namespace palpate::studies
