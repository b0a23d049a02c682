#include <haptics/record_check.h>
#include <haptics/recorder.h>

#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>
#include <tests/sqlite_edit.h>

#include <gtest/gtest.h>

#include <sqlite3.h>

#include <cstdlib>
#include <fstream>

namespace palpate::haptics {
namespace {

using tests::executeSql;

std::filesystem::path procedureIn(const synthetic::Folder& folder, const std::string& name)
{
    synthetic::record(folder / name, synthetic::info(), synthetic::procedure(3, 0.5, 1), {{"score_total", "61.2"}});
    return folder / name;
}

TEST(RecordSeal, ClosesARecordAndIsTheSameForTheSameSession)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const Seal a = Record(procedureIn(folder, "a")).seal(), b = Record(procedureIn(folder, "b")).seal();
    EXPECT_EQ(a.state, Seal::State::whole);
    EXPECT_TRUE(a.changed.empty());
    EXPECT_EQ(a.sha256.size(), 64U);
    EXPECT_EQ(a.sha256, b.sha256);
}

// Forty sessions with random bits in every field: what is read is what was written.
TEST(RecordSeal, HoldsForAnySession)
{
    const synthetic::Folder folder(tests::memoryFolder());
    std::mt19937_64 random(3);
    for (int round = 0; round < 40; ++round) {
        std::vector<TickRecord> ticks;
        for (std::uint64_t n = 0; n < 60; ++n) {
            ticks.push_back(synthetic::anyTick(37 * n, random));
        }
        const auto file = folder / std::to_string(round);
        synthetic::record(file, synthetic::info(), ticks);
        EXPECT_EQ(Record(file).seal().state, Seal::State::whole) << round;
    }
}

// The hash of one row by hand: SHA-256 of 't' and the length and bytes of each text, and the row's end.
TEST(RecordSeal, IsTheSha256OfTypesValuesAndRows)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto file = procedureIn(folder, "a");
    sqlite3* database = nullptr;
    sqlite3_stmt* query = nullptr;
    ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
    sqlite3_prepare_v2(database, "SELECT sha256 FROM seal WHERE part = 'session.operator'", -1, &query, nullptr);
    ASSERT_EQ(sqlite3_step(query), SQLITE_ROW);
    const std::string sealed(reinterpret_cast<const char*>(sqlite3_column_text(query, 0)));
    sqlite3_finalize(query);
    sqlite3_close(database);
    const auto text = [](const std::string& s) {
        return "t" + std::string(1, static_cast<char>(s.size())) + std::string(7, '\0') + s;
    };
    std::ofstream(folder / "row", std::ios::binary) << text("operator") << text("P-07") << '\n';
    const std::string command = "sha256sum " + (folder / "row").string() + " > " + (folder / "sum").string();
    ASSERT_EQ(std::system(command.c_str()), 0);
    std::string sum;
    std::ifstream(folder / "sum") >> sum;
    EXPECT_EQ(sealed, sum);
}

TEST(RecordSeal, NamesWhatWasChanged)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const std::vector<std::pair<const char*, const char*>> edits{
        {"UPDATE ticks SET total_y_n = total_y_n + 1e-15 WHERE tick = 1500", "ticks 1000 to 1999 is not what was written"},
        {"DELETE FROM ticks WHERE tick > 2500", "ticks 2000 to 2999: 501 rows where 1000 were written"},
        {"UPDATE ticks SET h4_us = 1 WHERE tick = 3", "ticks 0 to 999 is not what was written"},
        {"UPDATE events SET value = value * 1.0000000001", "events is not what was written"},
        {"UPDATE session SET value = 'P-08' WHERE key = 'operator'", "session.operator is not what was written"},
        {"DELETE FROM session WHERE key = 'host'", "session.host is gone"},
        {"INSERT INTO session VALUES ('extra.note', 'x')", "session.extra.note was added"},
        {"UPDATE results SET value = '99' WHERE key = 'score_total'", "results.score_total is not what was written"},
        {"UPDATE cores SET fragments = fragments + 1", "cores is not what was written"},
        {"UPDATE tissues SET name = 'lard' WHERE tissue = 2", "tissues.2 is not what was written"},
        {"CREATE INDEX i ON ticks (total_y_n)", "tables and indexes: 10 rows where 9 were written"},
        {"DELETE FROM seal", "the seal is gone"},
        {"UPDATE seal SET rows = 99 WHERE part = 'events'", "events: "},
        {"UPDATE seal SET sha256 = 'x' WHERE part = 'record'", "table seal is not what was written"}};
    for (const auto& [sql, words] : edits) {
        const auto file = procedureIn(folder, "a");
        executeSql(file, sql);
        const Seal seal = Record(file).seal();
        EXPECT_EQ(seal.state, Seal::State::broken) << sql;
        EXPECT_NE(someOf(seal.changed).find(words), std::string::npos) << sql << ": " << someOf(seal.changed);
        std::filesystem::remove(file);
    }
}

