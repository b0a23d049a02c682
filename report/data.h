#pragma once

// What a report draws, collected in one pass over a record.

#include <haptics/losses.h>
#include <haptics/recorder.h>
#include <haptics/score.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace palpate::report {

/// Thins out rows of a known number to about `limit`, so that no peak is lost: of each bucket stay the rows in which a
/// column has its smallest and largest value. The first and the last row always stay.
class Decimator {
public:
    /// Column 0 is the abscissa.
    Decimator(std::size_t columns, std::uint64_t rows, std::size_t limit);
    void add(const std::vector<double>& row);
    /// By column; not finite where a value was not.
    std::vector<std::vector<double>> finish();

private:
    struct Kept {
        std::uint64_t index;
        std::vector<double> row;
    };
    void closeBucket();

    std::uint64_t rows_, buckets_, index_ = 0, bucket_ = 0;
    std::vector<std::optional<Kept>> low_, high_;  // by column
    std::vector<Kept> kept_;
    Kept last_{};
};

/// Force by inserted depth: mean and largest while going in, mean while coming out. NaN where there was no tick.
struct DepthProfile {
    std::vector<double> depth;          // middle of each bin [mm]
    std::vector<double> in, peak, out;  // [N]
};

/// A point of the tip's path.
struct PathPoint {
    Vec3 tip{0.0};  // patient frame [mm]
    bool inside = false;
};

struct MarkedEvent {
    double seconds = 0;
    haptics::Event event;
};

struct Core {
    double seconds = 0;
    haptics::CoreSample sample;
};

/// Wall time of a task in a tick [us].
struct TaskTime {
    double p50 = 0, p99 = 0, largest = 0;
};

struct ReportData {
    haptics::Score score;
    std::vector<haptics::Loss> losses;  // the largest first
    double seconds = 0;                 // of the record
    std::uint64_t ticks = 0;
    std::vector<std::vector<double>> forces;     // seconds; basic, additional, total [N]
    std::vector<std::vector<double>> distances;  // seconds; inserted depth, then each structure [mm]
    std::vector<std::vector<double>> energy;     // seconds; given to the hand, taken by damping [mJ]
    DepthProfile profile;
    std::vector<std::vector<double>>
        nearest;  // by bin of the profile: its depth, then the least distance to each structure, going in [mm]
    std::vector<PathPoint> path;  // thinned out to steps of half a millimetre
    std::vector<Vec3> entries;    // where the tip first touched the body on each way in; the first 500 [mm]
    std::uint64_t entryCount = 0;
    std::vector<Vec3> marks;          // where the trainee marked something [mm]
    std::vector<MarkedEvent> events;  // the first 200
    std::uint64_t eventCount = 0;
    std::vector<Core> cores;
    std::array<TaskTime, haptics::taskCount> tasks{};
    TaskTime tick;       // all tasks together
    double missing = 0;  // fraction of ticks without a fresh pose
    bool faulted = false;
};

ReportData collect(const haptics::Record& record);

}  // namespace palpate::report
