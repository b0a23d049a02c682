#include <training/store.h>

#include <base/descriptor.h>
#include <base/error.h>
#include <base/mapped.h>
#include <base/nearest.h>
#include <base/outputs.h>
#include <base/room.h>
#include <base/utc.h>
#include <haptics/measures.h>
#include <haptics/record_format.h>
#include <training/belongings.h>
#include <training/folders.h>
#include <training/profile_name.h>

#include <fmt/format.h>
#include <sqlite3.h>
#include <nlohmann/json.hpp>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace palpate::training {

namespace fs = std::filesystem;
using haptics::format::Database;
using haptics::format::Statement;

namespace {

constexpr int applicationId = 0x50414C54;  // "PALT", in the file's header
constexpr int busyTimeout = 10000;         // for others that store [ms]

// What each version adds; user_version says how many were done. Never change one that was released: add another.
constexpr std::array migrations{
    R"(CREATE TABLE person (id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, hand TEXT NOT NULL CHECK (hand IN ('right', 'left')),
                            created TEXT NOT NULL);
       CREATE TABLE session (id INTEGER PRIMARY KEY, person INTEGER NOT NULL REFERENCES person ON DELETE CASCADE,
                             started TEXT NOT NULL, case_id TEXT NOT NULL, curriculum TEXT NOT NULL, exercise TEXT NOT NULL,
                             test INTEGER NOT NULL, guidance REAL NOT NULL, scene TEXT NOT NULL, device TEXT NOT NULL,
                             build TEXT NOT NULL, record TEXT NOT NULL, record_sha256 TEXT NOT NULL, taken INTEGER NOT NULL);
       CREATE INDEX session_of_person ON session (person, started);
       CREATE TABLE measure (session INTEGER NOT NULL REFERENCES session ON DELETE CASCADE, key TEXT NOT NULL, value REAL NOT NULL,
                             PRIMARY KEY (session, key)) WITHOUT ROWID;)",
    R"(ALTER TABLE session ADD COLUMN note TEXT NOT NULL DEFAULT '';
       ALTER TABLE session ADD COLUMN rating INTEGER NOT NULL DEFAULT 0 CHECK (rating BETWEEN 0 AND 5);)",
};
constexpr int newest = static_cast<int>(migrations.size());

constexpr const char* sessionColumns =
    "id, started, case_id, curriculum, exercise, test, guidance, scene, device, build, record, record_sha256, taken, note, "
    "rating";

// Whether a file is one of profiles, by the application's number in SQLite's header, or empty.
bool isStore(int descriptor)
{
    constexpr std::size_t at = 68;  // of the number, four bytes, big endian (sqlite.org/fileformat.html)
    std::array<unsigned char, at + 4> header{};
    const auto length = ::pread(descriptor, header.data(), header.size(), 0);
    std::int64_t number = 0;
    for (std::size_t i = at; i < header.size(); ++i) {
        number = 256 * number + header[i];
    }
    return length == 0 || (length == static_cast<ssize_t>(header.size()) && number == applicationId);
}

