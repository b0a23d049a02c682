#include <session/machine.h>

#include <base/build.h>
#include <base/outputs.h>
#include <base/processor_time.h>
#include <base/user_files.h>
#include <haptics/simulation.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <exception>
#include <fstream>
#include <iterator>
#include <optional>
#include <thread>
#include <vector>

namespace palpate::session {

namespace {

using nlohmann::json;

constexpr int warmUp = 40;  // ticks before those that count
constexpr int counted = 160;
constexpr int countedOfNeedle = 400;
constexpr double needleStep = 40e-6;         // way of a needle in a tick [m]: of a fast hand, for which windows move often
constexpr std::uint64_t fewestTicks = 1000;  // of a session that tells
constexpr double probeAside = 15e-3;         // of the ball, and how deep it presses [m]
constexpr double probePress = 4e-3;

// Streams through more memory than caches hold, on another core if there is one.
class Neighbour {
public:
    Neighbour()
        : thread_([this] {
              std::vector<std::uint64_t> memory(std::size_t{1} << 21U);
              for (std::uint64_t i = 0; !done_; ++i) {
                  memory[(i * 8) % memory.size()] += i;
              }
          })
    {
    }
    ~Neighbour()
    {
        done_ = true;
        thread_.join();
    }

private:
    std::atomic<bool> done_{false};
    std::thread thread_;
};

// A block of fat for a ball. What needles go into has skin and relaxes, with which ticks take up to twice as long.
haptics::SessionModel smallBody(const std::string& setting, const TissueLoad& load)
{
    datasets::Scene scene = *datasets::builtInScene(load.needle ? "layered" : "block");
    auto& numbers = scene.source.phantom.numbers;
    numbers["width_mm"] = 60;
    if (load.needle) {
        numbers["skin_mm"] = 1.5;
        numbers["gland_mm"] = 15;
        numbers["muscle_mm"] = 4;
        numbers["tumour_depth_mm"] = 12;
        scene.tool = datasets::ToolSpec{};
    } else {
        numbers["thickness_mm"] = 40;
        scene.source.phantom.voxel = 2e-3;
    }
    scene.model.level = datasets::ModelLevel::elastic;
    scene.model.elastic = datasets::elasticSetting(setting);
    if (load.probe) {
        scene.probe.kind = datasets::ProbeKind::linear;
        scene.probe.face = {0, 0, probeAside};
    }
    return haptics::buildModel(std::move(scene));
}

std::string processor()
{
    std::ifstream in("/proc/cpuinfo");
    for (std::string line; std::getline(in, line);) {
        if (line.starts_with("model name")) {
            return line.substr(line.find(':') + 1);
        }
    }
    return "";
}

// What a measurement is good for: this build on this processor with so many cores.
std::string key()
{
    return fmt::format("{};{};{}", base::build(), processor(), std::thread::hardware_concurrency());
}

using Clock = std::chrono::system_clock;

// What is known of this machine, by nameOf() a load.
json readCache(const std::filesystem::path& cache)
{
    json known;
    if (std::ifstream in(cache); in) {
        known = json::parse(in, nullptr, false);
    }
    const std::string here = key();
    return known.is_object() && known.value("machine", json()) == here ? known : json{{"machine", here}};
}

std::string nameOf(const TissueLoad& load)
{
    return std::string(load.needle ? "needle" : "tool") + (load.probe ? " and probe" : "");
}

std::int64_t secondsOf(Clock::time_point time)
{
    return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count();
}

std::optional<FittingSetting> keptIn(const json& known, const TissueLoad& load, Clock::time_point now)
{
    const auto found = known.find(nameOf(load));
    if (found == known.end() || !found->is_object()) {
        return std::nullopt;
    }
    const json setting = found->value("setting", json()), reason = found->value("reason", json());
    const json at = found->value("at", json());
    if (!setting.is_string() || !reason.is_string() || !at.is_number_integer()) {
        return std::nullopt;
    }
    const auto age = static_cast<double>(secondsOf(now)) - at.get<double>();
    const auto names = datasets::elasticSettings();
    const bool isName = std::find(names.begin(), names.end(), setting.get<std::string>()) != names.end();
    return isName && age >= 0.0 && age <= fittingKept ? std::optional(FittingSetting{setting, reason}) : std::nullopt;
}

// False where it cannot be written: the next session measures again.
bool keep(const std::filesystem::path& cache, json& known, const TissueLoad& load, const FittingSetting& fitting,
          Clock::time_point now)
{
    if (cache.empty()) {
        return false;
    }
    known[nameOf(load)] = {{"setting", fitting.setting}, {"reason", fitting.reason}, {"at", secondsOf(now)}};
    std::error_code none;
    std::filesystem::create_directories(cache.parent_path(), none);
    try {
        base::writeWhole(cache, known.dump());
    } catch (const std::exception&) {
        return false;
    }
    return true;
}

}  // namespace

FittingSetting fittingSetting(const std::function<TickTime(const std::string&)>& timeOf)
{
    constexpr double fineTakes = 3.0;  // times as long as default
    const TickTime standard = timeOf("default");
    const std::string words = fmt::format("a tick of default takes {:.2f} ms (slow ones {:.2f} ms) here",
                                          1e3 * standard.p50, 1e3 * standard.slow);
    if (standard.slow > fittingTick) {
        return {"fast", fmt::format("{}, and {:.1f} ms is what there is", words, 1e3 * fittingTick)};
    }
    if (fineTakes * standard.slow < fittingTick) {
        if (const TickTime fine = timeOf("fine"); fine.slow <= fittingTick) {
            return {"fine", fmt::format("a tick of fine takes {:.2f} ms (slow ones {:.2f} ms) here", 1e3 * fine.p50,
                                        1e3 * fine.slow)};
        }
    }
    return {"default", words};
}

TissueLoad loadOf(const datasets::Scene& scene) noexcept
{
    return {scene.tool.kind == datasets::ToolKind::needle, scene.probe.kind != datasets::ProbeKind::none};
}

TickTime measureSetting(const std::string& setting, const TissueLoad& load)
{
    const haptics::SessionModel model = smallBody(setting, load);
    haptics::Simulation simulation(model);
    const Neighbour viewer;
    haptics::Histogram times;
    const double radius = model.scene.tool.radius;
    const int most = warmUp + (load.needle ? countedOfNeedle : counted);
    haptics::DeviceSample sample{.position = {0, -radius, 0}, .buttons = haptics::buttonDeadMan};
    sample.axis = {0, 1, 0};
    for (int tick = 0; tick < most; ++tick) {
        const double swing = 0.02 * tick;
        const double deep = load.needle ? needleStep * tick : 0.4 * radius * (1.0 - std::cos(swing));
        sample.position = {load.needle ? 0.0 : 4e-3 * std::sin(swing), deep - radius, 0};
        sample.probe.press = 0.5 * probePress * (1.0 - std::cos(load.needle ? 0.5 * swing : swing));
        const double start = base::processorTime();
        simulation.tick(sample);
        if (tick >= warmUp) {
            times.add(base::processorTime() - start);
        }
    }
    const haptics::Percentiles p = times.percentiles();
    return {p.p50, load.needle ? p.p999 : p.p99};
}

FittingSetting fittingHere(const std::filesystem::path& cache, const TissueLoad& load, Clock::time_point now)
{
    json known = readCache(cache);
    if (auto kept = keptIn(known, load, now)) {
        return *kept;
    }
    FittingSetting found = fittingSetting([&load](const std::string& setting) { return measureSetting(setting, load); });
    found.reason =
        fmt::format("{}{}{}", load.needle ? "with a needle " : "",
                    load.probe ? (load.needle ? "and a probe " : "with a probe beside the tool ") : "", found.reason);
    keep(cache, known, load, found, now);
    return found;
}

double overrunsOf(const haptics::ServoTiming& timing) noexcept
{
    return static_cast<double>(timing.overruns) / static_cast<double>(std::max<std::uint64_t>(timing.ticks, 1));
}

std::string learnFrom(const std::filesystem::path& cache, const datasets::Scene& scene, const haptics::ServoTiming& timing,
                      Clock::time_point now)
{
    const double overruns = overrunsOf(timing);
    const auto settings = datasets::elasticSettings();
    const auto at = std::find(settings.begin(), settings.end(), scene.model.setting);
    if (!timing.paced || timing.ticks < fewestTicks || overruns <= bearableOverruns || at == settings.begin() ||
        at == settings.end()) {
        return "";
    }
    const FittingSetting next{
        *std::prev(at),
        fmt::format("in the session before, {:.1f} % of the ticks of {} took over 1 ms", 100.0 * overruns, *at)};
    json known = readCache(cache);
    return keep(cache, known, loadOf(scene), next, now) ? next.setting : "";
}

std::filesystem::path machineCache()
{
    const std::filesystem::path folder = base::userFolder(base::UserFolder::cache);
    return folder.empty() ? folder : folder / "machine.json";
}

}  // namespace palpate::session