TEST(RecordSeal, ARecordThatWasNotClosedIsOpen)
{
    const synthetic::Folder folder(tests::memoryFolder());
    Recorder recorder(folder / "a", synthetic::info());
    recorder.push(TickRecord{});
    recorder.flush();
    const Record record(folder / "a");
    EXPECT_EQ(record.seal().state, Seal::State::open);
    const RecordCheck check = checkRecord(record, synthetic::info().build);
    ASSERT_FALSE(check.warnings.empty());
    EXPECT_NE(check.warnings[0].find("the record is open"), std::string::npos) << check.warnings[0];
}

TEST(RecordCheck, SaysWhichTicksAreMissingAndWhoseBuildItWas)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto file = procedureIn(folder, "a");
    executeSql(file, "DELETE FROM ticks WHERE tick BETWEEN 100 AND 149");
    const RecordCheck check = checkRecord(Record(file), "another");
    const std::string all = someOf(check.warnings, 10);
    for (const char* words :
         {"was changed after it was closed: ticks 0 to 999: 950 rows where 1000",
          "50 of 3000 ticks are missing, the first of them tick 100", "was recorded by another build"}) {
        EXPECT_NE(all.find(words), std::string::npos) << all;
    }
}

// The servo loop left out a fifth of the session: its record has every tick that there was.
TEST(RecordCheck, SaysHowMuchTimeWasMissed)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const auto check = [&](const char* name, const char* missed, double rate = 1000) {
        SessionInfo info = synthetic::info();
        info.rate = rate;
        synthetic::record(folder / name, info, synthetic::procedure(4, 0.8, 1), {{"missed_ticks", missed}});
        return someOf(checkRecord(Record(folder / name), synthetic::info().build).warnings, 10);
    };
    EXPECT_NE(check("a", "800").find("800 ticks were missed"), std::string::npos) << check("a", "800");
    EXPECT_NE(check("b", "800").find("too small by up to 0.8 s"), std::string::npos);
    EXPECT_EQ(check("c", "2").find("missed"), std::string::npos);
    EXPECT_NE(check("d", "800", 500).find("too small by up to 1.6 s"), std::string::npos);
}