// SQLite makes its own files beside this one with this one's mode. A file of another kind stays as it is.
void makePrivate(const fs::path& file)
{
    if (!file.parent_path().empty() && base::makeFolders(file.parent_path())) {
        ::chmod(file.parent_path().c_str(), 0700);
    }
    const base::Descriptor opened(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
    base::failIf(!opened, "{}: cannot be opened: {}", file.string(), errno == ELOOP ? "is a link" : std::strerror(errno));
    if (isStore(*opened)) {
        ::fchmod(*opened, 0600);
    }
}

std::int64_t pragma(const Database& database, const char* name)
{
    Statement ask(database, std::string("PRAGMA ") + name);
    return ask.step() ? ask.integer(0) : 0;
}

// A transaction that is undone unless it was finished.
class Transaction {
public:
    explicit Transaction(Database& database) : database_(database) { database_.execute("BEGIN IMMEDIATE"); }
    ~Transaction()
    {
        if (!done_) {
            sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
        }
    }
    Transaction& operator=(Transaction&&) = delete;
    void commit()
    {
        database_.execute("COMMIT");
        done_ = true;
    }

private:
    Database& database_;
    bool done_ = false;
};

void migrate(Database& database)
{
    Transaction all(database);
    const auto version = pragma(database, "user_version");
    const auto application = pragma(database, "application_id");
    Statement tables(database, "SELECT count(*) FROM sqlite_master");
    tables.step();
    base::failIf(tables.integer(0) > 0 && application != applicationId, "is no file of profiles: choose another name");
    base::failIf(version > newest, "was written by a newer Palpate (version {}; this one knows {}): update", version,
                 newest);
    for (auto v = version; v < newest; ++v) {
        database.execute(migrations[static_cast<std::size_t>(v)]);
    }
    if (version < newest) {
        database.execute(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", applicationId, newest));
    }
    all.commit();
}

StoredSession readSession(const Statement& row)
{
    StoredSession s;
    int c = 0;
    s.id = row.integer(c++);
    for (std::string* text : {&s.started, &s.caseId, &s.curriculum, &s.exercise}) {
        *text = row.text(c++);
    }
    s.test = row.integer(c++) != 0;
    s.guidance = row.real(c++);
    for (std::string* text : {&s.scene, &s.device, &s.build, &s.record, &s.recordSha256}) {
        *text = row.text(c++);
    }
    s.taken = row.integer(c++) != 0;
    s.note = row.text(c++);
    s.rating = static_cast<int>(row.integer(c));
    return s;
}

// All of a database, as it is at one moment.
void copy(const Database& from, Database& to)
{
    sqlite3_backup* const job = sqlite3_backup_init(to.get(), "main", from.get(), "main");
    base::failIf(job == nullptr, "{}", sqlite3_errmsg(to.get()));
    const int done = sqlite3_backup_step(job, -1);
    if (sqlite3_backup_finish(job); done != SQLITE_DONE) {
        throw std::runtime_error(sqlite3_errstr(done));
    }
}

bool canBeWritten(const fs::path& place)
{
    return ::faccessat(AT_FDCWD, place.c_str(), W_OK, AT_EACCESS) == 0;
}

// The index of a log, which SQLite makes even to read, and a page of the log.
bool hasRoom(const fs::path& place)
{
    constexpr std::size_t enough = 64 << 10;  // [bytes]
    return base::hasRoom(place.parent_path(), enough);
}

// A file without a log, or with an empty one, is read as it is, since a log's index could not be made beside it.
std::string readOnlyName(const fs::path& file)
{
    std::error_code none;
    const auto log = fs::file_size(file.string() + "-wal", none);
    return haptics::format::uriOf(file, none || log == 0);
}

// On a full disk SQLite says that it is full, or that a file could not be made longer.
std::string inWords(const fs::path& file, const std::string& what)
{
    const bool full = what == sqlite3_errstr(SQLITE_FULL) || (what == sqlite3_errstr(SQLITE_IOERR) && !hasRoom(file));
    return full ? "the disk is full: make room, then try again" : what;
}

// Does the work, and says which file its errors are about.
template <class Work>
auto guarded(const fs::path& file, const Work& work)
{
    try {
        return work();
    } catch (const std::runtime_error& e) {
        throw base::error("{}: {}", file.string(), inWords(file, e.what()));
    }
}

}  // namespace

ProfileStore::ProfileStore(const fs::path& file) : file_(placeOf(file))
{
    makePrivate(file_);
    guarded(file_, [&] {
        open(file_.string());
        migrate(*database_);
        database_->execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL");
    });
}

// What cannot be written, also for want of room, is read into memory, where one of an older version can be brought up to
// date. Where another program has the file open, the log's index is there.
ProfileStore ProfileStore::toRead(const fs::path& file)
{
    const fs::path place = placeOf(file);
    const bool there = ::access(place.c_str(), F_OK) == 0 || errno != ENOENT;
    std::error_code none;
    const bool room = hasRoom(place) || fs::exists(place.string() + "-shm", none);
    if (there && room && canBeWritten(place) && canBeWritten(place.parent_path())) {
        try {
            return ProfileStore(place);
        } catch (const std::runtime_error&) {
            if (hasRoom(place)) {
                throw;
            }
        }
    }
    ProfileStore store;
    store.file_ = place;
    guarded(place, [&] {
        store.open(":memory:");
        if (there) {
            const Database kept(readOnlyName(place), SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX);
            copy(kept, *store.database_);
        }
        migrate(*store.database_);
    });
    return store;
}

fs::path ProfileStore::placeOf(const fs::path& file)
{
    return file.empty() ? standardFile() : fs::absolute(file);
}

void ProfileStore::open(const std::string& name)
{
    database_ = std::make_unique<Database>(name, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX);
    sqlite3_busy_timeout(database_->get(), busyTimeout);
    // The content is not trusted to bring functions along; what is removed is overwritten.
    database_->execute("PRAGMA trusted_schema = OFF; PRAGMA secure_delete = ON; PRAGMA foreign_keys = ON");
}

ProfileStore::~ProfileStore() = default;
ProfileStore::ProfileStore(ProfileStore&&) noexcept = default;

fs::path ProfileStore::standardFile()
{
    return userData() / "profiles.db";
}

Person ProfileStore::add(const std::string& name, Hand hand)
{
    checkProfileName(name);
    for (const Person& one : people()) {
        base::failIf(one.name == name, "{}: there is a profile of this name already", name);
        base::failIf(isSameButForCase(one.name, name),
                     "{}: there is a profile '{}' already, which differs only in capital letters: choose another name",
                     name, one.name);
    }
    return guarded(file_, [&] {
        Statement(*database_, "INSERT INTO person (name, hand, created) VALUES (?, ?, ?)", name, nameOf(hand), base::utc())
            .run();
        return find(name);
    });
}

std::vector<Person> ProfileStore::people() const
{
    return guarded(file_, [&] {
        std::vector<Person> all;
        Statement select(*database_,
                         "SELECT id, name, hand, created, (SELECT count(*) FROM session WHERE person = person.id) "
                         "FROM person ORDER BY name");
        while (select.step()) {
            all.push_back({select.integer(0), std::string(select.text(1)),
                           select.text(2) == "left" ? Hand::left : Hand::right, std::string(select.text(3)),
                           static_cast<int>(select.integer(4))});
        }
        return all;
    });
}

Person ProfileStore::find(const std::string& name) const
{
    const auto all = people();
    const auto at = std::ranges::find(all, name, &Person::name);
    if (at != all.end()) {
        return *at;
    }
    throw base::error("{}: there is no such profile{}", name,
                      base::meant(name, base::mapped<std::string>(all, &Person::name), "; palpate profile new makes one"));
}

void ProfileStore::setHand(const Person& person, Hand hand)
{
    guarded(file_,
            [&] { Statement(*database_, "UPDATE person SET hand = ? WHERE id = ?", nameOf(hand), person.id).run(); });
}

std::int64_t ProfileStore::store(const Person& person, const StoredSession& s)
{
    return guarded(file_, [&] {
        Transaction all(*database_);
        if (!s.recordSha256.empty()) {
            Statement known(*database_, "SELECT id FROM session WHERE person = ? AND record_sha256 = ?", person.id,
                            s.recordSha256);
            if (known.step()) {
                throw base::error("{} has this session already, number {}", person.name, known.integer(0));
            }
        }
        Statement(
            *database_,
            "INSERT INTO session (person, started, case_id, curriculum, exercise, test, guidance, scene, device, build, "
            "record, record_sha256, taken) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            person.id, s.started, s.caseId, s.curriculum, s.exercise, std::int64_t{s.test}, s.guidance, s.scene, s.device,
            s.build, s.record, s.recordSha256, std::int64_t{s.taken})
            .run();
        const std::int64_t id = sqlite3_last_insert_rowid(database_->get());
        for (const auto& [key, value] : s.values) {
            Statement(*database_, "INSERT INTO measure VALUES (?, ?, ?)", id, key, value).run();
        }
        all.commit();
        return id;
    });
}

std::vector<StoredSession> ProfileStore::sessions(const Person& person) const
{
    return guarded(file_, [&] {
        std::vector<StoredSession> all;
        Statement select(*database_,
                         fmt::format("SELECT {} FROM session WHERE person = ? ORDER BY started, id", sessionColumns),
                         person.id);
        while (select.step()) {
            all.push_back(readSession(select));
            Statement measures(*database_, "SELECT key, value FROM measure WHERE session = ?", all.back().id);
            while (measures.step()) {
                all.back().values[std::string(measures.text(0))] = measures.real(1);
            }
        }
        return all;
    });
}

std::set<fs::path> ProfileStore::recordsOf(const Person& person) const
{
    return guarded(file_, [&] {
        std::set<fs::path> files;
        Statement select(*database_, "SELECT DISTINCT record FROM session WHERE person = ? AND record != ''", person.id);
        while (select.step()) {
            std::error_code none;
            const fs::path file(select.text(0));
            const fs::path canonical = fs::weakly_canonical(file, none);
            files.insert(none ? file : canonical);
        }
        return files;
    });
}

void ProfileStore::annotate(const Person& person, std::int64_t session, const std::string& note, int rating)
{
    guarded(file_, [&] {
        base::failIf(rating < 0 || rating > 5, "rating {}: must be 1 to 5, or 0 for none", rating);
        Statement(*database_, "UPDATE session SET note = ?, rating = ? WHERE id = ? AND person = ?", note,
                  std::int64_t{rating}, session, person.id)
            .run();
        base::failIf(sqlite3_changes(database_->get()) == 0, "{} has no session {}: palpate progress '{}' lists them",
                     person.name, session, person.name);
    });
}

nlohmann::json ProfileStore::exported(const Person& person) const
{
    nlohmann::json out = {{"name", person.name},
                          {"hand", nameOf(person.hand)},
                          {"created", person.created},
                          {"sessions", nlohmann::json::array()}};
    for (const StoredSession& s : sessions(person)) {
        nlohmann::json values = nlohmann::json::object();
        for (const auto& [key, value] : s.values) {
            values[key] =
                std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(value > 0 ? "infinite" : "-infinite");
        }
        out["sessions"].push_back({{"id", s.id},
                                   {"started", s.started},
                                   {"case", s.caseId},
                                   {"curriculum", s.curriculum},
                                   {"exercise", s.exercise},
                                   {"mode", s.test ? "test" : "practice"},
                                   {"guidance", s.guidance},
                                   {"scene", s.scene},
                                   {"device", s.device},
                                   {"build", s.build},
                                   {"record", s.record},
                                   {"record_sha256", s.recordSha256},
                                   {"taken_from_record", s.taken},
                                   {"note", s.note},
                                   {"rating", s.rating},
                                   {"measures", values}});
    }
    return out;
}

Erased ProfileStore::erase(const Person& person)
{
    Belongings of{person.name, {recordFolder(), windowFolder()}, recordsOf(person), {}, {}};
    for (const Person& other : people()) {
        if (other.id != person.id) {
            of.otherNames.insert(other.name);
            of.ofOthers.merge(recordsOf(other));
        }
    }
    // The files first: while the person is known, erasing can be done again.
    Erased erased = removeBelongings(of);
    guarded(file_, [&] {
        Transaction all(*database_);
        Statement(*database_, "DELETE FROM person WHERE id = ?", person.id).run();
        all.commit();
        // Overwritten in the file by secure_delete; now also out of the write-ahead log and the free pages.
        database_->execute("PRAGMA wal_checkpoint(TRUNCATE); VACUUM");
        emptyLog();
    });
    return erased;
}

// SQLite reports a reader that keeps the log as a row, not as an error.
void ProfileStore::emptyLog()
{
    Statement log(*database_, "PRAGMA wal_checkpoint(TRUNCATE)");
    base::failIf(!log.step() || log.integer(0) != 0,
                 "another program reads it: what was erased stays in the log beside it until that program ends");
}

void ProfileStore::backup(const fs::path& to) const
{
    base::failIf(fs::exists(to), "{}: exists already; choose another name or remove it", to.native());
    const fs::path part = to.string() + fmt::format(".{}.part", ::getpid());
    try {
        makePrivate(part);
        Database copied(part.string(), SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX);
        copy(*database_, copied);
        copied.execute("PRAGMA journal_mode = DELETE");
        fs::rename(part, to);
    } catch (const std::exception& e) {
        std::error_code none;
        for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
            fs::remove(part.string() + suffix, none);
        }
        throw base::error("{}: no backup was made: {}", to.string(), e.what());
    }
}

}  // namespace palpate::training
