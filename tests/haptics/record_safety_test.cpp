#include <haptics/recorder.h>

#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>
#include <tests/sqlite_edit.h>

#include <gtest/gtest.h>

#include <sqlite3.h>

#include <filesystem>
#include <fstream>

// What was recorded is not lost, whatever else is done to its files.

namespace palpate::haptics {
namespace {

void expectRefusal(const std::filesystem::path& file, const std::string& words, const std::string& error)
{
    EXPECT_TRUE(error.starts_with(file.string() + ": ")) << error;
    EXPECT_NE(error.find(words), std::string::npos) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos) << error;
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

}  // namespace
}  // namespace palpate::haptics
