#include <haptics/recorder.h>

#include <base/inputs.h>
#include <tests/allocations.h>
#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>
#include <tests/sqlite_edit.h>

#include <gtest/gtest.h>

#include <sqlite3.h>

#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <new>
#include <thread>

namespace palpate::haptics {
namespace {

std::uint64_t bits(double v)
{
    return std::bit_cast<std::uint64_t>(v);
}

void expectSameBits(const Vec3& a, const Vec3& b)
{
    EXPECT_EQ(bits(a.x), bits(b.x));
    EXPECT_EQ(bits(a.y), bits(b.y));
    EXPECT_EQ(bits(a.z), bits(b.z));
}

void expectSame(const TickRecord& a, const TickRecord& b, std::size_t structures)
{
    SCOPED_TRACE(a.tick);
    EXPECT_EQ(a.tick, b.tick);
    expectSameBits(a.device.position, b.device.position);
    expectSameBits(a.device.axis, b.device.axis);
    EXPECT_EQ(a.device.buttons, b.device.buttons);
    EXPECT_EQ(a.device.fresh, b.device.fresh);
    expectSameBits(a.proxy, b.proxy);
    expectSameBits(a.tissueForce, b.tissueForce);
    expectSameBits(a.basic, b.basic);
    expectSameBits(a.additional, b.additional);
    expectSameBits(a.total, b.total);
    EXPECT_EQ(a.phase, b.phase);
    EXPECT_EQ(a.tissue, b.tissue);
    EXPECT_EQ(a.nearestVital, b.nearestVital);
    EXPECT_EQ(a.fired, b.fired);
    EXPECT_EQ(a.faulted, b.faulted);
    EXPECT_EQ(bits(a.inserted), bits(b.inserted));
    EXPECT_EQ(bits(a.residual), bits(b.residual));
    EXPECT_EQ(bits(a.penetration), bits(b.penetration));
    EXPECT_EQ(a.contacts, b.contacts);
    EXPECT_EQ(a.moved, b.moved);
    for (std::size_t i = 0; i < structures; ++i) {
        EXPECT_EQ(bits(a.distance[i]), bits(b.distance[i]));
    }
    EXPECT_EQ(a.seconds, b.seconds);
    ASSERT_EQ(a.eventCount, b.eventCount);
    for (std::uint32_t i = 0; i < a.eventCount; ++i) {
        EXPECT_EQ(a.events[i].kind, b.events[i].kind);
        EXPECT_EQ(a.events[i].structure, b.events[i].structure);
        EXPECT_EQ(a.events[i].tissue, b.events[i].tissue);
        EXPECT_EQ(bits(a.events[i].value), bits(b.events[i].value));
    }
    for (std::size_t i = 0; i < maxTissues; ++i) {
        EXPECT_EQ(bits(a.core.fraction[i]), bits(b.core.fraction[i]));
    }
    EXPECT_EQ(bits(a.core.volume), bits(b.core.volume));
    EXPECT_EQ(bits(a.core.targetFraction), bits(b.core.targetFraction));
    EXPECT_EQ(bits(a.core.targetLength), bits(b.core.targetLength));
    expectSameBits(a.core.notchStart, b.core.notchStart);
    expectSameBits(a.core.notchEnd, b.core.notchEnd);
}

void expectOneLineAbout(const std::filesystem::path& file, const std::string& words, const std::string& error)
{
    EXPECT_TRUE(error.starts_with(file.string() + ": ")) << error;
    EXPECT_NE(error.find(words), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
}

using tests::executeSql;

std::string query(const std::filesystem::path& file, const std::string& sql)
{
    sqlite3* database = nullptr;
    sqlite3_stmt* statement = nullptr;
    sqlite3_open(file.c_str(), &database);
    EXPECT_EQ(sqlite3_prepare_v2(database, sql.c_str(), -1, &statement, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    std::string text;
    if (statement != nullptr && sqlite3_step(statement) == SQLITE_ROW && sqlite3_column_text(statement, 0) != nullptr) {
        text = std::string(static_cast<const char*>(sqlite3_column_blob(statement, 0)));
    }
    sqlite3_finalize(statement);
    sqlite3_close(database);
    return text;
}

// Every field of every tick comes back with the same bits, for both zeros, infinities, subnormals and whole numbers.
TEST(Record, ReturnsTheBitsOfEveryField)
{
    const synthetic::Folder folder;
    std::mt19937_64 random(7);
    std::vector<TickRecord> ticks;
    for (std::uint64_t n = 0; n < 2500; ++n) {
        ticks.push_back(synthetic::anyTick(3 * n, random));
    }
    synthetic::record(folder / "a.palpate", synthetic::info(), ticks);
    const std::vector<TickRecord> back = synthetic::read(Record(folder / "a.palpate"));
    ASSERT_EQ(back.size(), ticks.size());
    for (std::size_t i = 0; i < ticks.size(); ++i) {
        expectSame(ticks[i], back[i], 3);
    }
}

TEST(Record, NotANumberComesBackAsOne)
{
    const synthetic::Folder folder;
    TickRecord tick;
    tick.tissueForce.x = std::numeric_limits<double>::quiet_NaN();
    synthetic::record(folder / "a.palpate", synthetic::info(), {tick});
    EXPECT_TRUE(std::isnan(synthetic::read(Record(folder / "a.palpate")).at(0).tissueForce.x));
}

TEST(Record, ReturnsTheSessionAndItsResults)
{
    const synthetic::Folder folder;
    const SessionInfo in = synthetic::info();
    synthetic::record(folder / "a.palpate", in, {TickRecord{}}, {{"total", "78"}, {"note", "a 'quoted' word"}});
    const Record record(folder / "a.palpate");
    const SessionInfo& out = record.info();
    EXPECT_EQ(out.scene, in.scene);
    EXPECT_EQ(out.sceneText, in.sceneText);
    EXPECT_EQ(out.sceneOrigin, in.sceneOrigin);
    EXPECT_EQ(out.volumeHash, in.volumeHash);
    EXPECT_EQ(out.model, in.model);
    EXPECT_EQ(out.device, in.device);
    EXPECT_EQ(out.name, in.name);
    EXPECT_EQ(out.operatorName, in.operatorName);
    EXPECT_EQ(out.host, in.host);
    EXPECT_EQ(out.started, in.started);
    EXPECT_EQ(out.build, in.build);
    EXPECT_EQ(out.rate, in.rate);
    EXPECT_EQ(out.seed, in.seed);
    EXPECT_EQ(out.structures, in.structures);
    EXPECT_EQ(out.tissues, in.tissues);
    EXPECT_EQ(out.warnDistances, in.warnDistances);
    EXPECT_EQ(out.extra, in.extra);
    EXPECT_TRUE(record.complete());
    EXPECT_EQ(record.ticks(), 1U);
    using Pairs = std::vector<std::pair<std::string, std::string>>;
    EXPECT_EQ(record.results(), (Pairs{{"total", "78"}, {"note", "a 'quoted' word"}}));
}

// What a researcher asks in SQL: units in the names, words for phases and events, seconds, joins by row.
TEST(Record, ReadsWellFromSql)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.palpate";
    synthetic::record(file, synthetic::info(), synthetic::procedure(4, 0.5, 1));
    EXPECT_EQ(query(file, "SELECT phase FROM ticks WHERE seconds = 2.0"), "inserted");
    EXPECT_EQ(query(file, "SELECT typeof(total_y_n) || typeof(tick) FROM ticks LIMIT 1"), "realinteger");
    EXPECT_EQ(query(file, "SELECT s.name FROM events e JOIN structures s USING (structure) WHERE kind = 'warning'"),
              "vessel");
    EXPECT_EQ(query(file, "SELECT t.name FROM core_fractions c JOIN tissues t USING (tissue) ORDER BY fraction DESC"),
              "tumour");
    EXPECT_EQ(query(file, "PRAGMA integrity_check"), "ok");
}

TEST(Recorder, LeavesOnePlainFile)
{
    const synthetic::Folder folder;
    synthetic::record(folder / "a.palpate", synthetic::info(), {TickRecord{}});
    Record(folder / "a.palpate").ticks();
    std::size_t files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.path())) {
        ++files;
    }
    EXPECT_EQ(files, 1U);
}

TEST(Recorder, RefusesAFileThatExists)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.palpate";
    std::ofstream(file) << "mine";
    expectOneLineAbout(file, "exists already; choose another name or remove it",
                       tests::errorOf([&] { Recorder(file, synthetic::info()); }));
    std::string text;
    std::ifstream(file) >> text;
    EXPECT_EQ(text, "mine");
}

TEST(Recorder, SaysWhenTheFileCannotBeMade)
{
    const synthetic::Folder folder;
    expectOneLineAbout(folder / "no/a", "cannot be made: unable to open database file",
                       tests::errorOf([&] { Recorder(folder / "no/a", synthetic::info()); }));
}

TEST(Recorder, PushAllocatesNothing)
{
    const synthetic::Folder folder;
    Recorder recorder(folder / "a.palpate", synthetic::info());
    TickRecord tick;
    EXPECT_EQ(tests::allocationsIn([&] {
                  for (; tick.tick < 5000; ++tick.tick) {
                      recorder.push(tick);
                  }
              }),
              0U);
    EXPECT_EQ(recorder.lost(), 0U);
}

// Ticks pushed faster than they can be written are counted, and what is in the file plus what is lost is all there was.
TEST(Recorder, CountsWhatAFullRingLoses)
{
    const synthetic::Folder folder;
    const std::uint64_t pushed = 200000;
    std::uint64_t lost = 0;
    {
        Recorder recorder(folder / "a.palpate", synthetic::info());
        TickRecord tick;
        for (tick.tick = 0; tick.tick < pushed; ++tick.tick) {
            recorder.push(tick);
        }
        recorder.finish({});
        lost = recorder.lost();
    }
    EXPECT_GT(lost, 0U);
    EXPECT_EQ(Record(folder / "a.palpate").ticks() + lost, pushed);
    EXPECT_EQ(query(folder / "a.palpate", "SELECT value FROM session WHERE key = 'lost_ticks'"), std::to_string(lost));
}

TEST(Recorder, FlushPutsEverythingIntoTheFile)
{
    const synthetic::Folder folder;
    Recorder recorder(folder / "a.palpate", synthetic::info());
    TickRecord tick;
    for (; tick.tick < 1234; ++tick.tick) {
        recorder.push(tick);
    }
    recorder.flush();
    const Record record(folder / "a.palpate");
    EXPECT_EQ(record.ticks(), 1234U);
    EXPECT_FALSE(record.complete());
}

// Pushes at 1 kHz and tells in shared memory how far it got, until it is killed.
[[noreturn]] void recordUntilKilled(const std::filesystem::path& file, std::atomic<std::uint64_t>& pushed)
{
    Recorder recorder(file, synthetic::info());
    auto next = std::chrono::steady_clock::now();
    for (TickRecord tick;; ++tick.tick) {
        recorder.push(tick);
        pushed.store(tick.tick + 1);
        next += std::chrono::milliseconds(1);
        std::this_thread::sleep_until(next);
    }
}

// A kill at any moment: the file opens, is consistent, has every tick in order, and lacks at most 0.5 s = 500 ticks.
TEST(Recorder, KilledWriterLosesAtMostHalfASecond)
{
    void* shared = mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(shared, MAP_FAILED);
    auto* pushed = new (shared) std::atomic<std::uint64_t>(0);
    std::mt19937 random(11);
    const synthetic::Folder folder(tests::memoryFolder());
    for (int round = 0; round < 12; ++round) {
        const auto file = folder / (std::to_string(round) + ".palpate");
        pushed->store(0);
        const pid_t child = fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            recordUntilKilled(file, *pushed);
        }
        const std::uint64_t until = 1 + random() % 900;
        while (pushed->load() < until) {
            std::this_thread::sleep_for(std::chrono::microseconds(300));
        }
        kill(child, SIGKILL);
        int status = 0;
        waitpid(child, &status, 0);
        ASSERT_TRUE(WIFSIGNALED(status));

        const Record record(file);
        EXPECT_FALSE(record.complete());
        std::uint64_t expected = 0;
        record.each([&](const TickRecord& tick) { EXPECT_EQ(tick.tick, expected++); });
        EXPECT_GE(expected + 500, pushed->load());
        EXPECT_EQ(query(file, "PRAGMA integrity_check"), "ok");
    }
    munmap(shared, 4096);
}

