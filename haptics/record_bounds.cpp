#include <haptics/record_bounds.h>

#include <base/error.h>
#include <haptics/record_format.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

namespace palpate::haptics::format {

namespace {

constexpr double furthest = 10.0;     // from the patient's origin [m]
constexpr double unitWithin = 2e-3;   // length of an axis; the simulation takes half of it
constexpr double largestCore = 1e-3;  // [m^3]
constexpr double longestTask = 3600;  // [s]
constexpr double rounding = 1e-9;     // of shares

void checkName(const char* what, const std::string& text)
{
    const bool control =
        std::ranges::any_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; });
    base::failIf(control, "{} has control characters", what);
    base::failIf(text.size() > longestName, "{} has {} bytes: {} at most", what, text.size(), longestName);
}

struct Bounds {
    const TickRecord& tick;

    void within(const char* what, double value, double low, double high) const
    {
        // The negation also catches what is not a number.
        base::failIf(!(value >= low && value <= high), "tick {}: {} is {:g}, outside {:g} to {:g}", tick.tick, what, value,
                     low, high);
    }

    void row(const char* what, std::size_t index, std::size_t count) const
    {
        base::failIf(index >= std::max<std::size_t>(count, 1), "tick {}: {} is {}, and the session has {}", tick.tick, what,
                     index, count);
    }

    void optionalRow(const char* what, std::uint8_t index, std::size_t count) const
    {
        if (index != none) {
            row(what, index, count);
        }
    }

    void place(const char* what, Vec3 v) const { within(what, glm::length(v), 0, furthest); }

    void force(const char* what, Vec3 v) const { within(what, glm::length(v), 0, strongestForce); }
};

void checkCore(const Bounds& check, const CoreSample& core, std::size_t tissues)
{
    check.within("target_fraction of the core", core.targetFraction, -rounding, 1 + rounding);
    check.within("target_length_m of the core", core.targetLength, 0, furthest);
    check.within("volume_m3 of the core", core.volume, 0, largestCore);
    check.place("notch_start of the core [m]", core.notchStart);
    check.place("notch_end of the core [m]", core.notchEnd);
    for (std::size_t i = 0; i < maxTissues; ++i) {
        check.within("fraction of the core", core.fraction[i], 0, i < tissues ? 1 + rounding : 0);
    }
}

}  // namespace

void checkInfo(const SessionInfo& info)
{
    base::failIf(!(info.rate >= slowestRate && info.rate <= fastestRate), "a rate of {:g} Hz is outside {:g} to {:g} Hz",
                 info.rate, slowestRate, fastestRate);
    base::failIf(info.structures.size() > maxStructures || info.tissues.size() > maxTissues,
                 "{} structures and {} tissues: at most {} structures and {} tissues fit into a "
                 "record",
                 info.structures.size(), info.tissues.size(), maxStructures, maxTissues);
    checkName("the operator", info.operatorName);
    checkName("the host", info.host);
    checkName("the date", info.started);
    checkName("the session's name", info.name);
    for (const std::string& name : info.structures) {
        checkName("the name of a structure", name);
    }
    for (const std::string& name : info.tissues) {
        checkName("the name of a tissue", name);
    }
    std::set<std::string_view> keys;
    for (const auto& [key, value] : info.extra) {
        base::failIf(!keys.insert(key).second, "extra has key '{}' twice", key);
    }
    for (const double distance : info.warnDistances) {
        base::failIf(!(distance >= 0 && distance <= furthest), "a warning distance of {:g} m is outside 0 to {:g} m",
                     distance, furthest);
    }
}

void checkTick(const TickRecord& t, const SessionInfo& info)
{
    const Bounds check{t};
    const std::size_t structures = info.structures.size(), tissues = info.tissues.size();
    check.place("the tip's distance from the origin [m]", t.device.position);
    check.within("the length of the axis", glm::length(t.device.axis), 1 - unitWithin, 1 + unitWithin);
    check.force("basic force [N]", t.basic);
    check.force("additional force [N]", t.additional);
    check.force("total force [N]", t.total);
    check.row("tissue", t.tissue, tissues);
    check.row("ahead_tissue", t.ahead.tissue, tissues);
    check.optionalRow("nearest_vital", t.nearestVital, structures);
    check.optionalRow("warned", t.warned, structures);
    for (std::size_t i = 0; i < structures && i < maxStructures; ++i) {
        base::failIf(!t.faulted && (std::isnan(t.distance[i]) || std::isnan(t.ahead.structure[i])),
                     "tick {}: the distance to structure {} is not a number", t.tick, i);
    }
    for (const float seconds : t.seconds) {
        check.within("the time of a task [s]", static_cast<double>(seconds), 0, longestTask);
    }
    for (std::uint32_t i = 0; i < std::min<std::size_t>(t.eventCount, maxEventsPerTick); ++i) {
        check.optionalRow("structure of an event", t.events[i].structure, structures);
        check.row("tissue of an event", t.events[i].tissue, tissues);
    }
    if (info.probe) {
        check.place("the probe's distance from the origin [m]", t.probeFace);
        check.within("the length of the probe's axis", glm::length(t.probeAxis), 1 - unitWithin, 1 + unitWithin);
        check.within("the length of the probe's lateral", glm::length(t.probeLateral), 1 - unitWithin, 1 + unitWithin);
        check.force("the probe's force [N]", t.probeForce);
        check.within("needle_in_beam_m", t.needleInBeam, 0, furthest);
    }
    if (t.fired) {
        checkCore(check, t.core, tissues);
    }
}

}  // namespace palpate::haptics::format
