#include <session/rehearsal.h>

#include <base/processor_time.h>
#include <haptics/simulation.h>
#include <haptics/timing.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

namespace palpate::session {

constexpr int ticks = 40;
constexpr double stride = 1e-4;   // of the tool per tick [m]
constexpr double patience = 0.3;  // [s]
constexpr double pacedLimit = 5 * haptics::tickSeconds;
constexpr double unpacedLimit = 60 * haptics::tickSeconds;

Rehearsal rehearse(const haptics::SessionModel& model)
{
    haptics::Simulation simulation(model);
    const bool needle = model.scene.tool.kind == datasets::ToolKind::needle;
    const Vec3 way = glm::normalize(model.approach.aim - model.approach.entry);
    const Vec3 touch = model.approach.entry - (needle ? 0.0 : model.scene.tool.radius) * way;
    haptics::DeviceSample sample{.position = touch, .axis = way, .buttons = haptics::buttonDeadMan};
    haptics::Histogram times, outside;
    double spent = 0;
    for (int i = 0; i < ticks && spent < patience; ++i) {
        sample.position = touch + stride * i * way;
        const double start = base::processorTime();
        const haptics::Phase phase = simulation.tick(sample).phase;
        const double took = base::processorTime() - start;
        spent += took;
        // The first, in the air, cost nothing: on a slow machine they would be half of all.
        (phase == haptics::Phase::free ? outside : times).add(took);
    }
    const haptics::Percentiles p = (times.count() > 0 ? times : outside).percentiles();
    return {p.p50, p.max};
}

std::string whyTooSlow(const Rehearsal& rehearsal, bool paced)
{
    if (rehearsal.p50 <= (paced ? pacedLimit : unpacedLimit)) {
        return "";
    }
    const std::string takes = fmt::format("a tick of this model takes {:.0f} ms here ({:.0f} ms at worst)",
                                          1e3 * rehearsal.p50, 1e3 * rehearsal.worst);
    return paced ? fmt::format("{}, and there is {:.0f} ms: choose a coarser [model] or --setting, or go on with --anyway",
                               takes, 1e3 * haptics::tickSeconds)
                 : fmt::format(
                       "{}, so that a second of the session takes {:.0f} s: choose a coarser [model] or --setting, "
                       "or go on with --anyway",
                       takes, rehearsal.p50 / haptics::tickSeconds);
}

}  // namespace palpate::session
