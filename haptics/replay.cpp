#include <haptics/replay.h>

#include <haptics/simulation.h>

#include <fmt/format.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cstring>
#include <span>

namespace palpate::haptics {

namespace {

std::uint64_t fnv(std::uint64_t hash, std::span<const std::byte> bytes) noexcept
{
    for (const std::byte b : bytes) {
        hash = (hash ^ static_cast<std::uint64_t>(b)) * 0x100000001b3;
    }
    return hash;
}

bool sameBits(Vec3 a, Vec3 b) noexcept
{
    return std::memcmp(&a, &b, sizeof a) == 0;
}

}  // namespace

void ForceHash::add(const TickRecord& record) noexcept
{
    for (const Vec3& f : {record.basic, record.additional, record.total}) {
        hash_ = fnv(hash_, std::as_bytes(std::span(&f, 1)));
    }
}

ReplayDevice::ReplayDevice(const Record& record)
{
    samples_.reserve(record.ticks());
    record.each([&](const TickRecord& tick) { samples_.push_back(tick.device); });
}

DeviceSample ReplayDevice::read() noexcept
{
    return samples_[next_++];
}

ReplayResult replay(const Record& record, const SessionModel& model)
{
    Simulation simulation(model);
    ReplayResult result;
    ForceHash hash;
    record.each([&](const TickRecord& then) {
        const TickRecord& now = simulation.tick(then.device);
        hash.add(now);
        ++result.ticks;
        if (sameBits(now.basic, then.basic) && sameBits(now.additional, then.additional) &&
            sameBits(now.total, then.total)) {
            return;
        }
        result.largestDifference = std::max(result.largestDifference, glm::distance(now.total, then.total));
        if (result.identical) {
            result.identical = false;
            result.firstDifference = then.tick;
        }
    });
    result.forceHash = hash.value();
    return result;
}

std::string modelHash(const SessionModel& model)
{
    std::uint64_t hash = 0xcbf29ce484222325;
    hash = fnv(hash, std::as_bytes(std::span(model.lattice.tissue)));
    hash = fnv(hash, std::as_bytes(std::span(model.surface.values)));
    hash = fnv(hash, std::as_bytes(std::span(model.youngsModulus.values)));
    for (const auto& s : model.structures) {
        hash = fnv(hash, std::as_bytes(std::span(s.distance.values)));
    }
    return fmt::format("{:016x}", hash);
}

}  // namespace palpate::haptics
