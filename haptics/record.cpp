#include <haptics/record_format.h>
#include <haptics/recorder.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <limits>
#include <optional>
#include <stdexcept>
#include <system_error>

namespace palpate::haptics {

using format::Database;
using format::Statement;

namespace {

// The row of an enumerator's name; throws on a word that this version does not know.
template <class Enum, std::size_t n>
Enum fromName(std::string_view word, const std::array<std::string_view, n>& names)
{
    const auto found = std::ranges::find(names, word);
    if (found == names.end()) {
        throw std::runtime_error("unknown word '" + std::string(word) + "'");
    }
    return static_cast<Enum>(found - names.begin());
}

std::uint8_t optionalIndex(const Statement& row, int column)
{
    return row.isNull(column) ? format::none : static_cast<std::uint8_t>(row.integer(column));
}

// Reads fields one after another, in the order of format::eachColumn.
struct Reader {
    const Statement& row;
    int column = -1;

    void operator()(const char*, double& v) { v = row.real(++column); }
    void operator()(const char*, bool& v) { v = row.integer(++column) != 0; }
    template <class Integer>
    void operator()(const char*, Integer& v)
    {
        v = static_cast<Integer>(row.integer(++column));
    }
    void operator()(const char*, Phase& v) { v = fromName<Phase>(row.text(++column), phaseNames); }
    void operator()(const char*, WarningLevel& v) { v = fromName<WarningLevel>(row.text(++column), warningNames); }
    void operator()(const char*, format::Microseconds<float> v) { v.value = static_cast<float>(row.real(++column) / 1e6); }
    void operator()(const char*, format::OptionalIndex<std::uint8_t> v) { v.value = optionalIndex(row, ++column); }
};

// Rows of a table beside `ticks`, handed out tick by tick.
class Sidecar {
public:
    Sidecar(const Database& database, const std::string& sql) : rows_(database, sql) { more_ = rows_.step(); }

    template <class Visit>
    void take(std::uint64_t tick, Visit&& visit)
    {
        while (more_ && static_cast<std::uint64_t>(rows_.integer(0)) <= tick) {
            if (static_cast<std::uint64_t>(rows_.integer(0)) == tick) {
                visit(static_cast<const Statement&>(rows_));
            }
            more_ = rows_.step();
        }
    }

private:
    Statement rows_;
    bool more_ = false;
};

void readEvent(const Statement& row, TickRecord& record)
{
    if (record.eventCount < maxEventsPerTick) {
        Event& event = record.events[record.eventCount++];
        event.kind = fromName<EventKind>(row.text(1), eventNames);
        event.structure = optionalIndex(row, 2);
        event.tissue = static_cast<std::uint8_t>(row.integer(3));
        event.value = row.real(4);
    }
}

void readCore(const Statement& row, CoreSample& core)
{
    core.volume = row.real(1);
    core.targetFraction = row.real(2);
    core.targetLength = row.real(3);
    core.notchStart = {row.real(4), row.real(5), row.real(6)};
    core.notchEnd = {row.real(7), row.real(8), row.real(9)};
    core.fragments = static_cast<std::uint32_t>(row.integer(10));
}

void readFraction(const Statement& row, CoreSample& core)
{
    const auto tissue = row.integer(1);
    if (tissue >= 0 && tissue < static_cast<std::int64_t>(maxTissues)) {
        core.fraction[static_cast<std::size_t>(tissue)] = row.real(2);
    }
}

// All tables of one moment, while a live session may still write.
class Snapshot {
public:
    explicit Snapshot(Database& database) : database_(database) { database_.execute("BEGIN"); }
    ~Snapshot() { sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr); }
    Snapshot(const Snapshot&) = delete;
    Snapshot& operator=(const Snapshot&) = delete;

private:
    Database& database_;
};

std::int64_t single(Database& database, const std::string& sql)
{
    Statement query(database, sql);
    return query.step() ? query.integer(0) : 0;
}

std::string pathOf(const std::filesystem::path& file)
{
    std::error_code failed;
    if (!std::filesystem::exists(file, failed)) {
        throw std::runtime_error(file.string() + ": no such file; give the record of a session");
    }
    if (!std::filesystem::is_regular_file(file, failed)) {
        throw std::runtime_error(file.string() + ": is not a file; give the record of a session");
    }
    return file.string();
}

}  // namespace

struct Record::Impl {
    std::string file;
    std::optional<Database> database;
    SessionInfo info;
    int version = 0;  // of the file's format

    explicit Impl(const std::filesystem::path& path) : file(pathOf(path))
    {
        guarded([&] {
            database.emplace(file, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX);
            Statement(*database, "SELECT count(*) FROM sqlite_master").step();
        });
        checkFormat();
        guarded([&] {
            checkWholePages();
            readInfo();
        });
        if (!(info.rate > 0)) {
            throw std::runtime_error(file + ": is damaged (no rate in table session); take another record");
        }
    }

    // Gives SQLite's errors the file's name and a way out.
    void guarded(const auto& work) const
    {
        try {
            work();
        } catch (const std::exception& e) {
            const int status = database ? sqlite3_errcode(database->get()) : SQLITE_CANTOPEN;
            if (status == SQLITE_NOTADB) {
                throw std::runtime_error(file + ": is not a session record; palpate train --record writes one");
            }
            if (status == SQLITE_CANTOPEN) {
                throw std::runtime_error(file + ": cannot be opened (" + e.what() +
                                         "); copy it, with its -wal file, to a folder that you can read and write");
            }
            throw std::runtime_error(file + ": is damaged (" + e.what() + "); copy it again or take another record");
        }
    }

