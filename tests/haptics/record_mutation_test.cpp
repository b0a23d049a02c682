#include <base/inputs.h>
#include <haptics/record_check.h>
#include <haptics/replay.h>
#include <haptics/simulation.h>

#include <tests/fuzz_count.h>
#include <tests/haptics/slabs.h>
#include <tests/haptics/synthetic_session.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <sqlite3.h>

#include <fstream>

namespace palpate::haptics {
namespace {

using synthetic::Folder;

const SessionModel& model()
{
    static const SessionModel m =
        tests::boxOf(tests::layers({{"skin", 2e-3}, {"fat", 18e-3}, {"idc_high_grade", 10e-3}, {"fat", 1.0}}),
                     "idc_high_grade", "[model]\nlevel = \"spring\"\n[dffb]\nmode = \"off\"\n");
    return m;
}

// A needle goes 25 mm in, fires, and comes back by 5 mm.
void recordSession(const std::filesystem::path& file)
{
    SessionInfo info = infoOf(model());
    info.build = "one";
    Recorder recorder(file, info);
    Simulation simulation(model());
    ForceHash hash;
    for (int i = 0; i < 400; ++i) {
        DeviceSample sample;
        const double t = i / 400.0;
        sample.position = {0, -5e-3 + (t < 0.8 ? 30e-3 * t / 0.8 : 30e-3 - 25e-3 * (t - 0.8)), 0};
        sample.buttons = buttonDeadMan | (i >= 320 && i < 340 ? buttonFire : 0U);
        const TickRecord& tick = simulation.tick(sample);
        hash.add(tick);
        recorder.push(tick);
    }
    recorder.finish({{"force_hash", fmt::format("{:016x}", hash.value())}});
}

// Bytes set, bits turned, a piece copied over another, the end cut off.
void mutateBytes(const std::filesystem::path& file, std::mt19937_64& random)
{
    std::string bytes = base::contentOf(file).value();
    for (auto n = 1 + random() % 4; n > 0; --n) {
        const std::size_t at = random() % (random() % 4 == 0 ? std::min<std::size_t>(bytes.size(), 200) : bytes.size());
        switch (random() % 8) {
            case 0:
                bytes.resize(std::max<std::size_t>(at, 1));
                break;
            case 1: {
                const std::size_t from = random() % bytes.size();
                const std::size_t length = std::min({std::size_t{64}, bytes.size() - at, bytes.size() - from});
                bytes.replace(at, length, bytes.substr(from, length));
                break;
            }
            case 2:
                bytes[at] = static_cast<char>(random());
                break;
            default:
                bytes[at] = static_cast<char>(bytes[at] ^ (1 << (random() % 8)));
        }
    }
    std::ofstream(file, std::ios::binary) << bytes;
}

struct Sql {
    explicit Sql(const std::filesystem::path& file) { sqlite3_open(file.c_str(), &database); }
    ~Sql() { sqlite3_close(database); }
    Sql(const Sql&) = delete;
    Sql& operator=(const Sql&) = delete;

    std::string one(const std::string& sql) const
    {
        sqlite3_stmt* query = nullptr;
        std::string text;
        if (sqlite3_prepare_v2(database, sql.c_str(), -1, &query, nullptr) == SQLITE_OK &&
            sqlite3_step(query) == SQLITE_ROW && sqlite3_column_text(query, 0) != nullptr) {
            text = reinterpret_cast<const char*>(sqlite3_column_text(query, 0));
        }
        sqlite3_finalize(query);
        return text;
    }
    void run(const std::string& sql) const { sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr); }