// Kills while the file is being made: it is not there, or is a whole record without ticks.
TEST(Recorder, KilledWhileStartingLeavesAWholeRecordOrNone)
{
    const synthetic::Folder folder;
    std::mt19937 random(5);
    for (int round = 0; round < 12; ++round) {
        const auto file = folder / (std::to_string(round) + ".palpate");
        const pid_t child = fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            Recorder recorder(file, synthetic::info());
            pause();
        }
        std::this_thread::sleep_for(std::chrono::microseconds(random() % 8000));
        kill(child, SIGKILL);
        waitpid(child, nullptr, 0);
        const std::string error = tests::errorOf([&] { EXPECT_EQ(Record(file).ticks(), 0U); });
        EXPECT_TRUE(error.empty() || error.find("no such file") != std::string::npos) << error;
    }
}

// The system refuses to let a file grow beyond a limit, as a full disk does: the session goes on, says so on one line,
// and what was written before stays.
TEST(Recorder, FullDiskEndsTheRecordButNotTheSession)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.palpate";
    rlimit unlimited{};
    getrlimit(RLIMIT_FSIZE, &unlimited);
    const rlimit limit{1 << 20, unlimited.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
    {
        Recorder recorder(file, synthetic::info());
        TickRecord tick;
        for (; tick.tick < 20000; ++tick.tick) {
            recorder.push(tick);
            if (tick.tick % 500 == 0) {
                recorder.flush();
            }
        }
        recorder.finish({});
        const std::string error = recorder.error();
        EXPECT_TRUE(error.starts_with(file.string() + ": recording stopped: ")) << error;
        EXPECT_EQ(error.find('\n'), std::string::npos);
        EXPECT_GT(recorder.lost(), 0U);
    }
    setrlimit(RLIMIT_FSIZE, &unlimited);
    const Record record(file);
    EXPECT_FALSE(record.complete());
    std::uint64_t expected = 0;
    record.each([&](const TickRecord& tick) { EXPECT_EQ(tick.tick, expected++); });
    EXPECT_GE(expected, 500U);
    EXPECT_LT(expected, 20000U);
}

