#pragma once

#include <haptics/recorder.h>

#include <tests/folder.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::haptics::synthetic {

using tests::Folder;

inline SessionInfo info()
{
    SessionInfo i;
    i.scene = "breast <phantom> & \"more\"";
    i.sceneText = "name = \"breast\"\n[tool]\nkind = \"needle\"\n# </script><b>not markup</b>\n";
    i.sceneOrigin = "scenes/breast.toml";
    i.volumeHash = "0123456789abcdef";
    i.model = "elastic";
    i.device = "hand";
    i.build = "0.1.0 (synthetic)";
    i.name = "train-7";
    i.operatorName = "P-07";
    i.host = "bench";
    i.started = "2026-11-21T14:03:07Z";
    i.rate = 1000;
    i.seed = 18446744073709551615ULL;
    i.structures = {"tumour", "chest wall", "vessel"};
    i.tissues = {"air", "skin", "fat", "gland", "tumour"};
    i.warnDistances = {0, 0.010, 0.008};
    i.extra = {{"tool", "14 G needle"}, {"spacing_mm", "1.5"}};
    return i;
}

/// Depth of the tip at times, straight in between [s, m]; negative is outside.
struct Key {
    double time, depth;
};

inline double depthAt(const std::vector<Key>& keys, double t)
{
    for (std::size_t i = 1; i < keys.size(); ++i) {
        if (t <= keys[i].time) {
            const double part = (t - keys[i - 1].time) / (keys[i].time - keys[i - 1].time);
            return keys[i - 1].depth + part * (keys[i].depth - keys[i - 1].depth);
        }
    }
    return keys.back().depth;
}

inline Event event(EventKind kind, std::uint8_t structure, std::uint8_t tissue, double value)
{
    return {kind, structure, tissue, value};
}

inline void addEvent(TickRecord& r, const Event& e)
{
    r.events[r.eventCount++] = e;
}

// What a tick of procedure() reports; a skill of 0 or more fires the gun.
inline void addProcedureEvents(TickRecord& r, Phase before, double force, bool& warned, double skill)
{
    if (before == Phase::free && r.phase != Phase::free) {
        addEvent(r, event(EventKind::contact, 0xFF, 1, 0.02));
    }
    if (before == Phase::contact && r.phase == Phase::inserted) {
        addEvent(r, event(EventKind::puncture, 0xFF, 1, force));
    }
    if (before != Phase::free && r.phase == Phase::free) {
        addEvent(r, event(EventKind::release, 0xFF, 0, 0));
    }
    if (!warned && r.distance[2] < 0.008) {
        warned = true;
        addEvent(r, event(EventKind::warning, 2, 0, r.distance[2]));
    }
    if (skill >= 0) {
        r.fired = true;
        r.core.fraction[3] = 1 - (0.3 + 0.6 * skill);
        r.core.fraction[4] = 0.3 + 0.6 * skill;
        r.core.volume = 3.4e-8;
        r.core.targetFraction = 0.3 + 0.6 * skill;
        r.core.targetLength = 0.02 * r.core.targetFraction;
        r.core.notchStart = {0.02, r.device.position.y, 0.01};
        r.core.notchEnd = {0.02, r.device.position.y + 0.02, 0.01};
        addEvent(r, event(EventKind::fire, 0, 4, 0.004 * (1 - skill)));
    }
}

/// A procedure on a body whose skin is the plane y = 0, with the target at 50 mm and a vessel beyond it: in, out by 15 mm,
/// in again, fire, out. `skill` from 0 to 1 shortens and steadies it.
inline std::vector<TickRecord> procedure(double seconds, double skill, std::uint32_t seed)
{
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 1);
    const double end = seconds;
    const std::vector<Key> keys{{0, -0.03},
                                {0.15 * end, 0},
                                {0.40 * end, 0.045},
                                {0.48 * end, 0.030 + 0.012 * skill},
                                {0.62 * end, 0.052 + 0.006 * (1 - skill)},
                                {0.75 * end, 0.052 + 0.006 * (1 - skill)},
                                {0.97 * end, -0.005},
                                {end, -0.03}};
    const auto count = static_cast<std::uint64_t>(seconds * 1000);
    std::vector<TickRecord> ticks(count);
    Phase before = Phase::free;
    double lastDepth = -0.03;
    bool warned = false;
    for (std::uint64_t n = 0; n < count; ++n) {
        TickRecord& r = ticks[n];
        r.tick = n;
        const double t = static_cast<double>(n) / 1000;
        const double depth = depthAt(keys, t);
        const double sway = (1 - skill) * 1e-3 * std::sin(9 * t);
        r.device.position = {0.02 + sway, depth, 0.01};
        r.device.buttons = buttonDeadMan;
        r.device.fresh = n % 50 != 7;
        r.phase = depth > 0.002 ? Phase::inserted : depth > 0 ? Phase::contact : Phase::free;
        r.proxy = {0.02, std::min(depth, 0.0), 0.01};
        r.inserted = r.phase == Phase::inserted ? depth : 0;
        r.tissue = static_cast<std::uint8_t>(depth <= 0 ? 0 : depth < 0.003 ? 1 : depth < 0.02 ? 2 : depth < 0.045 ? 3 : 4);
        const double sign = depth >= lastDepth ? -1.0 : 1.0;
        const double force = depth <= 0 ? 0 : 0.6 + 55 * depth + (r.phase == Phase::contact ? 400 * depth : 0);
        r.basic = {0.0, sign * force, 0.02 * noise(random)};
        r.tissueForce = 1.1 * r.basic;
        r.distance[0] = 0.050 - depth;
        r.distance[1] = 0.080 - depth;
        r.distance[2] = std::hypot(0.062 - depth, 0.001);
        r.nearestVital = r.distance[2] < r.distance[1] ? 2 : 1;
        r.additional = {0.0, r.distance[2] < 0.01 ? -0.8 * (1 - r.distance[2] / 0.01) : 0.0, 0.0};
        r.total = r.basic + r.additional;
        r.contacts = depth > 0 ? 12 : 0;
        r.moved = depth > 0 ? 900 + static_cast<std::uint32_t>(random() % 200) : 0;
        r.residual = depth > 0 ? 1e-5 : 0;
        for (std::size_t k = 0; k < taskCount; ++k) {
            r.seconds[k] = static_cast<float>((k == 2 ? 180e-6 : 9e-6) * std::exp(0.25 * noise(random)));
        }
        const bool firing = n == static_cast<std::uint64_t>(0.70 * seconds * 1000);
        addProcedureEvents(r, before, force, warned, firing ? skill : -1);
        before = r.phase;
        lastDepth = depth;
    }
    return ticks;
}

