#include <apps/train_figures.h>

#include <base/error.h>
#include <base/room.h>
#include <haptics/measures.h>
#include <haptics/posed.h>
#include <haptics/score.h>
#include <session/figures.h>
#include <session/machine.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <string>

namespace palpate::apps {

namespace {

std::string missesInWords(const haptics::ServoTiming& timing)
{
    if (timing.missed == 0) {
        return "";
    }
    return fmt::format(" in {} gaps of up to {} ms ({} ticks took over 1 ms)", timing.gaps, timing.longestGap,
                       timing.overruns);
}

// "4509 ticks, 2 missed in 1 gaps of ..; a tick takes 210 us (p50), ..; late by .."
std::string timingInWords(const haptics::ServoTiming& timing)
{
    const auto tick = timing.work.percentiles(), late = timing.lateness.percentiles();
    const std::string work = fmt::format("a tick takes {:.0f} us (p50), {:.0f} us (p99)", 1e6 * tick.p50, 1e6 * tick.p99);
    if (!timing.paced) {
        return fmt::format("{} ticks, not paced; {}", timing.ticks, work);
    }
    return fmt::format("{} ticks, {} missed{}; {}; late by {:.1f} us (p50), {:.0f} us (p99)", timing.ticks, timing.missed,
                       missesInWords(timing), work, 1e6 * late.p50, 1e6 * late.p99);
}

// What to do about a machine that is too slow for the tissue model, or nothing.
std::string slowness(const haptics::ServoTiming& timing, const datasets::ModelSettings& model, const std::string& next)
{
    const double overruns = session::overrunsOf(timing);
    if (!timing.paced || overruns <= session::bearableOverruns) {
        return "";
    }
    const bool coarser =
        model.level == datasets::ModelLevel::elastic && model.setting != datasets::elasticSettings().front();
    const std::string cure = !next.empty() ? fmt::format("the next session takes setting {}", next)
                             : coarser     ? "try --setting fast, or see palpate plan"
                                           : "palpate plan finds one that it can hold";
    return fmt::format(
        "{:.1f} % of the ticks took over 1 ms: this machine is too slow or too busy for the tissue model; {}\n",
        100 * overruns, cure);
}

// What the case is about, and what the exercise asks for.
nlohmann::json askedFor(const Conclusion& conclusion, const haptics::Score& score)
{
    auto asked = nlohmann::json::array();
    for (const haptics::Measure& m : haptics::measures()) {
        const auto level = std::ranges::find(conclusion.levels, m.key, &training::Level::measure);
        const bool has = level != conclusion.levels.end();
        if (!has && std::ranges::find(conclusion.measures, m.key) == conclusion.measures.end()) {
            continue;
        }
        asked.push_back({{"measure", m.key}, {"label", m.label}, {"unit", m.unit}, {"decimals", m.decimals}});
        auto& one = asked.back();
        one["at_least"] = has && level->atLeast ? nlohmann::json(*level->atLeast) : nlohmann::json();
        one["at_most"] = has && level->atMost ? nlohmann::json(*level->atMost) : nlohmann::json();
        one["met"] = has ? nlohmann::json(level->met(m.value(score))) : nlohmann::json();
    }
    return asked;
}

}  // namespace

std::shared_ptr<base::Descriptor> roomForFigures(const std::filesystem::path& json)
{
    constexpr std::size_t enough = 64 << 10;  // [bytes]
    if (json.empty() || json == "-") {
        return nullptr;
    }
    const auto folder = std::filesystem::absolute(json).parent_path();
    base::failIf(!base::hasRoom(folder, enough), "{}: the disk is full: make room, then start again", json.native());
    return std::make_shared<base::Descriptor>(base::keepRoom(folder, enough));
}

nlohmann::json figuresOf(const session::TrainResult& result, const haptics::SessionInfo& info,
                         const haptics::SessionModel& model, const Conclusion& conclusion)
{
    auto figures = session::timingFigures(result.timing);
    figures["scene"] = info.scene;
    figures["model"] = info.model;
    if (model.scene.model.level == datasets::ModelLevel::elastic) {
        figures["setting"] = model.scene.model.setting;
    }
    if (model.posture) {
        figures["gravity"] = {{"moved_mm", 1e3 * model.posture->farthest},
                              {"weight_n", model.posture->weight},
                              {"cells_mm", 1e3 * model.posture->spacing},
                              {"rounds", model.posture->rounds},
                              {"unloaded_within_mm", 1e3 * model.posture->residual}};
    }
    figures["steps_down"] = result.stepsDown;
    figures["model_at_end"] = name(result.level);
    figures["device"] = info.device;
    figures["build"] = info.build;
    figures["contacts"] = result.contacts;
    figures["punctures"] = result.punctures;
    figures["peak_force_n"] = {
        {"basic", result.peakBasic}, {"additional", result.peakAdditional}, {"total", result.peakTotal}};
    figures["energy_mj"] = {{"made", 1e3 * result.energyMade}, {"damped", 1e3 * result.energyDamped}};
    nlohmann::json nearest = nlohmann::json::object();
    for (std::size_t i = 0; i < info.structures.size(); ++i) {
        nearest[info.structures[i]] = 1e3 * result.nearest[i];
    }
    figures["nearest_mm"] = nearest;
    figures["score"] = session::scoreFigures(result.score, result.losses);
    figures["core"] = session::coreFigures(result.cores, info.tissues);
    figures["force_hash"] = session::hexadecimal(result.forceHash);
    figures["peak_memory_mb"] = session::peakMemoryMb();
    figures["lost_records"] = result.lostRecords;
    figures["pauses"] = {{"count", result.timing.pauses}, {"seconds", result.timing.paused}};
    figures["warnings"] = result.warnings;
    figures["asked"] = askedFor(conclusion, result.score);
    figures["kept"] = conclusion.kept;
    figures["problem"] = conclusion.why + (conclusion.why.empty() || result.problem.empty() ? "" : "; ") + result.problem;
    return figures;
}

void summarise(const session::TrainResult& result, const haptics::SessionInfo& info, const haptics::SessionModel& model,
               const std::string& next)
{
    fmt::print("{}\n", timingInWords(result.timing));
    fmt::print("{}", slowness(result.timing, model.scene.model, next));
    if (model.posture) {
        fmt::print("gravity: {}\n", haptics::textOf(*model.posture));
    }
    fmt::print("peak force {:.2f} N (tissue {:.2f} N, guidance {:.2f} N)\n", result.peakTotal, result.peakBasic,
               result.peakAdditional);
    for (std::size_t i = 0; i < result.cores.size(); ++i) {
        const auto& core = result.cores[i];
        fmt::print("core {}: {:.0f} % {}, {:.1f} mm of it in the {}; {}\n", i + 1, 100.0 * core.targetFraction,
                   info.structures[0], 1e3 * core.targetLength, info.structures[0],
                   core.fragments == 1 ? "in one piece" : fmt::format("in {} pieces", core.fragments));
    }
    for (const auto& [label, value] : haptics::describe(result.score)) {
        fmt::print("  {:<28} {}\n", label, value);
    }
}

}  // namespace palpate::apps
