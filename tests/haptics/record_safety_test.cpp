#include <haptics/record_check.h>
#include <haptics/recorder.h>

#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>
#include <tests/sqlite_edit.h>

#include <gtest/gtest.h>

#include <sqlite3.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <thread>

// What was recorded is not lost, whatever else is done to its files.

namespace {

std::atomic<ino_t> watchedLog{0};
std::atomic<int> logSyncs{0};

}  // namespace

// In the place of the C library's, to see what is brought to the disk.
extern "C" int fdatasync(int descriptor)
{
    struct stat s {};
    const int done = static_cast<int>(::syscall(SYS_fdatasync, descriptor));
    if (::fstat(descriptor, &s) == 0 && s.st_ino == watchedLog) {
        ++logSyncs;
    }
    return done;
}

namespace palpate::haptics {
namespace {

void expectRefusal(const std::filesystem::path& file, const std::string& words, const std::string& error)
{
    EXPECT_TRUE(error.starts_with(file.string() + ": ")) << error;
    EXPECT_NE(error.find(words), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

// What the reader refuses is not written: the record ends before it, and can be read.
TEST(RecordSafety, ATickThatNobodyWouldReadEndsTheRecordBeforeIt)
{
    const synthetic::Folder folder;
    TickRecord tick;
    tick.device.position = {10.5, 0, 0};
    TickRecord elsewhere;
    elsewhere.tissue = 5;
    for (const TickRecord& bad : {tick, elsewhere}) {
        const auto file = folder / (bad.tissue == 0 ? "far" : "row");
        Recorder recorder(file, synthetic::info());
        for (std::uint64_t i = 0; i < 5; ++i) {
            TickRecord next = i == 3 ? bad : TickRecord{};
            next.tick = i;
            recorder.push(next);
        }
        recorder.finish({});
        expectRefusal(file, "recording stopped: tick 3: ", recorder.error());
        EXPECT_FALSE(recorder.whole());
        EXPECT_EQ(recorder.lost(), 2U);
        const Record record(file);
        std::uint64_t ticks = 0;
        record.each([&](const TickRecord&) { ++ticks; });
        EXPECT_EQ(ticks, 3U);
    }
}

TEST(RecordSafety, AKeyThatIsThereTwiceIsRefused)
{
    const synthetic::Folder folder;
    SessionInfo info = synthetic::info();
    info.extra = {{"note", "first"}, {"note", "second"}};
    expectRefusal(folder / "a", "extra has key 'note' twice", tests::errorOf([&] { Recorder(folder / "a", info); }));
    EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

// After a crash nearly all of a record is in its log. Whoever moves the record alone must not lose the log to the next one.
TEST(RecordSafety, TheNameOfARecordThatLeftItsLogThereIsRefused)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.palpate";
    for (const char* suffix : {"-wal", "-journal"}) {
        const std::filesystem::path log = file.string() + suffix;
        std::ofstream(log) << "nearly all";
        expectRefusal(file, log.string() + " is there without it: it belongs to a record of that name that was moved",
                      tests::errorOf([&] { Recorder(file, synthetic::info()); }));
        EXPECT_FALSE(std::filesystem::exists(file));
        EXPECT_EQ(std::filesystem::file_size(log), 10U);
        std::ofstream(file) << "the rest";
        expectRefusal(file, "exists already, and " + log.string() + " is part of it",
                      tests::errorOf([&] { Recorder(file, synthetic::info()); }));
        EXPECT_EQ(std::filesystem::file_size(log), 10U);
        std::filesystem::remove(file);
        std::filesystem::resize_file(log, 0);  // nothing is lost with it
    }
    synthetic::record(file, synthetic::info(), {TickRecord{}});
    EXPECT_EQ(Record(file).ticks(), 1U);
}

/// Another program that has begun to write into a record.
class Lock {
public:
    explicit Lock(const std::filesystem::path& file)
    {
        EXPECT_EQ(sqlite3_open(file.c_str(), &database_), SQLITE_OK);
        EXPECT_EQ(sqlite3_exec(database_, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
    }
    ~Lock() { sqlite3_close(database_); }
    Lock& operator=(Lock&&) = delete;

private:
    sqlite3* database_ = nullptr;
};

constexpr std::chrono::milliseconds longerThanOneTry{2300};

// While a session runs, and when it ends.
TEST(RecordSafety, TicksWaitForTheEndOfAnothersLock)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto file = folder / "a.palpate";
    Recorder recorder(file, synthetic::info());
    TickRecord tick;
    const auto push = [&](std::uint64_t until) {
        for (; tick.tick < until; ++tick.tick) {
            recorder.push(tick);
        }
    };
    push(500);
    recorder.flush();
    for (const bool ends : {false, true}) {
        auto lock = std::make_optional<Lock>(file);
        push(tick.tick + 2000);
        std::thread other([&] {
            std::this_thread::sleep_for(longerThanOneTry);
            lock.reset();
        });
        if (ends) {
            recorder.finish({});
        }
        other.join();
    }
    EXPECT_EQ(recorder.error(), "");
    EXPECT_TRUE(recorder.whole());
    EXPECT_EQ(Record(file).ticks(), 4500U);
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
}

// The session goes on without a record, and says so.
TEST(RecordSafety, ALockThatOutlastsTheRingEndsTheRecord)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto file = folder / "a.palpate";
    Recorder recorder(file, synthetic::info());
    const Lock lock(file);
    for (TickRecord tick; tick.tick < 8000; ++tick.tick) {
        recorder.push(tick);
    }
    std::this_thread::sleep_for(longerThanOneTry);
    recorder.finish({});
    expectRefusal(file, "recording stopped: database is locked", recorder.error());
    EXPECT_FALSE(recorder.whole());
}

// The seal is of what was written, not of what is found when the session ends.
TEST(RecordSafety, WhatAnotherProgramChangesDuringTheSessionIsNotSealed)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const std::vector<std::pair<const char*, const char*>> edits{
        {"UPDATE session SET value = 'P-08' WHERE key = 'operator'", "session.operator is not what was written"},
        {"DELETE FROM session WHERE key = 'host'", "session.host is gone"},
        {"INSERT INTO session VALUES ('extra.note', 'x')", "session.extra.note was added"},
        {"UPDATE structures SET warn_distance_m = 0.5 WHERE structure = 1", "structures.1 is not what was written"},
        {"UPDATE tissues SET name = 'lard' WHERE tissue = 2", "tissues.2 is not what was written"},
        {"INSERT INTO results VALUES ('score_total', '99')", "results.score_total (2) was added"},
        {"CREATE INDEX i ON ticks (total_y_n)", "tables and indexes: 10 rows where 9 were written"}};
    for (const auto& [sql, words] : edits) {
        const auto file = folder / "a.palpate";
        {
            Recorder recorder(file, synthetic::info());
            recorder.push({});
            recorder.flush();
            tests::executeSql(file, sql);
            recorder.finish({{"score_total", "61.2"}});
            EXPECT_EQ(recorder.error(), "");
        }
        const Seal seal = Record(file).seal();
        EXPECT_EQ(seal.state, Seal::State::broken) << sql;
        EXPECT_NE(someOf(seal.changed).find(words), std::string::npos) << sql << ": " << someOf(seal.changed);
        std::filesystem::remove(file);
    }
}

// Results of both are sealed, also those of one key.
TEST(RecordSafety, ARecordThatEndsTwiceIsWhole)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto file = folder / "a.palpate";
    {
        Recorder recorder(file, synthetic::info());
        recorder.push({});
        recorder.finish({{"note", "a"}, {"note", "b"}});
        TickRecord last;
        last.tick = 1;
        recorder.push(last);
        recorder.finish({{"note", "c"}});
        last.tick = 2;
        recorder.push(last);
    }
    const Seal seal = Record(file).seal();
    EXPECT_EQ(seal.state, Seal::State::whole) << someOf(seal.changed);
    EXPECT_EQ(Record(file).ticks(), 3U);
}

/// While it lives, the working folder is another.
class WorkingFolder {
public:
    explicit WorkingFolder(const std::filesystem::path& folder) { std::filesystem::current_path(folder); }
    ~WorkingFolder() { std::filesystem::current_path(before_); }
    WorkingFolder& operator=(WorkingFolder&&) = delete;

private:
    std::filesystem::path before_ = std::filesystem::current_path();
};

// SQLite takes some names for addresses.
TEST(RecordSafety, ANameIsTheNameOfAFile)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const WorkingFolder here(folder.path());
    const std::vector<const char*> names{"file:z.db", "file:z.db?mode=memory", ":memory:", "file:"};
    for (const char* name : names) {
        synthetic::record(name, synthetic::info(), {TickRecord{}});
        EXPECT_EQ(Record(name).seal().state, Seal::State::whole) << name;
        EXPECT_TRUE(std::filesystem::exists(folder / name));
    }
    const std::filesystem::directory_iterator files(folder.path());
    EXPECT_EQ(static_cast<std::size_t>(std::distance(begin(files), end(files))), names.size());
}

int openReadOnly(const char* file, int flags, int mode)
{
    errno = EROFS;
    return (flags & (O_WRONLY | O_RDWR | O_CREAT)) != 0 ? -1 : ::open(file, flags, mode);
}

/// While it lives, SQLite can write no file, as on a medium that is read only.
class ReadOnlyMedium {
public:
    ReadOnlyMedium() { vfs_->xSetSystemCall(vfs_, "open", reinterpret_cast<sqlite3_syscall_ptr>(openReadOnly)); }
    ~ReadOnlyMedium() { vfs_->xSetSystemCall(vfs_, nullptr, nullptr); }
    ReadOnlyMedium& operator=(ReadOnlyMedium&&) = delete;

private:
    sqlite3_vfs* vfs_ = sqlite3_vfs_find(nullptr);
};

// A viewer that was still there when the session ended leaves a record in mode WAL, and whoever closes it last no log.
TEST(RecordSafety, ARecordWithoutItsLogIsReadFromAReadOnlyMedium)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto file = folder / "a 50 %#?.palpate", whole = folder / "b.palpate";
    synthetic::record(file, synthetic::info(), {TickRecord{}});
    std::filesystem::copy_file(file, whole);
    tests::executeSql(file, "PRAGMA journal_mode = WAL");
    const ReadOnlyMedium medium;
    EXPECT_EQ(Record(whole).seal().state, Seal::State::whole);
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
    std::ofstream(file.string() + "-wal") << "what was not folded yet";
    expectRefusal(file, "copy it, with its -wal file, to a folder that you can read and write",
                  tests::errorOf([&] { Record{file}; }));
}

// A power cut loses what the disk does not have: the log is brought there every five seconds of ticks.
TEST(RecordSafety, TheLogIsBroughtToTheDiskWhileTheSessionRuns)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.palpate";
    Recorder recorder(file, synthetic::info());
    struct stat log {};
    ASSERT_EQ(::stat((file.string() + "-wal").c_str(), &log), 0);
    watchedLog = log.st_ino;
    TickRecord tick;
    for (const bool enough : {false, true}) {
        for (const std::uint64_t until = enough ? 5000 : 4999; tick.tick < until; ++tick.tick) {
            recorder.push(tick);
        }
        recorder.flush();
        EXPECT_TRUE(enough || logSyncs == 0) << "nothing else brings it there";
    }
    while (logSyncs == 0) {  // for ever, if that failed
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    recorder.finish({});
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
    watchedLog = 0;
}

}  // namespace
}  // namespace palpate::haptics
