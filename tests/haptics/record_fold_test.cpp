#include <haptics/recorder.h>

#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <sqlite3.h>

#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <memory>

// A record is one plain file once its log is folded into it.

namespace palpate::haptics {
namespace {

std::atomic<ino_t> fullFile{0};

bool isFull(int descriptor)
{
    struct stat s {};
    return ::fstat(descriptor, &s) == 0 && s.st_ino == fullFile;
}

ssize_t writeUnlessFull(int descriptor, const void* bytes, size_t count)
{
    errno = ENOSPC;
    return isFull(descriptor) ? -1 : ::write(descriptor, bytes, count);
}

ssize_t pwriteUnlessFull(int descriptor, const void* bytes, size_t count, off_t offset)
{
    errno = ENOSPC;
    return isFull(descriptor) ? -1 : ::pwrite(descriptor, bytes, count, offset);
}

/// While it lives, SQLite finds no room for writes to one file; its log can grow.
class NoRoomFor {
public:
    explicit NoRoomFor(const std::filesystem::path& file)
    {
        struct stat s {};
        EXPECT_EQ(::stat(file.c_str(), &s), 0);
        fullFile = s.st_ino;
        const auto pwriteCall = reinterpret_cast<sqlite3_syscall_ptr>(pwriteUnlessFull);
        const auto writeCall = reinterpret_cast<sqlite3_syscall_ptr>(writeUnlessFull);
        vfs_->xSetSystemCall(vfs_, "write", writeCall);
        vfs_->xSetSystemCall(vfs_, "pwrite", pwriteCall);
        vfs_->xSetSystemCall(vfs_, "pwrite64", pwriteCall);
    }
    ~NoRoomFor()
    {
        fullFile = 0;
        vfs_->xSetSystemCall(vfs_, nullptr, nullptr);
    }
    NoRoomFor(const NoRoomFor&) = delete;
    NoRoomFor& operator=(const NoRoomFor&) = delete;

private:
    sqlite3_vfs* vfs_ = sqlite3_vfs_find(nullptr);
};

void pushAll(Recorder& recorder)
{
    for (const TickRecord& tick : synthetic::procedure(2, 0.5, 1)) {
        recorder.push(tick);
    }
    recorder.flush();
}

bool logIsThere(const std::filesystem::path& file)
{
    return std::filesystem::exists(file.string() + "-wal");
}

TEST(RecordFold, IsDoneBeforeTheSessionReports)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.db";
    Recorder recorder(file, synthetic::info());
    pushAll(recorder);
    EXPECT_TRUE(logIsThere(file));
    recorder.finish({{"score_total", "61.2"}});
    EXPECT_FALSE(logIsThere(file));
    EXPECT_EQ(recorder.error(), "");
    EXPECT_TRUE(recorder.whole());
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
}

// The file is what is left, and with its log it is the whole session: the command of the message makes one file of both.
TEST(RecordFold, WithoutRoomIsSaidAndCanBeDoneLater)
{
    const synthetic::Folder folder;
    const auto file = folder / "it's a.db";
    std::string error;
    {
        auto recorder = std::make_unique<Recorder>(file, synthetic::info());
        pushAll(*recorder);
        const NoRoomFor full(file);
        recorder->finish({{"score_total", "61.2"}});
        error = recorder->error();
        EXPECT_TRUE(recorder->whole()) << "no tick is missing";
        recorder.reset();
    }
    EXPECT_TRUE(error.starts_with(file.string() + ": is whole only together with " + file.string() + "-wal: ")) << error;
    EXPECT_EQ(error.find('\n'), std::string::npos);
    EXPECT_TRUE(logIsThere(file));
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
    const std::size_t command = error.find("sqlite3 ");
    ASSERT_NE(command, std::string::npos) << error;
    EXPECT_EQ(std::system((error.substr(command, error.find(" makes one file") - command) + " > /dev/null").c_str()), 0);
    EXPECT_FALSE(logIsThere(file));
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
}

// A viewer may read all the time, also what was there before the session's end.
TEST(RecordFold, IsLeftToAReaderWithoutAnError)
{
    const synthetic::Folder folder;
    sqlite3* reader = nullptr;
    for (const char* const reading : {"SELECT count(*) FROM ticks", "BEGIN; SELECT count(*) FROM ticks"}) {
        const auto name = folder / (std::string(reading, 5) + ".db");
        {
            Recorder recorder(name, synthetic::info());
            pushAll(recorder);
            ASSERT_EQ(sqlite3_open_v2(name.c_str(), &reader, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
            EXPECT_EQ(sqlite3_exec(reader, reading, nullptr, nullptr, nullptr), SQLITE_OK);
            recorder.finish({{"score_total", "61.2"}});
            EXPECT_EQ(recorder.error(), "") << reading;
            EXPECT_TRUE(recorder.whole());
        }
        EXPECT_EQ(Record(name).seal().state, Seal::State::whole) << reading;
        sqlite3_close(reader);
        EXPECT_EQ(Record(name).seal().state, Seal::State::whole) << reading;
    }
}

// What a reader kept from finish() is folded when the recorder ends.
TEST(RecordFold, IsDoneWhenTheReaderHasEnded)
{
    const synthetic::Folder folder;
    const auto file = folder / "a.db";
    {
        Recorder recorder(file, synthetic::info());
        pushAll(recorder);
        const auto reader = std::make_unique<Record>(file);
        recorder.finish({});
        EXPECT_TRUE(logIsThere(file));
    }
    EXPECT_FALSE(logIsThere(file));
    EXPECT_EQ(Record(file).seal().state, Seal::State::whole);
}

}  // namespace
}  // namespace palpate::haptics
