#include <haptics/record_format.h>
#include <haptics/replay.h>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

namespace palpate::haptics {

namespace {

// A value as bits that are the same where the values are; one "not a number" is as good as another.
std::uint64_t bitsOf(double v)
{
    return std::bit_cast<std::uint64_t>(std::isnan(v) ? std::nan("") : v);
}

// The columns of a tick, of which times of tasks are none: they are measured and not computed.
struct Columns {
    static constexpr std::size_t most = 128;
    std::array<const char*, most> name{};
    std::array<std::uint64_t, most> bits{};
    std::array<bool, most> real{};
    std::size_t count = 0;

    void operator()(const char* n, const double& v) { put(n, bitsOf(v), true); }
    void operator()(const char*, const format::Microseconds<const float>&) {}
    void operator()(const char* n, const format::OptionalIndex<const std::uint8_t>& v) { put(n, v.value, false); }
    template <class IntegerOrEnum>
    void operator()(const char* n, const IntegerOrEnum& v)
    {
        put(n, static_cast<std::uint64_t>(v), false);
    }

    std::string text(std::size_t i) const
    {
        return real[i] ? fmt::format("{:.17g}", std::bit_cast<double>(bits[i])) : fmt::format("{}", bits[i]);
    }

private:
    void put(const char* n, std::uint64_t value, bool isReal)
    {
        if (count < most) {
            name[count] = n;
            bits[count] = value;
            real[count++] = isReal;
        }
    }
};

Columns columnsOf(const TickRecord& tick, const format::TickColumns& of)
{
    Columns columns;
    format::eachColumn(tick, of, columns);
    return columns;
}

bool same(const Event& a, const Event& b)
{
    return a.kind == b.kind && a.structure == b.structure && a.tissue == b.tissue && bitsOf(a.value) == bitsOf(b.value);
}

std::string textOf(const Event& e)
{
    return fmt::format("{} (tissue {}, structure {}, {:.17g})", name(e.kind), e.tissue,
                       e.structure == format::none ? "none" : fmt::format("{}", e.structure), e.value);
}

}  // namespace

TickComparison::TickComparison(const Record& record)
    : structures_(record.info().structures.size()),
      probe_(record.info().probe),
      format_(record.format()),
      tissues_(record.info().tissues)
{
}

void TickComparison::found(std::uint64_t tick, const std::string& what, std::string recorded, std::string recomputed)
{
    ++count_;
    const auto known = std::ranges::find(differences_, what, &Difference::what);
    if (known != differences_.end()) {
        ++known->ticks;
    } else {
        differences_.push_back({what, tick, 1, std::move(recorded), std::move(recomputed)});
    }
}

bool TickComparison::add(const TickRecord& then, const TickRecord& now)
{
    const std::uint64_t before = count_;
    compareColumns(then, now);
    compareEvents(then, now);
    compareCores(then, now);
    return count_ == before;
}

void TickComparison::compareColumns(const TickRecord& then, const TickRecord& now)
{
    const format::TickColumns of{structures_, probe_, format_};
    const Columns a = columnsOf(then, of), b = columnsOf(now, of);
    for (std::size_t i = 0; i < a.count; ++i) {
        if (a.bits[i] != b.bits[i]) {
            found(then.tick, a.name[i], a.text(i), b.text(i));
        }
    }
}

void TickComparison::compareEvents(const TickRecord& then, const TickRecord& now)
{
    for (std::uint32_t i = 0; i < std::max(then.eventCount, now.eventCount); ++i) {
        const bool recorded = i < then.eventCount, recomputed = i < now.eventCount;
        if (!recorded || !recomputed || !same(then.events[i], now.events[i])) {
            found(then.tick, "events", recorded ? textOf(then.events[i]) : "none",
                  recomputed ? textOf(now.events[i]) : "none");
            return;
        }
    }
}

void TickComparison::compareCores(const TickRecord& then, const TickRecord& now)
{
    if (!then.fired && !now.fired) {
        return;
    }
    const auto compare = [&](const std::string& what, double a, double b) {
        if (bitsOf(a) != bitsOf(b)) {
            found(then.tick, "core: " + what, fmt::format("{:.17g}", a), fmt::format("{:.17g}", b));
        }
    };
    const CoreSample &a = then.core, &b = now.core;
    compare("volume_m3", a.volume, b.volume);
    compare("target_fraction", a.targetFraction, b.targetFraction);
    compare("target_length_m", a.targetLength, b.targetLength);
    compare("fragments", a.fragments, b.fragments);
    for (int k = 0; k < 3; ++k) {
        compare(fmt::format("notch_start_{}_m", "xyz"[k]), a.notchStart[k], b.notchStart[k]);
        compare(fmt::format("notch_end_{}_m", "xyz"[k]), a.notchEnd[k], b.notchEnd[k]);
    }
    for (std::size_t i = 0; i < maxTissues; ++i) {
        const std::string tissue = i < tissues_.size() ? tissues_[i] : fmt::format("{}", i);
        compare("fraction of " + tissue, a.fraction[i], b.fraction[i]);
    }
}

std::string TickComparison::inWords() const
{
    constexpr std::size_t told = 2;
    std::string text;
    for (std::size_t i = 0; i < std::min(told, differences_.size()); ++i) {
        const Difference& d = differences_[i];
        text += fmt::format("{}{} is {} in tick {} of the record and {} computed again", text.empty() ? "" : "; ", d.what,
                            d.recorded, d.firstTick, d.recomputed);
        text += d.ticks > 1 ? fmt::format(" (and in {} ticks more)", d.ticks - 1) : "";
    }
    if (differences_.size() > told) {
        text += fmt::format("; and {} columns more", differences_.size() - told);
    }
    return text;
}

}  // namespace palpate::haptics
