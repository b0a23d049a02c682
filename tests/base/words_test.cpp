#include <base/said.h>
#include <base/words.h>

#include <tests/folder.h>

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

namespace palpate::base {
namespace {

struct Words : testing::Test {
    ~Words() override { useLanguage("en"); }
};

TEST_F(Words, ATextIsItselfWithoutATranslation)
{
    useLanguage("en");
    EXPECT_STREQ(tr("Start"), "Start");
    EXPECT_EQ(tr(std::string()), "");
    useLanguage("xx");
    EXPECT_STREQ(tr("Start"), "Start");
    const tests::Folder empty;
    useLanguage("de", empty.path());
    EXPECT_STREQ(tr("Start"), "Start");
}

TEST_F(Words, GermanHasItsOwnWordsPluralsAndNumbers)
{
    useLanguage("de");
    EXPECT_EQ(language(), "de");
    EXPECT_STREQ(tr("Start"), "Beginnen");
    EXPECT_STREQ(trn("{} tick missed", "{} ticks missed", 1), "{} Takt versäumt");
    EXPECT_STREQ(trn("{} tick missed", "{} ticks missed", 2), "{} Takte versäumt");
    EXPECT_EQ(said(tr("inserted {:.1Lf} mm"), 12.34), "12,3 mm eingeführt");
    EXPECT_EQ(spokenHere("idc_high_grade"), "Karzinom hohen Grades");
    EXPECT_EQ(spokenHere("rib above"), "Rippe darüber");
    EXPECT_EQ(spokenHere("something_else"), "something else");
    useLanguage("en");
    EXPECT_EQ(said(tr("inserted {:.1Lf} mm"), 12.34), "inserted 12.3 mm");
}

// LANGUAGE comes before LANG, as gettext has it; the locale itself need not be installed.
TEST_F(Words, TheDesktopsLanguageCounts)
{
    ::unsetenv("LANGUAGE");
    ::unsetenv("LC_ALL");
    ::unsetenv("LC_MESSAGES");
    ::setenv("LANG", "de_AT.UTF-8", 1);
    useLanguage();
    EXPECT_STREQ(tr("Start"), "Beginnen");
    ::setenv("LANGUAGE", "en:de", 1);
    useLanguage();
    EXPECT_STREQ(tr("Start"), "Start");
}

TEST_F(Words, AFormatThatDoesNotFitIsNoException)
{
    EXPECT_EQ(said("{} and {}", 1), "{} and {}");
}

}  // namespace
}  // namespace palpate::base
