#include <report/data.h>

#include <base/mapped.h>
#include <base/quantiles.h>
#include <base/words.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::report {

namespace {

constexpr std::size_t pointsPerChart = 4000;
constexpr double depthBin = 0.5;          // [mm]
constexpr double directionLength = 0.25;  // a change of direction shorter than this is noise [mm]
constexpr double pathStep = 0.5;          // [mm]
constexpr std::size_t markedEvents = 200;
constexpr std::size_t maxEntries = 500;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

TaskTime percentiles(const std::vector<float>& seconds)
{
    const std::vector<double> all(seconds.begin(), seconds.end());
    const auto at = [&](double part) { return base::lowerQuantile(all, part) * 1e6; };
    return {at(0.5), at(0.99), at(1)};
}

// Sorts ticks into bins of depth, by direction.
class ProfileBuilder {
public:
    void add(double depth, double force)
    {
        if (!std::isfinite(depth) || depth <= 0 || depth > 1000) {
            turn_ = 0;
            entering_ = true;
            return;
        }
        turn_ = entering_ ? std::max(turn_, depth) : std::min(turn_, depth);
        if (std::abs(depth - turn_) > directionLength) {
            entering_ = !entering_;
            turn_ = depth;
        }
        const auto bin = static_cast<std::size_t>(depth / depthBin);
        bins_.resize(std::max(bins_.size(), bin + 1));
        Bin& b = bins_[bin];
        Sum& sum = entering_ ? b.in : b.out;
        sum.force += force;
        ++sum.ticks;
        b.peak = entering_ ? std::max(b.peak, force) : b.peak;
    }

    DepthProfile finish() const
    {
        DepthProfile p;
        for (std::size_t i = 0; i < bins_.size(); ++i) {
            const Bin& b = bins_[i];
            p.depth.push_back((static_cast<double>(i) + 0.5) * depthBin);
            p.in.push_back(b.in.mean());
            p.peak.push_back(b.in.ticks > 0 ? b.peak : nothing);
            p.out.push_back(b.out.mean());
        }
        return p;
    }

private:
    struct Sum {
        double force = 0;
        std::uint64_t ticks = 0;
        double mean() const { return ticks > 0 ? force / static_cast<double>(ticks) : nothing; }
    };
    struct Bin {
        Sum in, out;
        double peak = 0;
    };
    std::vector<Bin> bins_;
    double turn_ = 0;
    bool entering_ = true;
};

// The running sums of collect().
struct Collector {
    Collector(const haptics::SessionInfo& info, std::uint64_t ticks)
        : rate(info.rate),
          structures(std::min(info.structures.size(), haptics::maxStructures)),
          watch(info),
          forces(4, ticks, pointsPerChart),
          distances(2 + structures, ticks, pointsPerChart),
          energy(3, ticks, pointsPerChart),
          row(2 + structures)
    {
        whole.reserve(ticks);
    }

    void add(const haptics::TickRecord& r)
    {
        const double seconds = static_cast<double>(r.tick) / rate;
        const double total = glm::length(r.total);
        watch.add(r);
        forces.add({seconds, glm::length(r.basic), glm::length(r.additional), total});
        energy.add({seconds, r.energy * 1e3, r.damped * 1e3});
        row[0] = seconds;
        row[1] = r.inserted * 1e3;
        for (std::size_t i = 0; i < structures; ++i) {
            row[2 + i] = r.distance[i] * 1e3;
        }
        distances.add(row);
        profile.add(r.inserted * 1e3, total);
        addNearest(r);
        addPath(r);
        float sum = 0;
        for (std::size_t i = 0; i < haptics::taskCount; ++i) {
            tasks[i].push_back(r.seconds[i]);
            sum += r.seconds[i];
        }
        whole.push_back(sum);
        data.eventCount += r.eventCount;
        for (std::size_t i = 0; i < r.eventCount && data.events.size() < markedEvents; ++i) {
            data.events.push_back({seconds, r.events[i]});
        }
        if (r.fired) {
            data.cores.push_back({seconds, r.core});
        }
        data.seconds = seconds;
        data.faulted = data.faulted || r.faulted;
        stale += r.device.fresh ? 0 : 1;
        ++data.ticks;
    }

    void addNearest(const haptics::TickRecord& r)
    {
        const double depth = r.inserted * 1e3;
        if (!(depth > 0 && depth < 1000)) {
            furthest = 0;
            return;
        }
        // On the way in: on the way out the tissue hangs on the needle, and the two ways alternate from bin to bin.
        if (depth < furthest - depthBin) {
            return;
        }
        furthest = std::max(furthest, depth);
        const auto bin = static_cast<std::size_t>(depth / depthBin);
        nearest.resize(std::max(nearest.size(), bin + 1), std::vector<double>(structures, nothing));
        for (std::size_t i = 0; i < structures; ++i) {
            double& least = nearest[bin][i];
            least = least < r.distance[i] * 1e3 ? least : r.distance[i] * 1e3;
        }
    }

