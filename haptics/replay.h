#pragma once

#include <haptics/device.h>
#include <haptics/recorder.h>
#include <haptics/session_model.h>

#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::haptics {

/// A hash of every bit of every force that was sent, in order (64-bit FNV-1a over basic, additional, total).
class ForceHash {
public:
    void add(const TickRecord& record) noexcept;
    std::uint64_t value() const noexcept { return hash_; }

private:
    std::uint64_t hash_ = 0xcbf29ce484222325;
};

/// Plays the poses of a record to a live session, whose forces it does not feel.
class ReplayDevice final : public Device {
public:
    explicit ReplayDevice(const Record& record);

    DeviceSample read() noexcept override;
    void write(Vec3) noexcept override {}
    bool finished() const noexcept override { return next_ >= samples_.size(); }

private:
    std::vector<DeviceSample> samples_;
    std::size_t next_ = 0;
};

/// What a replay found.
struct ReplayResult {
    std::uint64_t ticks = 0;
    bool identical = true;
    std::optional<std::uint64_t> firstDifference;  // tick
    double largestDifference = 0;                  // of a total force [N]
    std::uint64_t forceHash = 0;
};

/// Feeds a record's poses to a fresh simulation and compares every force, bit by bit. Throws std::runtime_error for a
/// record with holes or without ticks.
ReplayResult replay(const Record& record, const SessionModel& model);

/// A hash of what forces depend on: tissue table, grids, labels' counts, lattice and fields (64-bit FNV-1a, in
/// hexadecimal). A record keeps it, so that it is never replayed on another volume.
std::string modelHash(const SessionModel& model);
/// What a record says of a session that only its model decides: all but where the scene came from, the device and the
/// build.
SessionInfo infoOf(const SessionModel& model);

}  // namespace palpate::haptics
