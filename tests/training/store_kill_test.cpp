#include <training/store.h>

#include <haptics/record_format.h>
#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

namespace palpate::training {
namespace {

namespace fs = std::filesystem;

constexpr int kills = 50, measuresEach = 24;

// A process that stores sessions until it is killed, and says after each that it is stored.
[[noreturn]] void storeForever(const fs::path& file, int out)
{
    ProfileStore store(file);
    const Person anna = store.find("anna");
    for (std::int64_t n = 0;; ++n) {
        StoredSession s;
        s.started = "2026-11-22T09:00:00Z";
        s.scene = std::string(300, 'x');
        for (int m = 0; m < measuresEach; ++m) {
            s.values["measure" + std::to_string(m)] = static_cast<double>(n);
        }
        store.store(anna, s);
        if (::write(out, "s", 1) != 1) {
            ::_exit(1);
        }
    }
}

std::size_t storedBefore(int in)
{
    std::size_t count = 0;
    char c = 0;
    while (::read(in, &c, 1) == 1) {
        ++count;
    }
    return count;
}

// Killed at any moment, also within a transaction: the file is whole, has every session that was said to be stored, at most
// one more, and every session has all its measures.
TEST(ProfileStoreKilled, LosesNothingAndHalvesNothing)
{
    const tests::Folder folder;
    const fs::path file = folder / "p.db";
    {
        ProfileStore store(file);
        store.add("anna", Hand::right);
    }
    std::mt19937 random(7);
    std::size_t known = 0;
    for (int k = 0; k < kills; ++k) {
        int ends[2];
        ASSERT_EQ(::pipe(ends), 0);
        const pid_t child = ::fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            ::close(ends[0]);
            try {
                storeForever(file, ends[1]);
            } catch (...) {
                ::_exit(2);
            }
        }
        ::close(ends[1]);
        // From before it has opened the file to dozens of sessions.
        ::usleep(static_cast<useconds_t>(random() % 60000));
        ::kill(child, SIGKILL);
        int status = 0;
        ::waitpid(child, &status, 0);
        ASSERT_TRUE(WIFSIGNALED(status)) << "it ended by itself, " << WEXITSTATUS(status);
        const std::size_t said = storedBefore(ends[0]);
        ::close(ends[0]);

        const ProfileStore store(file);
        const auto sessions = store.sessions(store.find("anna"));
        ASSERT_GE(sessions.size(), known + said);
        ASSERT_LE(sessions.size(), known + said + 1);
        known = sessions.size();
        for (const StoredSession& s : sessions) {
            ASSERT_EQ(s.values.size(), static_cast<std::size_t>(measuresEach));
        }
        haptics::format::Database database(file.string(), SQLITE_OPEN_READWRITE);
        haptics::format::Statement check(database, "PRAGMA integrity_check");
        ASSERT_TRUE(check.step());
        ASSERT_EQ(check.text(0), "ok");
    }
    EXPECT_GT(known, 0U) << "the processes were killed before they stored anything";
}

// No file can become longer, as on a disk that is full.
class NoRoom {
public:
    NoRoom() : handler_(std::signal(SIGXFSZ, SIG_IGN))
    {
        ::getrlimit(RLIMIT_FSIZE, &before_);
        const rlimit none{0, before_.rlim_max};
        ::setrlimit(RLIMIT_FSIZE, &none);
    }
    ~NoRoom()
    {
        ::setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }
    NoRoom& operator=(NoRoom&&) = delete;

private:
    rlimit before_{};
    void (*handler_)(int);
};

// Alone; beside what an older version left, which has begun a log in vain; beside another program, with a change in its
// log.
TEST(ProfileStoreFullDisk, ReadsAndSaysThatItIsFullWhereItWouldWrite)
{
    const tests::Folder folder;
    const fs::path file = folder / "p.db";
    const auto filesThere = [&] { return std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()); };
    std::string written;
    const auto peopleOnAFullDisk = [&](bool writes) {
        const NoRoom full;
        std::size_t people = 0;
        const std::string error = tests::errorOf([&] { people = ProfileStore::toRead(file).people().size(); });
        written = writes ? tests::errorOf([&] { ProfileStore(file).add("bert", Hand::right); }) : "";
        return error + std::to_string(people);
    };
    {
        ProfileStore store(file);
        store.add("anna", Hand::right);
        EXPECT_EQ(peopleOnAFullDisk(false), "1");
    }
    EXPECT_EQ(peopleOnAFullDisk(false), "1");
    EXPECT_EQ(filesThere(), 1) << "reading leaves nothing";
    std::ofstream(file.string() + "-wal") << "";
    std::ofstream(file.string() + "-shm") << "xyz";
    EXPECT_EQ(peopleOnAFullDisk(true), "1");
    EXPECT_EQ(written, file.string() + ": the disk is full: make room, then try again");
    ProfileStore(file).add("bert", Hand::right);
    EXPECT_EQ(filesThere(), 1);
}

}  // namespace
}  // namespace palpate::training
