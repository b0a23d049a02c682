#include <tests/folder.h>
#include <trainer/errands.h>

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace palpate::trainer {
using tests::Folder;

namespace {

// A program that prints a line, and ends with this status.
void makeProgram(const std::filesystem::path& file, const std::string& line, int status)
{
    std::ofstream(file) << "#!/bin/sh\necho '" << line << "' >&2\nexit " << status << "\n";
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
}

// The debrief's window cannot say itself why it did not open.
TEST(Errands, AReplayThatFailedSaysWhy)
{
    const Folder folder;
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    const auto replay = [&](const std::string& line, int status) {
        makeProgram(folder / "palpate-view", line, status);
        errands.run(Errand::startDebrief, state);
        for (int i = 0; state.replaying && i < 1000; ++i) {
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
            errands.look(state);
        }
        return state.notice;
    };
    const std::string why = "palpate-view: --ghost e.db: is a session in another body";
    EXPECT_EQ(replay(why, 1), why);
    EXPECT_EQ(replay("palpate-view: all is well", 0), "") << "and what was wrong before is gone";
}

}  // namespace
}  // namespace palpate::trainer
