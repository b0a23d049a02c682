#include <base/error.h>
#include <base/inputs.h>
#include <haptics/record_bounds.h>
#include <haptics/record_format.h>
#include <haptics/record_rows.h>
#include <haptics/recorder.h>

#include <algorithm>
#include <charconv>
#include <exception>
#include <iterator>
#include <limits>
#include <optional>
#include <set>
#include <stdexcept>
#include <system_error>

namespace palpate::haptics {

using format::Database;
using format::Statement;

namespace {

constexpr int longestValue = 1 << 26;  // in any table [bytes]

// All tables of one moment, while a live session may still write.
class Snapshot {
public:
    explicit Snapshot(Database& database) : database_(database) { database_.execute("BEGIN"); }
    ~Snapshot() { sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr); }
    Snapshot& operator=(Snapshot&&) = delete;

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
    const std::string why = base::whyNoFile(file);
    base::failIf(!why.empty(), "{}: {}; give the record of a session", file.native(), why);
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
            try {
                open(format::placeOf(path), 0);
            } catch (const std::exception&) {
                // On a medium that cannot be written: a log's index cannot be made there, and without a log none is needed.
                if (!cannotBeWritten() || logIsThere()) {
                    throw;
                }
                open(format::uriOf(path, true), SQLITE_OPEN_URI);
            }
        });
        checkFormat();
        guarded([&] {
            checkWholePages();
            readInfo();
        });
        guarded([&] { format::checkInfo(info); });
        guarded([&] { checkTables(); });
    }

    void open(const std::string& name, int flags)
    {
        database.emplace(name, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX | flags);
        // A file from anywhere: its own SQL may call no function but harmless ones, and no value takes all memory.
        sqlite3_db_config(database->get(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
        sqlite3_db_config(database->get(), SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
        sqlite3_limit(database->get(), SQLITE_LIMIT_LENGTH, longestValue);
        Statement(*database, "SELECT count(*) FROM sqlite_master").step();
    }

    bool cannotBeWritten() const
    {
        const int kind = database ? sqlite3_errcode(database->get()) & 0xFF : SQLITE_CANTOPEN;
        return kind == SQLITE_CANTOPEN || kind == SQLITE_READONLY;
    }

    bool logIsThere() const
    {
        std::error_code none;
        const auto bytes = std::filesystem::file_size(file + "-wal", none);
        return !none && bytes > 0;
    }

    // Gives SQLite's errors the file's name and a way out.
    void guarded(const auto& work) const
    {
        try {
            work();
        } catch (const std::exception& e) {
            base::failIf(database && sqlite3_errcode(database->get()) == SQLITE_NOTADB,
                         "{}: is not a session record; palpate train --record writes one", file);
            base::failIf(cannotBeWritten(),
                         "{}: cannot be opened ({}); copy it, with its -wal file, to a folder that you can read and write",
                         file, e.what());
            throw base::error("{}: is damaged ({}); copy it again or take another record", file, e.what());
        }
    }

    // SQLite takes the bytes missing from a last page for zeros. While a log is there a page may rightly be half written.
    void checkWholePages()
    {
        const auto page = static_cast<std::uintmax_t>(single(*database, "PRAGMA page_size"));
        base::failIf(!logIsThere() && std::filesystem::file_size(file) % page != 0, "its end is missing");
    }

    void checkFormat()
    {
        std::int64_t id = 0;
        guarded([&] {
            id = single(*database, "PRAGMA application_id");
            version = static_cast<int>(single(*database, "PRAGMA user_version"));
        });
        base::failIf(id == 0 && single(*database, "SELECT count(*) FROM sqlite_master") == 0,
                     "{}: holds no session: its writer was stopped before it began; remove it", file);
        base::failIf(id != format::applicationId,
                     "{}: is an SQLite file, but not a session record; palpate train --record writes one", file);
        base::failIf(version < format::oldestVersion || version > format::version,
                     "{}: is a record of format {}, this program reads {} to {}; use the program that wrote it", file,
                     version, format::oldestVersion, format::version);
        if (version < format::sealedVersion && !statementOf("seal").empty()) {
            throw base::error(
                "{}: is damaged (a record of format {} has no seal, and here one is); copy it again or take another", file,
                version);
        }
        for (const auto& [table, sql] : format::schema({})) {
            if ((table != "seal" || version >= format::sealedVersion) && statementOf(table).empty()) {
                throw base::error("{}: is damaged (table {} is missing); copy it again or take another", file, table);
            }
        }
    }

    // That made the table; empty where there is none.
    std::string statementOf(const std::string& table) const
    {
        Statement query(*database, "SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?", table);
        return query.step() ? std::string(query.text(0)) : std::string();
    }

    // A column could be computed, a table virtual: then reading runs what the file says.
    void checkTables() const
    {
        for (const auto& [table, sql] : format::schema(info)) {
            const bool compared = version >= format::sealedVersion;
            base::failIf(compared ? statementOf(table) != sql : statementOf(table).starts_with("CREATE VIRTUAL"),
                         "table {} is not as a recorder makes it", table);
        }
    }

    void readInfo()
    {
        info.rate = 0;
        std::set<std::string> keys;
        Statement session(*database, "SELECT key, value FROM session ORDER BY rowid");
        while (session.step()) {
            const std::string key(session.text(0));
            base::failIf(!keys.insert(key).second, "table session has key {} twice", key);
            if (key == "rate_hz") {
                info.rate = format::realOf(session, 1, "rate_hz");
            } else if (key == "seed") {
                info.seed = seedOf(std::string(session.text(1)));
            } else if (key.starts_with("extra.")) {
                info.extra.emplace_back(key.substr(6), session.text(1));
            } else if (const auto text = std::ranges::find(format::infoTexts, key, [](const auto& t) { return t.first; });
                       text != format::infoTexts.end()) {
                info.*text->second = session.text(1);
            }
        }
        for (const char* key : {"scene", "scene_text", "volume_hash", "build", "rate_hz"}) {
            base::failIf(!keys.contains(key), "table session has no key {}", key);
        }
        Statement structures(*database, "SELECT structure, name, warn_distance_m FROM structures ORDER BY structure");
        while (structures.step()) {
            inOrder(structures, "structures", info.structures.size());
            info.structures.emplace_back(structures.text(1));
            info.warnDistances.push_back(format::realOf(structures, 2, "warn_distance_m"));
        }
        info.probe = version >= format::probeVersion && statementOf("ticks").find("probe_press_m") != std::string::npos;
        Statement tissues(*database, "SELECT tissue, name FROM tissues ORDER BY tissue");
        while (tissues.step()) {
            inOrder(tissues, "tissues", info.tissues.size());
            info.tissues.emplace_back(tissues.text(1));
        }
    }

    // Rows of the tables that others refer to are numbered from 0 without holes; no more are read than there may be.
    static void inOrder(const Statement& row, const char* table, std::size_t expected)
    {
        base::failIf(expected >= maxTissues || row.integer(0) != static_cast<std::int64_t>(expected),
                     "table {} has row {} where {} should be", table, row.integer(0), expected);
    }

    static std::uint64_t seedOf(const std::string& text)
    {
        std::uint64_t seed = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
        base::failIf(error != std::errc() || end != text.data() + text.size(), "seed '{}' is no whole number", text);
        return seed;
    }

    void each(const std::function<bool(const TickRecord&)>& visit)
    {
        std::optional<Snapshot> snapshot;
        std::optional<Statement> ticks;
        std::optional<format::Sidecar> events, cores, fractions;
        guarded([&] {
            snapshot.emplace(*database);
            ticks.emplace(*database,
                          "SELECT " + format::columnList(format::columnsOf(info, version)) + " FROM ticks ORDER BY tick");
            events.emplace(*database, "events",
                           "SELECT tick, kind, structure, tissue, value, position FROM events ORDER BY tick, position");
            cores.emplace(*database, "cores", "SELECT * FROM cores ORDER BY tick");
            fractions.emplace(*database, "core_fractions",
                              "SELECT tick, tissue, fraction FROM core_fractions ORDER BY tick");
        });
        for (;;) {
            TickRecord record;
            bool more = false, core = false;
            guarded([&] {
                more = ticks->step();
                if (!more) {
                    events->end();
                    cores->end();
                    fractions->end();
                    return;
                }
                record.tissueForce = Vec3(std::numeric_limits<double>::quiet_NaN());  // where the file has none
                readTick(*ticks, record);
                events->take(record.tick, [&](const Statement& row) { format::readEvent(row, record); });
                cores->take(record.tick, [&](const Statement& row) { format::readCore(row, record, core); });
                fractions->take(record.tick, [&](const Statement& row) { format::readFraction(row, record); });
                base::failIf(record.fired && !core, "tick {}: its core is missing, and it fired", record.tick);
                format::checkTick(record, info);
            });
            if (!more || !visit(record)) {
                return;
            }
        }
    }

    void readTick(const Statement& row, TickRecord& record) const
    {
        try {
            format::eachColumn(record, format::columnsOf(info, version), format::Reader{row});
        } catch (const std::runtime_error& e) {
            throw base::error("tick {}: {}", row.integer(0), e.what());
        }
    }

    Seal seal()
    {
        Seal seal;
        if (version < format::sealedVersion) {
            seal.state = Seal::State::absent;
            return seal;
        }
        guarded([&] {
            const Snapshot snapshot(*database);
            format::SealedPart whole;
            const std::vector<format::SealedPart> sealed = format::readSeal(*database, whole);
            const bool complete = single(*database, "SELECT count(*) FROM session WHERE key = 'complete'") != 0;
            if (sealed.empty() && whole.part.empty() && !complete) {
                return;
            }
            seal.sha256 = whole.sha256;
            std::vector<format::SealedPart> found = format::sealOfSmallTables(*database);
            std::ranges::move(format::sealOfTicks(*database, format::columnsOf(info, version)), std::back_inserter(found));
            seal.changed = format::compareSeals(sealed, found);
            if (sealed.empty()) {
                seal.changed = {"the seal is gone"};
            } else if (whole != format::sealOf(sealed)) {
                seal.changed.emplace_back("table seal is not what was written");
            }
            seal.state = seal.changed.empty() ? Seal::State::whole : Seal::State::broken;
        });
        return seal;
    }
};

Record::Record(const std::filesystem::path& file) : impl_(std::make_unique<Impl>(file)) {}

const std::string& Record::file() const noexcept
{
    return impl_->file;
}

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

int Record::format() const noexcept
{
    return impl_->version;
}

Seal Record::seal() const
{
    return impl_->seal();
}

std::uint64_t Record::ticks() const
{
    std::int64_t count = 0;
    impl_->guarded([&] { count = single(*impl_->database, "SELECT count(*) FROM ticks"); });
    return static_cast<std::uint64_t>(count);
}

void Record::each(const std::function<void(const TickRecord&)>& visit) const
{
    impl_->each([&](const TickRecord& record) {
        visit(record);
        return true;
    });
}

void Record::eachWhile(const std::function<bool(const TickRecord&)>& visit) const
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

std::string Record::result(std::string_view key) const
{
    const auto all = results();
    const auto found = std::ranges::find(all, key, &std::pair<std::string, std::string>::first);
    return found != all.end() ? found->second : "";
}

}  // namespace palpate::haptics
