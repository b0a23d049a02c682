#include <tests/apps/program.h>
#include <tests/sqlite_edit.h>

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>

namespace palpate::apps {
namespace {

// An edit of a record, and a word of it that replay and score have to name.
struct Edit {
    const char* sql;
    const char* replay;
    const char* score;
    bool recomputed = false;  // replay sees it without the seal too
};

const std::vector<Edit> edits{
    {"UPDATE ticks SET total_y_n = total_y_n + 1e-12 WHERE tick = 2000", "total_y_n", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET basic_x_n = 0.5 WHERE tick = 7", "basic_x_n", "ticks 0 to 999", true},
    {"UPDATE ticks SET additional_z_n = 1.0 WHERE tick = 7", "additional_z_n", "ticks 0 to 999", true},
    {"UPDATE ticks SET tissue_force_y_n = 2.0 WHERE tick = 2500", "tissue_force_y_n", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET proxy_x_m = 0.01 WHERE tick = 2500", "proxy_x_m", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET tip_y_m = tip_y_m + 1e-4 WHERE tick = 2500", "from tick 2500 on", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET buttons = 0 WHERE tick = 2500", "from tick 2500 on", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET energy_j = 0.0 WHERE tick = 2500", "energy_j", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET phase = 'free' WHERE tick = 2500", "phase", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET inserted_m = 0.001 WHERE tick = 2500", "inserted_m", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET distance_0_m = 0.0 WHERE tick = 2500", "distance_0_m", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET warned = 1 WHERE tick = 2500", "warned", "ticks 2000 to 2999", true},
    {"UPDATE ticks SET h4_us = 1.0 WHERE tick = 7", "ticks 0 to 999", "ticks 0 to 999"},
    {"UPDATE ticks SET tissue = 200 WHERE tick = 7", "tissue is 200", "tissue is 200", true},
    {"UPDATE ticks SET nearest_vital = 200 WHERE tick = 7", "nearest_vital is 200", "nearest_vital is 200", true},
    {"UPDATE ticks SET tip_x_m = 9e999 WHERE tick = 7", "is inf", "is inf", true},
    {"DELETE FROM ticks WHERE tick BETWEEN 1100 AND 1199", "tick 1100 is missing",
     "ticks are missing, the first of them tick 1100", true},
    {"DELETE FROM ticks WHERE tick = 0", "tick 0 is missing", "the first of them tick 0", true},
    {"DELETE FROM ticks WHERE tick > 4200", "ticks 4000 to 4999", "ticks 4000 to 4999"},
    {"DELETE FROM events WHERE kind = 'puncture'", "events", "events"},
    {"UPDATE events SET value = value + 1e-9 WHERE kind = 'fire'", "events", "events", true},
    {"UPDATE events SET tissue = 0 WHERE kind = 'contact'", "events", "events", true},
    {"UPDATE events SET kind = 'release' WHERE kind = 'contact'", "events", "events", true},
    {"DELETE FROM cores", "core is missing", "core is missing", true},
    {"UPDATE cores SET target_fraction = 1e9", "target_fraction", "target_fraction", true},
    {"UPDATE cores SET target_fraction = 1.0", "target_fraction", "cores", true},
    {"DELETE FROM core_fractions", "fraction of", "core_fractions", true},
    {"UPDATE session SET value = 9e999 WHERE key = 'rate_hz'", "rate of inf", "rate of inf", true},
    {"UPDATE session SET value = 500.0 WHERE key = 'rate_hz'", "ticks is not as", "ticks is not as", true},
    {"UPDATE session SET value = 'palpate 9.9' WHERE key = 'build'", "session.build", "another build"},
    {"UPDATE session SET value = replace(value, 'spring', 'chainmail') WHERE key = 'scene_text'", "model", "model", true},
    {"UPDATE session SET value = 'deep' WHERE key = 'scene'", "scene", "'deep'", true},
    {"UPDATE session SET value = '0' WHERE key = 'volume_hash'", "the volume or the tissue table", "session.volume_hash",
     true},
    {"UPDATE session SET value = 'P-08' WHERE key = 'operator'", "session.operator", "session.operator"},
    {"UPDATE session SET value = '2020-01-01T00:00:00Z' WHERE key = 'started'", "session.started", "session.started"},
    {"UPDATE session SET value = 'mouse' WHERE key = 'device'", "session.device", "session.device"},
    {"UPDATE structures SET name = 'cyst' WHERE structure = 0", "list of structures", "structures.0", true},
    {"UPDATE structures SET warn_distance_m = 0.5 WHERE structure = 1", "warning distances", "structures.1", true},
    {"UPDATE results SET value = '99.0' WHERE key = 'score_total'", "score_total", "its total is 100"},
    {"UPDATE results SET value = '0' WHERE key = 'force_hash'", "force_hash", "its forces have the hash"},
    {"UPDATE results SET value = '' WHERE key = 'force_hash'", "force_hash", "results.force_hash"},
    {"INSERT INTO results VALUES ('force_hash', '0')", "force_hash", "results.force_hash"},
    {"DELETE FROM seal", "the seal is gone", "the seal is gone"},
    {"DELETE FROM seal; DELETE FROM session WHERE key = 'complete'", "open", "open"},
    {"PRAGMA user_version = 3", "has no seal, and here one is", "has no seal, and here one is", true},
    {"CREATE TRIGGER t AFTER UPDATE ON ticks BEGIN DELETE FROM ticks; END", "tables and indexes", "tables and indexes"},
};

class RecordEdits : public testing::Test {
protected:
    static void SetUpTestSuite()
    {
        folder_ = new Folder(tests::memoryFolder());
        figures({"train", smallLayered(), "--model", "spring", "--unpaced", "--headless", "--operator", "P-07", "--record",
                 original()});
    }
    static void TearDownTestSuite()
    {
        delete folder_;
        folder_ = nullptr;
    }
    static std::string original() { return (*folder_ / "session.db").string(); }
    // A copy with the edit in it.
    static std::string edited(const std::string& sql)
    {
        const std::string copy = (*folder_ / "edited.db").string();
        std::filesystem::copy_file(original(), copy, std::filesystem::copy_options::overwrite_existing);
        tests::executeSql(copy, sql);
        return copy;
    }

private:
    static inline Folder* folder_ = nullptr;
};

TEST_F(RecordEdits, WhatWasNotEditedPassesWithoutAWord)
{
    const Outcome replayed = palpate({"replay", original()}), scored = palpate({"score", original()});
    EXPECT_EQ(replayed.status, 0) << replayed.err;
    EXPECT_EQ(replayed.err + scored.err, "");
    EXPECT_EQ(scored.status, 0);
    const auto figures = nlohmann::json::parse(palpate({"score", original(), "--json", "-"}).out).at("sessions").at(0);
    EXPECT_EQ(figures.at("operator"), "P-07");
    EXPECT_EQ(figures.at("doubts").size(), 0U);
    EXPECT_EQ(figures.at("record_sha256").get<std::string>().size(), 64U);
    EXPECT_NE(figures.at("host"), "");
    EXPECT_NE(figures.at("started"), "");
}

TEST_F(RecordEdits, EachIsNamedByReplayAndScore)
{
    for (const Edit& edit : edits) {
        const std::string file = edited(edit.sql);
        const bool open = std::string(edit.replay) == "open";
        const Outcome replayed = palpate({"replay", file}), scored = palpate({"score", file});
        EXPECT_EQ(replayed.status, open ? 0 : 1) << edit.sql;
        EXPECT_NE((open ? replayed.out : replayed.err).find(edit.replay), std::string::npos)
            << edit.sql << "\nreplay: " << replayed.err;
        EXPECT_EQ(std::ranges::count(replayed.err, '\n'), open ? 0 : 1) << replayed.err;
        EXPECT_NE(scored.err.find(edit.score), std::string::npos) << edit.sql << "\nscore: " << scored.err;
        EXPECT_TRUE(scored.status == 0 || scored.status == 1) << edit.sql;
        // The seal says that it was changed, and the build is this one.
        EXPECT_EQ(replayed.err.find("made by another"), std::string::npos) << replayed.err;
    }
}

// Who edits a record may take its seal away, and the mark that it was closed: what is computed again shows all the same.
TEST_F(RecordEdits, WhatIsComputedAgainShowsWithoutTheSealToo)
{
    for (const Edit& edit : edits) {
        if (edit.recomputed) {
            const std::string file =
                edited(std::string(edit.sql) + "; DELETE FROM seal; DELETE FROM session WHERE key = 'complete'");
            const Outcome replayed = palpate({"replay", file});
            EXPECT_EQ(replayed.status, 1) << edit.sql;
            EXPECT_NE(replayed.err.find(edit.replay), std::string::npos) << edit.sql << "\nreplay: " << replayed.err;
            EXPECT_EQ(replayed.err.find("another build"), std::string::npos) << edit.sql << "\nreplay: " << replayed.err;
        }
    }
}

std::string palpateProgram()
{
    return std::string(PALPATE_BIN_DIR) + "/palpate";
}

// What nobody got was not printed.
TEST_F(RecordEdits, AFullDeviceBehindTheOutputIsAnError)
{
    for (const std::string& words :
         {"score " + original(), "replay " + original(), std::string("--version"), std::string("help")}) {
        const Outcome outcome = Program("/bin/sh", {"-c", palpateProgram() + " " + words + " > /dev/full"}).wait();
        EXPECT_EQ(outcome.status, 1) << words;
        EXPECT_NE(outcome.err.find("standard output"), std::string::npos) << words << ": " << outcome.err;
    }
    expectRefusal({"score", original(), "--json", "/dev/full"}, "/dev/full: cannot be written");
    // Nor can the error be said there.
    EXPECT_EQ(Program("/bin/sh", {"-c", palpateProgram() + " score none.db 2> /dev/full"}).wait().status, 1);
}

// What is computed on the way to a state names what differs, too.
TEST_F(RecordEdits, AStateOfAnEditedRecordIsNotExported)
{
    const Folder folder;
    const std::string file = edited("UPDATE ticks SET total_y_n = total_y_n + 1e-12 WHERE tick = 500");
    const std::string out = folder / "state.nrrd";
    const Outcome exported = palpate({"export", "--record", file, "--at", "1s", "-o", out});
    EXPECT_EQ(exported.status, 1);
    EXPECT_NE(exported.err.find("differs from tick 500 on: the record was changed after it was closed: "),
              std::string::npos)
        << exported.err;
    EXPECT_NE(exported.err.find("total_y_n"), std::string::npos) << exported.err;
    EXPECT_FALSE(std::filesystem::exists(out));
    // What comes behind a state is not read for it.
    const std::string damaged = edited("UPDATE ticks SET tip_x_m = NULL WHERE tick = 500");
    EXPECT_EQ(palpate({"export", "--record", damaged, "--at", "1s", "-o", out}).status, 1);
    EXPECT_EQ(palpate({"export", "--record", damaged, "--at", "0.4s", "-o", out}).status, 0);
}

// No room for a byte (RLIMIT_FSIZE; the signal that comes with it is ignored, as on a disk that is full).
TEST_F(RecordEdits, OnAFullDiskNoEmptyFileStaysAndNoneIsNamed)
{
    const Folder folder;
    const std::string figures = folder / "figures.json", report = folder / "report.html";
    // What is said goes through a pipe: into a file it could not be written either.
    const auto onAFullDisk = [](const std::string& command) {
        return Program("/bin/sh", {"-c", "( trap '' XFSZ; ulimit -f 0; " + palpateProgram() + " " + command +
                                             " 2>&1; echo status $? ) | cat"})
            .wait()
            .out;
    };
    const std::string scored = onAFullDisk("score " + original() + " --json " + figures);
    EXPECT_NE(scored.find("status 1"), std::string::npos) << scored;
    EXPECT_NE(scored.find(figures + ": cannot be written"), std::string::npos) << scored;
    EXPECT_FALSE(std::filesystem::exists(figures));
    const std::string trained =
        onAFullDisk("train " + smallLayered() + " --model spring --unpaced --headless --seconds 1 --record " +
                    (folder / "s.db").string() + " --report " + report + " --json " + figures);
    EXPECT_NE(trained.find("status 1"), std::string::npos) << trained;
    EXPECT_EQ(trained.find("report: "), std::string::npos) << trained;
    EXPECT_EQ(trained.find("record: "), std::string::npos) << trained;
    EXPECT_NE(trained.find("palpate: "), std::string::npos) << trained;
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// Another program of the same user makes the segment of a running session shorter: without a guard that is a SIGBUS in the
// simulation and in every viewer.
TEST(TornSegment, SessionAndViewerEndInOrderAndSayWhy)
{
    const Folder folder;
    const std::string session = "torn-" + std::to_string(getpid()), record = folder / "s.db";
    const std::filesystem::path segment = "/dev/shm/palpate-" + session;
    Program train("palpate",
                  {"train", smallLayered(), "--model", "spring", "--headless", "--session", session, "--record", record});
    std::optional<Program> view;
    if (built("palpate-view")) {
        view.emplace("palpate-view", std::vector<std::string>{"--session", session, "--offscreen", folder / "pictures",
                                                              "--wait", "1", "--every", "0.2"});
    }
    for (int i = 0; i < 600 && !(std::filesystem::exists(segment) && std::filesystem::exists(record)); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    std::filesystem::resize_file(segment, 0);
    const Outcome trained = train.wait();
    EXPECT_EQ(trained.status, 1) << trained.err;
    EXPECT_NE(trained.err.find("its shared memory was cut off by another program"), std::string::npos) << trained.err;
    EXPECT_EQ(palpate({"replay", record}).status, 0) << "the record was not closed in order";
    if (view) {
        const Outcome viewed = view->wait();
        EXPECT_GE(viewed.status, 0) << "killed by signal " << -viewed.status;
    }
    EXPECT_FALSE(std::filesystem::exists(segment));
}

}  // namespace
}  // namespace palpate::apps
