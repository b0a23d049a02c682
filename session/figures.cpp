#include <session/figures.h>

#include <haptics/simulation.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <sys/resource.h>

#include <string>

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
    return {{"ticks", timing.ticks},
            {"missed_ticks", timing.missed},
            {"overruns", timing.overruns},
            {"gaps", timing.gaps},
            {"longest_gap_ms", 1e3 * haptics::tickSeconds * static_cast<double>(timing.longestGap)},
            {"lateness_us", microseconds(timing.lateness.percentiles())},
            {"tick_us", microseconds(timing.work.percentiles())},
            {"tasks_us", tasks}};
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

nlohmann::json scoreFigures(const haptics::Score& score)
{
    nlohmann::json out;
    for (const haptics::Measure& m : haptics::measures()) {
        out[m.key] = m.value(score);
    }
    const haptics::ScoreParts points = haptics::parts(score);
    for (const haptics::PartOfTotal& part : haptics::partsOfTotal) {
        out["points"][part.key] = points.*part.points;
    }
    return out;
}

}  // namespace palpate::session