    // SQLite takes the bytes missing from a last page for zeros. While a log is there a page may rightly be half written.
    void checkWholePages()
    {
        std::error_code none;
        const auto log = std::filesystem::file_size(file + "-wal", none);
        const auto page = static_cast<std::uintmax_t>(single(*database, "PRAGMA page_size"));
        if ((none || log == 0) && std::filesystem::file_size(file) % page != 0) {
            throw std::runtime_error("its end is missing");
        }
    }

    void checkFormat()
    {
        std::int64_t id = 0;
        guarded([&] {
            id = single(*database, "PRAGMA application_id");
            version = static_cast<int>(single(*database, "PRAGMA user_version"));
        });
        if (id == 0 && single(*database, "SELECT count(*) FROM sqlite_master") == 0) {
            throw std::runtime_error(file + ": holds no session: its writer was stopped before it began; remove it");
        }
        if (id != format::applicationId) {
            throw std::runtime_error(file +
                                     ": is an SQLite file, but not a session record; palpate train --record writes one");
        }
        if (version < format::oldestVersion || version > format::version) {
            throw std::runtime_error(file + ": is a record of format " + std::to_string(version) + ", this program reads " +
                                     std::to_string(format::oldestVersion) + " to " + std::to_string(format::version) +
                                     "; use the program that wrote it");
        }
        for (const char* table :
             {"session", "results", "structures", "tissues", "ticks", "events", "cores", "core_fractions"}) {
            const std::string sql = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = '";
            if (single(*database, sql + table + "'") == 0) {
                throw std::runtime_error(file + ": is damaged (table " + table +
                                         " is missing); copy it again or take another");
            }
        }
    }

    void readInfo()
    {
        info.rate = 0;
        Statement session(*database, "SELECT key, value FROM session ORDER BY rowid");
        while (session.step()) {
            const std::string key(session.text(0));
            if (key == "rate_hz") {
                info.rate = session.real(1);
            } else if (key == "seed") {
                info.seed = std::strtoull(std::string(session.text(1)).c_str(), nullptr, 10);
            } else if (key.starts_with("extra.")) {
                info.extra.emplace_back(key.substr(6), session.text(1));
            } else if (std::string* field = textField(key)) {
                *field = session.text(1);
            }
        }
        Statement structures(*database, "SELECT name, warn_distance_m FROM structures ORDER BY structure");
        while (structures.step()) {
            info.structures.emplace_back(structures.text(0));
            info.warnDistances.push_back(structures.real(1));
        }
        Statement tissues(*database, "SELECT name FROM tissues ORDER BY tissue");
        while (tissues.step()) {
            info.tissues.emplace_back(tissues.text(0));
        }
        if (info.structures.size() > maxStructures || info.tissues.size() > maxTissues) {
            throw std::runtime_error("more structures or tissues than a session has");
        }
    }

    std::string* textField(const std::string& key)
    {
        const std::pair<const char*, std::string*> fields[] = {
            {"scene", &info.scene}, {"scene_text", &info.sceneText},   {"scene_origin", &info.sceneOrigin},
            {"model", &info.model}, {"volume_hash", &info.volumeHash}, {"device", &info.device},
            {"build", &info.build}};
        for (const auto& [name, field] : fields) {
            if (key == name) {
                return field;
            }
        }
        return nullptr;
    }

    void each(const std::function<void(const TickRecord&)>& visit)
    {
        std::optional<Snapshot> snapshot;
        std::optional<Statement> ticks;
        std::optional<Sidecar> events, cores, fractions;
        guarded([&] {
            snapshot.emplace(*database);
            ticks.emplace(*database,
                          "SELECT " + format::columnList(info.structures.size(), version) + " FROM ticks ORDER BY tick");
            events.emplace(*database, "SELECT tick, kind, structure, tissue, value FROM events ORDER BY tick, position");
            cores.emplace(*database, "SELECT * FROM cores ORDER BY tick");
            fractions.emplace(*database, "SELECT tick, tissue, fraction FROM core_fractions ORDER BY tick");
        });
        for (;;) {
            TickRecord record;
            bool more = false;
            guarded([&] {
                more = ticks->step();
                if (more) {
                    record.tissueForce = Vec3(std::numeric_limits<double>::quiet_NaN());  // where the file has none
                    format::eachColumn(record, info.structures.size(), Reader{*ticks}, version);
                    events->take(record.tick, [&](const Statement& row) { readEvent(row, record); });
                    cores->take(record.tick, [&](const Statement& row) { readCore(row, record.core); });
                    fractions->take(record.tick, [&](const Statement& row) { readFraction(row, record.core); });
                }
            });
            if (!more) {
                return;
            }
            visit(record);
        }
    }
};

Record::Record(const std::filesystem::path& file) : impl_(std::make_unique<Impl>(file)) {}

Record::Record(Record&&) noexcept = default;

Record::~Record() = default;

const SessionInfo& Record::info() const noexcept
{
    return impl_->info;
}

bool Record::complete() const noexcept
{
    try {
        return single(*impl_->database, "SELECT count(*) FROM session WHERE key = 'complete'") != 0;
    } catch (const std::exception&) {
        return false;
    }
}

std::uint64_t Record::ticks() const
{
    std::int64_t count = 0;
    impl_->guarded([&] { count = single(*impl_->database, "SELECT count(*) FROM ticks"); });
    return static_cast<std::uint64_t>(count);
}

void Record::each(const std::function<void(const TickRecord&)>& visit) const
{
    impl_->each(visit);
}

std::vector<std::pair<std::string, std::string>> Record::results() const
{
    std::vector<std::pair<std::string, std::string>> pairs;
    impl_->guarded([&] {
        Statement rows(*impl_->database, "SELECT key, value FROM results ORDER BY rowid");
        while (rows.step()) {
            pairs.emplace_back(rows.text(0), rows.text(1));
        }
    });
    return pairs;
}

}  // namespace palpate::haptics
