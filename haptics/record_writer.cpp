#include <haptics/record_writer.h>

#include <algorithm>
#include <iterator>

namespace palpate::haptics::format {

namespace {

// Binds fields one after another, in the order of eachColumn.
struct Binder {
    Statement& row;
    int position = 0;

    void operator()(const char*, const double& v) { row.bind(++position, v); }
    template <class Integer>
    void operator()(const char*, const Integer& v)
    {
        row.bind(++position, static_cast<std::int64_t>(v));
    }
    void operator()(const char*, const Phase& v) { row.bind(++position, phaseNames[static_cast<std::size_t>(v)]); }
    void operator()(const char*, const WarningLevel& v) { row.bind(++position, warningNames[static_cast<std::size_t>(v)]); }
    void operator()(const char*, const Microseconds<const float>& v)
    {
        row.bind(++position, static_cast<double>(v.value) * 1e6);
    }
    void operator()(const char*, const OptionalIndex<const std::uint8_t>& v)
    {
        if (v.value == none) {
            row.bindNull(++position);
        } else {
            row.bind(++position, static_cast<std::int64_t>(v.value));
        }
    }
};

std::string tickInsert(const TickColumns& of)
{
    const std::string columns = columnList(of);
    std::string places = "?";
    for (auto n = std::ranges::count(columns, ','); n > 0; --n) {
        places += ", ?";
    }
    return "INSERT INTO ticks (" + columns + ") VALUES (" + places + ")";
}

}  // namespace

Writer::Writer(Database& database, const TickColumns& columns, std::vector<SealedPart> begun)
    : database_(database),
      columns_(columns),
      begun_(std::move(begun)),
      tick_(database, tickInsert(columns)),
      event_(database, "INSERT INTO events VALUES (?, ?, ?, ?, ?, ?)"),
      core_(database, "INSERT INTO cores VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)"),
      fraction_(database, "INSERT INTO core_fractions VALUES (?, ?, ?)")
{
    event_.digestInto(&seal_.events);
    core_.digestInto(&seal_.cores);
    fraction_.digestInto(&seal_.fractions);
}

void Writer::write(const TickRecord& record)
{
    tick_.digestInto(&seal_.ticks(record.tick));
    eachColumn(record, columns_, Binder{tick_});
    tick_.run();
    for (std::uint32_t i = 0; i < std::min<std::size_t>(record.eventCount, maxEventsPerTick); ++i) {
        const Event& event = record.events[i];
        Binder bind{event_};
        bind("tick", record.tick);
        bind("position", i);
        event_.bind(++bind.position, eventNames[static_cast<std::size_t>(event.kind)]);
        bind("structure", OptionalIndex{event.structure});
        bind("tissue", event.tissue);
        bind("value", event.value);
        event_.run();
    }
    if (record.fired) {
        writeCore(record.tick, record.core);
    }
}

void Writer::close(std::uint64_t lost, const Results& results)
{
    database_.execute("DELETE FROM session WHERE key IN ('complete', 'lost_ticks')");
    std::map<std::string, int> keys;
    const auto insert = [&](const char* table, std::string_view key, const auto& value,
                            std::map<std::string, int>& before) {
        RowDigest digest;
        insertPair(database_, table, key, value, &digest);
        return SealedPart{rowPart(table, key, before), digest.rows(), digest.text()};
    };
    const std::vector<SealedPart> ended{insert("session", "complete", std::int64_t{1}, keys),
                                        insert("session", "lost_ticks", static_cast<std::int64_t>(lost), keys)};
    for (const auto& [key, value] : results) {
        results_.push_back(insert("results", key, std::string_view(value), resultKeys_));
    }
    seal(ended);
}

void Writer::seal(const std::vector<SealedPart>& ended)
{
    std::vector<SealedPart> parts = begun_;
    const auto isOfSession = [](const SealedPart& p) { return p.part.starts_with("session."); };
    const auto session = std::find_if(parts.rbegin(), parts.rend(), isOfSession);
    parts.insert(session.base(), ended.begin(), ended.end());
    std::ranges::copy(results_, std::back_inserter(parts));
    std::ranges::move(seal_.parts(), std::back_inserter(parts));
    parts.push_back(sealOf(parts));
    database_.execute("DELETE FROM seal");
    for (const SealedPart& part : parts) {
        Statement(database_, "INSERT INTO seal VALUES (?, ?, ?)", part.part, part.rows, part.sha256).run();
    }
}

void Writer::writeCore(std::uint64_t tick, const CoreSample& core)
{
    Binder bind{core_};
    bind("tick", tick);
    for (const double value : {core.volume, core.targetFraction, core.targetLength, core.notchStart.x, core.notchStart.y,
                               core.notchStart.z, core.notchEnd.x, core.notchEnd.y, core.notchEnd.z}) {
        bind("", value);
    }
    bind("", core.fragments);
    core_.run();
    for (std::size_t i = 0; i < maxTissues; ++i) {
        if (core.fraction[i] != 0) {
            fraction_.bindAll(static_cast<std::int64_t>(tick), static_cast<std::int64_t>(i), core.fraction[i]);
            fraction_.run();
        }
    }
}

}  // namespace palpate::haptics::format