    void addPath(const haptics::TickRecord& r)
    {
        const PathPoint point{r.tip() * 1e3, r.phase == haptics::Phase::inserted};
        if (data.path.empty() || data.path.back().inside != point.inside ||
            glm::distance(data.path.back().tip, point.tip) > pathStep) {
            data.path.push_back(point);
        }
        if (r.phase != haptics::Phase::free && outside && ++data.entryCount <= maxEntries) {
            data.entries.push_back(point.tip);
        }
        outside = r.phase == haptics::Phase::free;
    }

    // Bins as columns.
    std::vector<std::vector<double>> nearestColumns() const
    {
        std::vector<std::vector<double>> columns(1 + structures);
        for (std::size_t bin = 0; bin < nearest.size(); ++bin) {
            columns[0].push_back((static_cast<double>(bin) + 0.5) * depthBin);
            for (std::size_t i = 0; i < structures; ++i) {
                columns[1 + i].push_back(nearest[bin][i]);
            }
        }
        return columns;
    }

    double rate;
    std::size_t structures;
    bool outside = true;
    double furthest = 0;                       // inside, on this way in [mm]
    std::vector<std::vector<double>> nearest;  // by bin, then structure [mm]
    haptics::LossWatch watch;
    Decimator forces, distances, energy;
    std::vector<double> row;
    ProfileBuilder profile;
    std::array<std::vector<float>, haptics::taskCount> tasks;
    std::vector<float> whole;
    std::uint64_t stale = 0;
    ReportData data;
};

}  // namespace

Decimator::Decimator(std::size_t columns, std::uint64_t rows, std::size_t limit)
    : rows_(std::max<std::uint64_t>(rows, 1)),
      buckets_(std::max<std::uint64_t>(limit / (2 * (columns - 1)), 1)),
      low_(columns),
      high_(columns)
{
}

void Decimator::add(const std::vector<double>& row)
{
    // Rows beyond the number that was told, of a session that still runs, fall into the last bucket.
    const std::uint64_t bucket = std::min(index_ * buckets_ / rows_, buckets_ - 1);
    if (bucket != bucket_) {
        closeBucket();
        bucket_ = bucket;
    }
    last_ = {index_, row};
    if (index_ == 0) {
        kept_.push_back(last_);
    }
    for (std::size_t c = 1; c < low_.size(); ++c) {
        if (!std::isfinite(row[c])) {
            continue;
        }
        if (!low_[c] || row[c] < low_[c]->row[c]) {
            low_[c] = last_;
        }
        if (!high_[c] || row[c] > high_[c]->row[c]) {
            high_[c] = last_;
        }
    }
    ++index_;
}

void Decimator::closeBucket()
{
    for (auto* extremes : {&low_, &high_}) {
        for (std::optional<Kept>& row : *extremes) {
            if (row) {
                kept_.push_back(std::move(*row));
                row.reset();
            }
        }
    }
}

std::vector<std::vector<double>> Decimator::finish()
{
    closeBucket();
    if (index_ > 0) {
        kept_.push_back(last_);
    }
    std::ranges::sort(kept_, {}, &Kept::index);
    const auto repeated = std::ranges::unique(kept_, {}, &Kept::index);
    kept_.erase(repeated.begin(), repeated.end());
    std::vector<std::vector<double>> columns(low_.size());
    for (const Kept& kept : kept_) {
        for (std::size_t c = 0; c < columns.size(); ++c) {
            columns[c].push_back(kept.row[c]);
        }
    }
    return columns;
}

ReportData collect(const haptics::Record& record)
{
    Collector c(record.info(), record.ticks());
    record.each([&](const haptics::TickRecord& tick) { c.add(tick); });
    c.data.score = c.watch.score();
    c.data.marks = base::mapped<Vec3>(c.watch.marks(), [](Vec3 mark) { return mark * 1e3; });
    const base::English page;  // all of it is
    c.data.losses = c.watch.losses(record.info());
    c.data.forces = c.forces.finish();
    c.data.distances = c.distances.finish();
    c.data.energy = c.energy.finish();
    c.data.profile = c.profile.finish();
    c.data.nearest = c.nearestColumns();
    for (std::size_t i = 0; i < haptics::taskCount; ++i) {
        c.data.tasks[i] = percentiles(c.tasks[i]);
    }
    c.data.tick = percentiles(c.whole);
    c.data.missing = c.data.ticks > 0 ? static_cast<double>(c.stale) / static_cast<double>(c.data.ticks) : 0;
    return std::move(c.data);
}

}  // namespace palpate::report
