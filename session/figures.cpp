#include <session/figures.h>

#include <base/mapped.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <sys/resource.h>

#include <utility>

namespace palpate::session {

nlohmann::json microseconds(const haptics::Percentiles& p)
{
    return {{"p50", 1e6 * p.p50}, {"p99", 1e6 * p.p99}, {"p999", 1e6 * p.p999}, {"max", 1e6 * p.max}};
}

nlohmann::json timingFigures(const haptics::ServoTiming& timing)
{
    nlohmann::json tasks;
    for (std::size_t i = 0; i < haptics::taskCount; ++i) {
        tasks[std::string(name(static_cast<haptics::Task>(i)))] = microseconds(timing.tasks[i].percentiles());
    }
    const auto measured = [&](nlohmann::json value) { return timing.paced ? std::move(value) : nlohmann::json(); };
    nlohmann::json lateness = microseconds(timing.lateness.percentiles());
    for (auto& value : lateness) {
        value = measured(value);
    }
    return {{"ticks", timing.ticks},
            {"missed_ticks", measured(timing.missed)},
            {"overruns", timing.overruns},
            {"gaps", measured(timing.gaps)},
            {"longest_gap_ms", measured(1e3 * haptics::tickSeconds * static_cast<double>(timing.longestGap))},
            {"lateness_us", std::move(lateness)},
            {"tick_us", microseconds(timing.work.percentiles())},
            {"tasks_us", tasks}};
}

nlohmann::json coreFigures(const std::vector<haptics::CoreSample>& cores, const std::vector<std::string>& tissues)
{
    auto out = nlohmann::json::array();
    for (const auto& core : cores) {
        nlohmann::json fraction = nlohmann::json::object();
        for (std::size_t i = 0; i < tissues.size(); ++i) {
            if (core.fraction[i] > 0.0) {
                fraction[tissues[i]] = core.fraction[i];
            }
        }
        out.push_back({{"fraction", fraction},
                       {"target_fraction", core.targetFraction},
                       {"length_in_lesion_mm", 1e3 * core.targetLength},
                       {"fragments", core.fragments},
                       {"volume_mm3", 1e9 * core.volume}});
    }
    return out;
}

std::string hexadecimal(std::uint64_t hash)
{
    return fmt::format("{:016x}", hash);
}

double peakMemoryMb()
{
    rusage use{};
    getrusage(RUSAGE_SELF, &use);
    return static_cast<double>(use.ru_maxrss) / 1024.0;
}

nlohmann::json scoreFigures(const haptics::Score& score, const std::vector<haptics::Loss>& losses)
{
    nlohmann::json out;
    for (const haptics::Measure& m : haptics::measures()) {
        out[m.key] = m.value(score);
    }
    out["judged"] = haptics::judgedNames[static_cast<std::size_t>(haptics::judgedBy(score))];
    const haptics::ScoreParts points = haptics::parts(score);
    for (const haptics::PartOfTotal& part : haptics::partsOfTotal) {
        out["points"][part.key] = points.*part.points;
    }
    out["losses"] = base::mapped<nlohmann::json>(losses, [](const haptics::Loss& loss) -> nlohmann::json {
        const auto at = loss.at ? nlohmann::json(*loss.at) : nlohmann::json();
        return {{"measure", loss.measure}, {"points", loss.points}, {"words", loss.words}, {"at_s", at}};
    });
    return out;
}

}  // namespace palpate::session
