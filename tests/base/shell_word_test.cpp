#include <base/shell_word.h>

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <string>

namespace palpate::base {
namespace {

TEST(ShellWord, AShellReadsTheSameWordAgain)
{
    for (const std::string word :
         {"anna", "O'Brien", "a b", "\"x\"", "$HOME", "a\\b", "`id`", "", "~", "sw ö'q/#1", "a;b"}) {
        std::FILE* const shell = popen(("printf '%s' " + shellWord(word)).c_str(), "r");
        ASSERT_NE(shell, nullptr);
        std::array<char, 100> read{};
        const std::size_t count = std::fread(read.data(), 1, read.size(), shell);
        EXPECT_EQ(pclose(shell), 0) << word;
        EXPECT_EQ(std::string(read.data(), count), word);
    }
    EXPECT_EQ(shellWord("cases/breast-1.toml"), "cases/breast-1.toml");
}

}  // namespace
}  // namespace palpate::base
