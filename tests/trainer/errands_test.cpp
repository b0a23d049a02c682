#include <tests/folder.h>
#include <trainer/errands.h>

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

namespace palpate::trainer {
using tests::Folder;

namespace {

void makeScript(const std::filesystem::path& file, const std::string& script)
{
    std::ofstream(file) << "#!/bin/sh\n" << script;
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
}

// A program that prints a line, and ends with this status.
void makeProgram(const std::filesystem::path& file, const std::string& line, int status)
{
    makeScript(file, "echo '" + line + "' >&2\nexit " + std::to_string(status) + "\n");
}

// The debrief's window cannot say itself why it did not open.
TEST(Errands, AReplayThatFailedSaysWhy)
{
    const Folder folder;
    SessionFolder sink(folder / "sessions");
    Errands errands(folder.path(), sink);
    State state;
    state.cases.emplace_back();
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

// Where the home cannot be written, the first screen says it in the user's words, not in those of a command.
TEST(Errands, AHomeThatCannotBeWrittenIsSaidInWords)
{
    const Folder folder;
    std::ofstream(folder / "file") << "";
    makeScript(folder / "palpate",
               "if [ $1 = profile ]; then echo 'palpate: this folder cannot be made' >&2; exit 1; fi\n"
               "for file; do :; done; echo '{}' >\"$file\"\n");
    SessionFolder sink(folder / "file/palpate/sessions");
    Errands errands(folder.path(), sink);
    State state;
    const char* const before = std::getenv("XDG_DATA_HOME");
    const std::string kept = before != nullptr ? before : "";
    ::setenv("XDG_DATA_HOME", (folder / "file").c_str(), 1);
    errands.list(state);
    before != nullptr ? ::setenv("XDG_DATA_HOME", kept.c_str(), 1) : ::unsetenv("XDG_DATA_HOME");
    EXPECT_NE(state.notice.find("no profiles can be kept"), std::string::npos) << state.notice;
    EXPECT_NE(state.notice.find("--sessions"), std::string::npos) << state.notice;
}

}  // namespace
}  // namespace palpate::trainer
