#pragma once

#include <base/fnv.h>
#include <haptics/device.h>
#include <haptics/recorder.h>
#include <haptics/session_model.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace palpate::haptics {

/// A hash of every bit of every force that was sent, in order (64-bit FNV-1a over basic, additional, total).
class ForceHash {
public:
    void add(const TickRecord& record) noexcept;
    std::uint64_t value() const noexcept { return hash_.value; }

private:
    base::Fnv hash_;
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

/// A value of a record that is not the one that was computed again.
struct Difference {
    std::string what;                  // "total_x_n", "puncture of tissue skin", ..
    std::uint64_t firstTick = 0;       // that has it
    std::uint64_t ticks = 0;           // that have it
    std::string recorded, recomputed;  // in the first tick
};

/// Compares the ticks of a record with those computed again: every column but the times of the tasks, events and cores,
/// bit by bit.
class TickComparison {
public:
    /// What older formats do not have is not compared.
    explicit TickComparison(const Record& record);

    /// True when they are the same.
    bool add(const TickRecord& then, const TickRecord& now);
    /// In the order in which they were found.
    const std::vector<Difference>& differences() const noexcept { return differences_; }
    /// The first two and how many there are, in one line; empty where there is none.
    std::string inWords() const;

private:
    void found(std::uint64_t tick, const std::string& what, std::string recorded, std::string recomputed);
    void compareColumns(const TickRecord& then, const TickRecord& now);
    void compareEvents(const TickRecord& then, const TickRecord& now);
    void compareCores(const TickRecord& then, const TickRecord& now);

    std::size_t structures_;
    bool probe_;
    int format_;
    std::vector<std::string> tissues_;
    std::vector<Difference> differences_;
    std::uint64_t count_ = 0;  // of all differences, tick by tick
};

/// What a replay found.
struct ReplayResult {
    std::uint64_t ticks = 0;
    bool identical = true;                         // all that is computed again, and what the session said of it at its end
    std::optional<std::uint64_t> firstDifference;  // tick
    double largestDifference = 0;                  // of a total force [N]
    std::uint64_t forceHash = 0;
    std::vector<Difference> differences;
    std::string inWords;  // the first of them
};

/// Feeds a record's poses to a fresh simulation and compares all that it computes, bit by bit. Throws std::runtime_error
/// for a record with holes or without ticks.
ReplayResult replay(const Record& record, const SessionModel& model);

/// A hash of what forces depend on: tissue table, grids, labels' counts, lattice and fields (64-bit FNV-1a, in
/// hexadecimal). A record keeps it, so that it is never replayed on another volume.
std::string modelHash(const SessionModel& model);
/// A hash of the body alone: tissue table, labels' counts, where the skin is and how stiff it is where. The same however
/// finely the tissue model divides it, and whatever is done in it.
std::string bodyHash(const SessionModel& model);
/// What a record says of a session that only its model decides: all but where the scene came from, the device and the
/// build.
SessionInfo infoOf(const SessionModel& model);
/// Where a record says something else of its session than its scene does, in words; empty where it does not.
std::string contradictionIn(const SessionInfo& info, const SessionModel& model);

}  // namespace palpate::haptics