// Format 2 had no force of the tissue alone: everything else of it is read.
TEST(Recorder, SaysWhenTheFileIsNotThereAnyMore)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.palpate";
    enum class Fate { stays, removed, moved, replaced };
    for (const Fate fate : {Fate::stays, Fate::removed, Fate::moved, Fate::replaced}) {
        std::filesystem::remove_all(file);
        Recorder recorder(file, synthetic::info());
        recorder.push({});
        recorder.flush();
        if (fate == Fate::removed) {
            std::filesystem::remove(file);
        } else if (fate != Fate::stays) {
            std::filesystem::rename(file, folder / "b.palpate");
        }
        if (fate == Fate::replaced) {
            std::ofstream(file) << "another";
        }
        recorder.finish({});
        const std::string error = recorder.error();
        if (fate == Fate::stays) {
            EXPECT_EQ(error, "");
        } else {
            EXPECT_TRUE(error.starts_with(file.string() + ": was removed or moved while it was written")) << error;
        }
    }
}

TEST(Record, OfTheFormatBeforeIsRead)
{
    const synthetic::Folder folder;
    const auto ticks = synthetic::procedure(2, 1, 1);
    synthetic::record(folder / "old", synthetic::info(), ticks);
    for (const char axis : {'x', 'y', 'z'}) {
        executeSql(folder / "old", std::string("ALTER TABLE ticks DROP COLUMN tissue_force_") + axis + "_n");
    }
    executeSql(folder / "old", "DROP TABLE seal");
    executeSql(folder / "old", "PRAGMA user_version = 2");
    const auto read = synthetic::read(Record(folder / "old"));
    ASSERT_EQ(read.size(), ticks.size());
    for (std::size_t i = 0; i < read.size(); ++i) {
        EXPECT_TRUE(std::isnan(read[i].tissueForce.x)) << i;
        expectSameBits(read[i].total, ticks[i].total);
        expectSameBits(read[i].proxy, ticks[i].proxy);
    }
}