/// A double of any bits that is not "not a number": subnormals, both zeros, infinities.
inline double anyDouble(std::mt19937_64& random)
{
    constexpr double special[] = {0.0,
                                  -0.0,
                                  1.0,
                                  -3.0,
                                  9007199254740993.0,
                                  -9.2233720368547758e18,
                                  std::numeric_limits<double>::infinity(),
                                  -std::numeric_limits<double>::infinity(),
                                  std::numeric_limits<double>::denorm_min(),
                                  std::numeric_limits<double>::max()};
    if (random() % 3 == 0) {
        return special[random() % std::size(special)];
    }
    const auto value = std::bit_cast<double>(random());
    return std::isnan(value) ? 0.5 : value;
}

/// A vector of any bits of at most this length.
inline Vec3 anyVector(double longest, std::mt19937_64& random)
{
    std::uniform_real_distribution<double> part(-0.5 * longest, 0.5 * longest);
    Vec3 v(part(random), part(random), part(random));
    v[static_cast<int>(random() % 3)] = random() % 2 == 0 ? -0.0 : std::numeric_limits<double>::denorm_min();
    return v;
}

/// A tick with every field that a record holds at random, within what a record may hold.
inline TickRecord anyTick(std::uint64_t tick, std::mt19937_64& random)
{
    TickRecord r;
    r.tick = tick;
    r.device.position = anyVector(10, random);
    const Vec3 axis = anyVector(1, random);
    r.device.axis = axis / std::sqrt(axis.x * axis.x + axis.y * axis.y + axis.z * axis.z);
    for (Vec3* v : {&r.basic, &r.additional, &r.total}) {
        *v = anyVector(1000, random);
    }
    for (Vec3* v : {&r.proxy, &r.tissueForce}) {
        *v = {anyDouble(random), anyDouble(random), anyDouble(random)};
    }
    r.device.buttons = static_cast<std::uint32_t>(random());
    r.device.fresh = random() % 2 == 0;
    r.phase = static_cast<Phase>(random() % 3);
    r.tissue = static_cast<std::uint8_t>(random() % 5);
    r.nearestVital = random() % 4 == 0 ? std::uint8_t{0xFF} : static_cast<std::uint8_t>(random() % 3);
    r.faulted = random() % 2 == 0;
    r.inserted = anyDouble(random);
    r.residual = anyDouble(random);
    r.penetration = anyDouble(random);
    for (std::size_t i = 0; i < 3; ++i) {
        r.distance[i] = anyDouble(random);
    }
    r.contacts = static_cast<std::uint32_t>(random());
    r.moved = static_cast<std::uint32_t>(random());
    for (float& s : r.seconds) {
        s = std::ldexp(static_cast<float>(random() % 16777216), -40);
    }
    r.eventCount = static_cast<std::uint32_t>(random() % 20 == 0 ? random() % (maxEventsPerTick + 1) : 0);
    for (std::uint32_t i = 0; i < r.eventCount; ++i) {
        r.events[i] = {static_cast<EventKind>(random() % 7),
                       random() % 2 == 0 ? std::uint8_t{0xFF} : static_cast<std::uint8_t>(random() % 3),
                       static_cast<std::uint8_t>(random() % 5), anyDouble(random)};
    }
    r.fired = random() % 50 == 0;
    if (r.fired) {
        std::uniform_real_distribution<double> fraction(0, 1);
        for (std::size_t i = 0; i < 5; ++i) {
            r.core.fraction[i] = random() % 2 == 0 ? 0.0 : fraction(random);
        }
        r.core.volume = 1e-8 * fraction(random);
        r.core.targetFraction = fraction(random);
        r.core.targetLength = 0.02 * fraction(random);
        r.core.notchStart = anyVector(10, random);
        r.core.notchEnd = anyVector(10, random);
    }
    return r;
}

inline void record(const std::filesystem::path& file, const SessionInfo& session, const std::vector<TickRecord>& ticks,
                   const std::vector<std::pair<std::string, std::string>>& results = {})
{
    Recorder recorder(file, session);
    for (const TickRecord& tick : ticks) {
        recorder.push(tick);
        if (tick.tick % 4000 == 3999) {
            recorder.flush();
        }
    }
    recorder.finish(results);
}

inline std::vector<TickRecord> read(const Record& record)
{
    std::vector<TickRecord> ticks;
    record.each([&](const TickRecord& tick) { ticks.push_back(tick); });
    return ticks;
}

}  // namespace palpate::haptics::synthetic
