#include <base/user_files.h>
#include <base/utf8.h>

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace palpate::base {
namespace {

// An environment variable as it was before, when it goes out of scope.
class Variable {
public:
    Variable(const char* name, const char* value) : name_(name)
    {
        if (const char* const old = std::getenv(name)) {
            old_ = old;
            isSet_ = true;
        }
        set(value);
    }
    ~Variable() { set(isSet_ ? old_.c_str() : nullptr); }
    Variable(const Variable&) = delete;
    Variable& operator=(const Variable&) = delete;

private:
    void set(const char* value) const { value != nullptr ? setenv(name_, value, 1) : unsetenv(name_); }

    const char* name_;
    std::string old_;
    bool isSet_ = false;
};

// The XDG base directory specification: the variable, else the usual folder in the home; what is not absolute is ignored.
TEST(UserFiles, LieWhereTheSpecificationSays)
{
    const Variable home("HOME", "/home/ada");
    {
        const Variable config("XDG_CONFIG_HOME", "/etc/ada"), data("XDG_DATA_HOME", "relative"),
            cache("XDG_CACHE_HOME", "");
        EXPECT_EQ(userFolder(UserFolder::config), "/etc/ada/palpate");
        EXPECT_EQ(userFolder(UserFolder::data), "/home/ada/.local/share/palpate");
        EXPECT_EQ(userFolder(UserFolder::cache), "/home/ada/.cache/palpate");
        EXPECT_EQ(trainerSettings(), "/etc/ada/palpate/trainer.json");
    }
    const Variable none("HOME", nullptr), config("XDG_CONFIG_HOME", nullptr);
    EXPECT_TRUE(userFolder(UserFolder::config).empty());
    EXPECT_TRUE(trainerSettings().empty());
}

TEST(UserFiles, PlainNamesHaveNoSignsButKeepLetters)
{
    EXPECT_EQ(plainName("Ada L. (2)"), "Ada-L---2-");
    EXPECT_EQ(plainName("J\xc3\xb6rg/../x"), "J\xc3\xb6rg----x");
    EXPECT_EQ(progressPages("A-b"), "progress-A-b");
    EXPECT_EQ(progressPages("ada"), "progress-ada");
}

// The second page would lie over the first.
TEST(UserFiles, NamesThatDifferInSignsHaveTheirOwnPages)
{
    EXPECT_NE(progressPages("A b"), progressPages("A-b"));
    EXPECT_TRUE(progressPages("A b").starts_with("progress-A-b-")) << progressPages("A b");
}

TEST(Utf8, IsWhatTheStandardSays)
{
    for (const char* text : {"", "ada", "J\xc3\xb6rg", "\xe1\xbb\x87", "\xf0\x9f\x98\x80"})
        EXPECT_TRUE(isUtf8(text)) << text;
    for (const char* text : {"bad\xff", "\xc3", "\xc0\xaf", "\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\xe0\x80\x80"})
        EXPECT_FALSE(isUtf8(text)) << text;
}

}  // namespace
}  // namespace palpate::base