TEST(Record, RefusesWhatIsNoRecordOnOneLine)
{
    const synthetic::Folder folder;
    const auto refuse = [&](const std::filesystem::path& file, const std::string& words) {
        expectOneLineAbout(file, words, tests::errorOf([&] { synthetic::read(Record(file)); }));
    };
    refuse(folder / "none", "no such file");
    refuse(folder.path(), "is a folder, not a file: name a file in it; give the record of a session");
    std::ofstream(folder / "text") << std::string(5000, 'x');
    refuse(folder / "text", "is not a session record");
    std::ofstream(folder / "empty").close();
    refuse(folder / "empty", "holds no session");
    executeSql(folder / "other", "CREATE TABLE t (a)");
    refuse(folder / "other", "is an SQLite file, but not a session record");

    const auto make = [&](const std::string& name) {
        synthetic::record(folder / name, synthetic::info(), synthetic::procedure(2, 1, 1));
        return folder / name;
    };
    const auto newer = make("newer");
    executeSql(newer, "PRAGMA user_version = 99");
    refuse(newer, "format 99");
    for (const std::string table : {"session", "ticks", "events", "cores", "core_fractions", "tissues", "structures"}) {
        const auto file = make("no-" + table);
        executeSql(file, "DROP TABLE " + table);
        refuse(file, "table " + table + " is missing");
    }
    const auto column = make("column");
    executeSql(column, "ALTER TABLE ticks DROP COLUMN proxy_x_m");
    refuse(column, "is damaged");
    const auto words = make("words");
    executeSql(words, "UPDATE ticks SET phase = 'nowhere' WHERE tick = 100");
    refuse(words, "unknown word 'nowhere'");
    const auto torn = make("torn");
    executeSql(torn, "UPDATE ticks SET phase = 'no' || char(10, 233) || 'where' WHERE tick = 100");
    refuse(torn, "unknown word 'no???where'");
    const auto rate = make("rate");
    executeSql(rate, "UPDATE session SET value = -5 WHERE key = 'rate_hz'");
    refuse(rate, "a rate of -5 Hz is outside 100 to 20000 Hz");
}

