#include <base/file_lock.h>

#include <tests/folder.h>

#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace palpate::base {
namespace {

pid_t inAChild(const std::function<void()>& work)
{
    const pid_t child = fork();
    if (child == 0) {
        work();
        _exit(0);
    }
    return child;
}

std::string textOf(const std::filesystem::path& file)
{
    std::ifstream in(file);
    std::string text;
    std::getline(in, text);
    return text;
}

TEST(FileLock, OneAtATimeHoldsIt)
{
    const tests::Folder folder;
    const std::filesystem::path file = folder / "lock";
    {
        const auto lock = FileLock::of(file);
        ASSERT_TRUE(lock);
        lock->write("a long text of who holds it");
        lock->write("mine");
        EXPECT_EQ(textOf(file), "mine");
        EXPECT_FALSE(FileLock::of(file));
        EXPECT_EQ(textOf(file), "mine");
    }
    EXPECT_FALSE(std::filesystem::exists(file));
    EXPECT_TRUE(FileLock::of(file));
}

// What a dead process leaves is a file, and no lock.
TEST(FileLock, EndsWithItsProcess)
{
    const tests::Folder folder;
    const std::filesystem::path file = folder / "lock";
    const pid_t child = inAChild([&] {
        const auto lock = FileLock::of(file);
        lock->write("held");
        pause();
    });
    while (textOf(file) != "held") {
        std::this_thread::yield();
    }
    EXPECT_FALSE(FileLock::of(file));
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    EXPECT_EQ(textOf(file), "held");
    EXPECT_TRUE(FileLock::of(file));
}

// The holder ends without a word; a process that it has started lives on.
TEST(FileLock, AChildHasItUntilItLeavesIt)
{
    for (const bool leaves : {true, false}) {
        const tests::Folder folder;
        const std::filesystem::path file = folder / "lock";
        std::array<int, 2> ready{};
        ASSERT_EQ(pipe(ready.data()), 0);
        const pid_t holder = inAChild([&] {
            auto lock = FileLock::of(file);
            inAChild([&] {
                if (leaves) {
                    lock->leave();
                }
                const pid_t self = getpid();
                [[maybe_unused]] const auto told = write(ready[1], &self, sizeof self);
                pause();
            });
            pause();
        });
        pid_t child = 0;
        ASSERT_EQ(read(ready[0], &child, sizeof child), static_cast<ssize_t>(sizeof child));
        EXPECT_FALSE(FileLock::of(file));
        kill(holder, SIGKILL);
        waitpid(holder, nullptr, 0);
        EXPECT_EQ(FileLock::of(file).has_value(), leaves);
        kill(child, SIGKILL);
        close(ready[0]);
        close(ready[1]);
    }
}

// Processes that take it, count up and let go, which removes the file each time: no count is lost.
TEST(FileLock, NoTwoEverHoldItAlsoWhileItIsRemovedAndMadeAgain)
{
    const tests::Folder folder;
    const std::filesystem::path file = folder / "lock", count = folder / "count";
    std::ofstream(count) << 0;
    constexpr int processes = 4, each = 50;
    std::vector<pid_t> children;
    for (int i = 0; i < processes; ++i) {
        children.push_back(inAChild([&] {
            for (int n = 0; n < each;) {
                if (const auto lock = FileLock::of(file)) {
                    const int before = std::stoi(textOf(count));
                    std::ofstream(count) << before + 1;
                    ++n;
                }
            }
        }));
    }
    for (const pid_t child : children) {
        int status = 0;
        waitpid(child, &status, 0);
        EXPECT_EQ(status, 0);
    }
    EXPECT_EQ(textOf(count), std::to_string(processes * each));
}

TEST(FileLock, AFolderThatIsNotThereIsAnError)
{
    const tests::Folder folder;
    EXPECT_THROW(FileLock::of(folder / "none" / "lock"), std::runtime_error);
}

}  // namespace
}  // namespace palpate::base