// Every value is bounded before it is handed out; the error names it.
TEST(RecordBounds, ValuesThatNoSessionHasAreRefused)
{
    const synthetic::Folder folder(tests::memoryFolder());
    const std::vector<std::pair<const char*, const char*>> edits{
        {"UPDATE session SET value = 9e999 WHERE key = 'rate_hz'", "a rate of inf Hz"},
        {"UPDATE session SET value = 1e-9 WHERE key = 'rate_hz'", "a rate of 1e-09 Hz"},
        {"UPDATE session SET value = 'fast' WHERE key = 'rate_hz'", "rate_hz is no number"},
        {"INSERT INTO session VALUES ('rate_hz', 1000.0)", "key rate_hz twice"},
        {"DELETE FROM session WHERE key = 'scene_text'", "no key scene_text"},
        {"UPDATE session SET value = '-3' WHERE key = 'seed'", "seed '-3' is no whole number"},
        {"UPDATE ticks SET tip_x_m = 9e999 WHERE tick = 5", "tick 5: the tip's distance from the origin [m] is inf"},
        {"UPDATE ticks SET tip_x_m = NULL WHERE tick = 5", "tick 5: the tip's distance from the origin [m] is nan"},
        {"UPDATE ticks SET axis_y = 2.0 WHERE tick = 5", "tick 5: the length of the axis is 2"},
        {"UPDATE ticks SET total_x_n = 1e6 WHERE tick = 5", "tick 5: total force [N] is 1e+06"},
        {"UPDATE ticks SET tissue = 200 WHERE tick = 5", "tick 5: tissue is 200"},
        {"UPDATE ticks SET tissue = 3000000000 WHERE tick = 5", "tick 5: tissue is 3000000000"},
        {"UPDATE ticks SET ahead_tissue = 5 WHERE tick = 5", "tick 5: ahead_tissue is 5, and the session has 5"},
        {"UPDATE ticks SET nearest_vital = 200 WHERE tick = 5", "tick 5: nearest_vital is 200"},
        {"UPDATE ticks SET warned = -1 WHERE tick = 5", "tick 5: warned is -1"},
        {"UPDATE ticks SET moved = 1.5 WHERE tick = 5", "tick 5: moved is no whole number"},
        {"UPDATE ticks SET energy_j = 'much' WHERE tick = 5", "tick 5: energy_j is no number"},
        {"UPDATE ticks SET fresh = 7 WHERE tick = 5", "tick 5: fresh is 7"},
        {"UPDATE ticks SET h4_us = NULL WHERE tick = 5", "tick 5: the time of a task"},
        {"UPDATE ticks SET tick = -4 WHERE tick = 5", "tick is -4"},
        {"UPDATE events SET tissue = 63", "tissue of an event is 63"},
        {"UPDATE events SET structure = 200", "structure of an event is 200"},
        {"DELETE FROM events WHERE position = 0 AND tick = (SELECT tick FROM cores)", "no error"},
        {"INSERT INTO events SELECT * FROM events", "is missing or there twice"},
        {"INSERT INTO events VALUES (90000, 0, 'contact', NULL, 1, 0.0)", "table events has a row of tick 90000"},
        {"UPDATE cores SET target_fraction = 1e9", "target_fraction of the core is 1e+09"},
        {"UPDATE cores SET volume_m3 = -1.0", "volume_m3 of the core is -1"},
        {"UPDATE core_fractions SET tissue = 60", "fraction of the core is"},
        {"UPDATE core_fractions SET fraction = NULL", "fraction of the core is nan"},
        {"DELETE FROM cores", "its core is missing, and it fired"},
        {"UPDATE ticks SET fired = 0", "a core of a tick that did not fire"},
        {"UPDATE structures SET structure = 9 WHERE structure = 1", "table structures has row 2 where 1 should be"},
        {"UPDATE structures SET warn_distance_m = -1.0 WHERE structure = 1", "a warning distance of -1 m"},
        {"UPDATE tissues SET name = char(10)", "the name of a tissue has control characters"},
        {"DROP TABLE events; CREATE TABLE events AS SELECT 1", "table events is not as a recorder makes it"},
        {"PRAGMA user_version = 3", "has no seal, and here one is"}};
    for (const auto& [sql, words] : edits) {
        const auto file = procedureIn(folder, "a");
        executeSql(file, sql);
        const std::string error = tests::errorOf([&] { synthetic::read(Record(file)); });
        const bool refused = std::string(words) != "no error";
        EXPECT_EQ(error.starts_with(file.string() + ": "), refused) << sql << ": " << error;
        EXPECT_TRUE(!refused || error.find(words) != std::string::npos) << sql << ": " << error;
        EXPECT_EQ(error.find('\n'), std::string::npos);
        std::filesystem::remove(file);
    }
}

TEST(RecordBounds, ASessionThatNoRecordHoldsIsRefusedBeforeAFileIsMade)
{
    const synthetic::Folder folder(tests::memoryFolder());
    SessionInfo endless = synthetic::info(), anonymous = synthetic::info();
    endless.rate = std::numeric_limits<double>::infinity();
    anonymous.operatorName = std::string(201, 'x');
    for (const SessionInfo& info : {endless, anonymous}) {
        EXPECT_NE(tests::errorOf([&] { Recorder(folder / "a", info); }).find("cannot be made"), std::string::npos);
        EXPECT_FALSE(std::filesystem::exists(folder / "a"));
    }
}

}  // namespace
}  // namespace palpate::haptics