// Cut anywhere, a record either is refused on one line or, cut behind its last page, read whole.
TEST(Record, TruncatedFilesAreRefusedOnOneLine)
{
    const synthetic::Folder folder;
    const auto whole = folder / "whole";
    synthetic::record(whole, synthetic::info(), synthetic::procedure(2, 1, 1));
    const auto size = std::filesystem::file_size(whole);
    for (const std::uintmax_t keep : {std::uintmax_t{10}, std::uintmax_t{99}, std::uintmax_t{4096}, std::uintmax_t{5000},
                                      size / 2, size - 4096, size - 1}) {
        const auto cut = folder / ("cut-" + std::to_string(keep));
        std::filesystem::copy_file(whole, cut);
        std::filesystem::resize_file(cut, keep);
        const std::string error = tests::errorOf([&] { synthetic::read(Record(cut)); });
        expectOneLineAbout(cut, "", error);
    }
}

// Bytes of a record changed at random: it is read or refused, and never crashes.
TEST(Record, DamagedFilesNeverCrash)
{
    const synthetic::Folder folder;
    const auto whole = folder / "whole";
    synthetic::record(whole, synthetic::info(), synthetic::procedure(1, 1, 1));
    const std::string bytes = base::contentOf(whole).value();
    std::mt19937 random(3);
    for (int round = 0; round < 60; ++round) {
        std::string changed = bytes;
        for (int i = 0; i < 1 + round; ++i) {
            changed[random() % changed.size()] = static_cast<char>(random());
        }
        const auto file = folder / ("damaged-" + std::to_string(round));
        std::ofstream(file, std::ios::binary) << changed;
        const std::string error = tests::errorOf([&] { synthetic::read(Record(file)); });
        EXPECT_TRUE(error.empty() || error.starts_with(file.string() + ": ")) << error;
        EXPECT_EQ(error.find('\n'), std::string::npos);
    }
}

TEST(Record, StructuresBeyondTheLimitAreRefused)
{
    const synthetic::Folder folder;
    SessionInfo info = synthetic::info();
    info.structures.assign(maxStructures + 1, "vessel");
    expectOneLineAbout(folder / "a", "17 structures and 5 tissues: at most 16 structures",
                       tests::errorOf([&] { Recorder(folder / "a", info); }));
    EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

}  // namespace
}  // namespace palpate::haptics