    sqlite3* database = nullptr;
};

// A cell set to a value that is none for it or nearly the same, a row away or doubled; in half of the copies the seal goes
// too, so that what is computed again has to tell.
void mutateCells(const std::filesystem::path& file, std::mt19937_64& random)
{
    static constexpr const char* tables[]{"session", "structures", "tissues", "ticks",          "ticks",
                                          "ticks",   "events",     "cores",   "core_fractions", "results"};
    static constexpr const char* values[]{"NULL",
                                          "0",
                                          "-1",
                                          "1e300",
                                          "-9e999",
                                          "9e999",
                                          "1e-300",
                                          "4294967296",
                                          "255",
                                          "200",
                                          "''",
                                          "'x'",
                                          "x'00ff'",
                                          "-0.0",
                                          "1.5",
                                          "'free'",
                                          "zeroblob(100000)",
                                          "9223372036854775807",
                                          "-9223372036854775808",
                                          "1"};
    const Sql sql(file);
    for (auto n = 1 + random() % 2; n > 0; --n) {
        const std::string table = tables[random() % std::size(tables)];
        const std::string row = " WHERE rowid = (SELECT rowid FROM " + table + " ORDER BY rowid LIMIT 1 OFFSET " +
                                std::to_string(random() % (table == "ticks" ? 400 : 8)) + ")";
        const std::string columns = sql.one("SELECT group_concat(name) FROM pragma_table_info('" + table + "')");
        std::vector<std::string> names{""};
        for (const char c : columns) {
            if (c == ',') {
                names.emplace_back();
            } else {
                names.back().push_back(c);
            }
        }
        const std::string column = names[random() % names.size()];
        switch (random() % 6) {
            case 0:
                sql.run("DELETE FROM " + table + row);
                break;
            case 1:
                sql.run("UPDATE " + table + " SET " + column + " = " + column + " * 1.0000001" + row);
                break;
            default:
                sql.run("UPDATE " + table + " SET " + column + " = " + values[random() % std::size(values)] + row);
        }
    }
    if (random() % 2 == 0) {
        sql.run("DELETE FROM seal; DELETE FROM session WHERE key = 'complete'");
    }
}

// All that a session computes; with `poses` also what its device said.
bool same(const Record& record, const std::vector<TickRecord>& a, std::vector<TickRecord> b, bool poses)
{
    TickComparison comparison(record);
    bool all = a.size() >= b.size();
    for (std::size_t i = 0; all && i < b.size(); ++i) {
        b[i].device = poses ? b[i].device : a[i].device;
        all = comparison.add(a[i], b[i]);
    }
    return all;
}

// Whatever is done to a record: it is refused on one line, or what has been changed shows. Nothing is read out of bounds,
// and no replay says "identical" of a record with another result.
TEST(RecordMutation, NoChangedResultPassesForWhatWasRecorded)
{
    const Folder folder(tests::memoryFolder());
    const auto original = folder / "original", copy = folder / "copy";
    recordSession(original);
    const std::vector<TickRecord> ticks = synthetic::read(Record(original));
    ASSERT_EQ(ticks.size(), 400U);
    ASSERT_TRUE(replay(Record(original), model()).identical);
    ASSERT_TRUE(std::ranges::any_of(ticks, &TickRecord::fired)) << "no core in the record";

    int refused = 0, told = 0, harmless = 0;
    const int count = tests::fuzzCount(300);
    for (int i = 0; i < count; ++i) {
        std::mt19937_64 random(static_cast<std::uint64_t>(i));
        std::filesystem::copy_file(original, copy, std::filesystem::copy_options::overwrite_existing);
        i % 2 == 0 ? mutateBytes(copy, random) : mutateCells(copy, random);
        try {
            const Record record(copy);
            const RecordCheck check = checkRecord(record, "one");
            const std::vector<TickRecord> read = synthetic::read(record);
            if (check.warnings.empty()) {
                EXPECT_TRUE(read.size() == ticks.size() && same(record, ticks, read, true))
                    << "copy " << i << ": another result without a warning";
            }
            if (contradictionIn(record.info(), model()).empty() && !read.empty() && replay(record, model()).identical) {
                EXPECT_TRUE(same(record, ticks, read, false)) << "copy " << i << ": identical with another result";
            }
            (check.warnings.empty() ? harmless : told) += 1;
        } catch (const std::runtime_error& e) {
            EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
            ++refused;
        }
        for (const char* left : {"-wal", "-shm", "-journal"}) {
            std::filesystem::remove(copy.string() + left);
        }
    }
    RecordProperty("refused", refused);
    RecordProperty("told", told);
    RecordProperty("harmless", harmless);
    EXPECT_GT(refused, count / 10);
    EXPECT_GT(told, count / 10);
}

}  // namespace
}  // namespace palpate::haptics
