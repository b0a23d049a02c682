
#include <apps/command.h>
#include <base/inputs.h>
#include <haptics/score.h>

#include <tests/error_of.h>
#include <tests/haptics/synthetic_session.h>

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <cstdlib>
#include <fstream>

namespace palpate::apps {
namespace {

namespace synthetic = haptics::synthetic;

// What `palpate score ARGUMENTS` prints, also where it throws.
void score(std::vector<std::string> arguments, std::string& printed)
{
    CLI::App app;
    addScore(app);
    arguments.insert(arguments.begin(), "score");
    std::ranges::reverse(arguments);
    ::testing::internal::CaptureStdout();
    try {
        app.parse(arguments);
    } catch (...) {
        printed = ::testing::internal::GetCapturedStdout();
        throw;
    }
    printed = ::testing::internal::GetCapturedStdout();
}

std::string score(std::vector<std::string> arguments)
{
    std::string printed;
    score(std::move(arguments), printed);
    return printed;
}

nlohmann::json readJson(const std::filesystem::path& file)
{
    return nlohmann::json::parse(std::ifstream(file));
}

// A session with a push of `depth` and of a peak force of `force`.
std::string session(const synthetic::Folder& folder, const std::string& name, double depth, double force)
{
    std::vector<haptics::TickRecord> ticks(2000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        ticks[n].phase = haptics::Phase::inserted;
        ticks[n].inserted = depth * static_cast<double>(n) / 1999;
        ticks[n].device.position.y = ticks[n].inserted;
        ticks[n].distance = {1, 1, 1};
        ticks[n].total.x = force;
    }
    synthetic::record(folder / name, synthetic::info(), ticks);
    return (folder / name).string();
}

TEST(ScoreCommand, PrintsAlsoWhereItsFileCannotBeWritten)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.030, 2.5);
    std::string printed;
    const std::string error = tests::errorOf([&] { score({a, "--json", "/dev/full"}, printed); });
    EXPECT_EQ(printed, score({a}));
    EXPECT_NE(error.find("/dev/full: "), std::string::npos) << error;
}

// On a German desktop only windows speak German: a command had English words and German decimals.
TEST(ScoreCommand, IsEnglishWhateverTheDesktopSpeaks)
{
    const synthetic::Folder folder;
    std::vector<haptics::TickRecord> ticks(2000);
    for (std::size_t n = 0; n < ticks.size(); ++n) {
        ticks[n].tick = n;
        ticks[n].phase = haptics::Phase::inserted;
        ticks[n].distance = {1, -1e-3, 1};  // in a vital structure
    }
    synthetic::record(folder / "a", synthetic::info(), ticks);
    const std::string a = folder / "a", english = score({a});
    EXPECT_NE(english.find("in a vital structure for 2.0 s"), std::string::npos) << english;
    ::setenv("LANGUAGE", "de", 1);
    EXPECT_EQ(score({a}), english);
    ::unsetenv("LANGUAGE");
}

// A folder of pictures that is not there, before the score: nothing is written by halves.
TEST(ScoreCommand, PrintsNothingWhereItsPicturesCannotBeRead)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.030, 2.5), none = folder / "none", page = folder / "r.html";
    std::string printed;
    const std::string error = tests::errorOf([&] { score({a, "--pictures", none, "--report", page}, printed); });
    EXPECT_EQ(printed, "");
    EXPECT_NE(error.find("none: pictures cannot be read"), std::string::npos) << error;
}

TEST(ScoreCommand, GivesEachSessionsMeasuresInTheUnitsOfTheirNames)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.030, 2.5);
    score({a, "--json", (folder / "f.json").string()});
    const auto s = readJson(folder / "f.json")["sessions"][0];
    EXPECT_EQ(s["file"], a);
    EXPECT_EQ(s["complete"], true);
    EXPECT_NEAR(s["deepest_mm"].get<double>(), 30, 1e-9);
    EXPECT_NEAR(s["path_mm"].get<double>(), 30, 1e-9);
    EXPECT_NEAR(s["peak_force_n"].get<double>(), 2.5, 1e-12);
    EXPECT_NEAR(s["seconds"].get<double>(), 1.999, 1e-9);
    EXPECT_TRUE(s["targeting_error_mm"].is_null());
    EXPECT_EQ(s["total"], 25);
}

// Names of files are bytes and need not be UTF-8; JSON is.
TEST(ScoreCommand, ANameThatIsNotUtf8IsReplacedAndTheFileIsWhole)
{
    const synthetic::Folder folder;
    score({session(folder, "a\xff", 0.030, 2.5), "--json", (folder / "f.json").string()});
    const auto file = readJson(folder / "f.json")["sessions"][0]["file"].get<std::string>();
    EXPECT_TRUE(file.ends_with("a\xef\xbf\xbd")) << file;
}

// Depths 10, 20, 60 against 30, 40: of six pairs two are above and four below, delta = -1/3; medians 20 and 35, quartiles
// 15 and 40 of the first. Forces 1, 1, 1 against 1, 1 are ties.
TEST(ScoreCommand, ComparesGroupsByMedianAndCliffsDelta)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.010, 1), b = session(folder, "b", 0.020, 1),
                      c = session(folder, "c", 0.060, 1);
    const std::string d = session(folder, "d", 0.030, 1), e = session(folder, "e", 0.040, 1);
    score({"--group", "new=" + a + "," + b + "," + c, "--group", "old=" + d + "," + e, "--json",
           (folder / "f.json").string(), "--report", (folder / "f.html").string()});
    const auto f = readJson(folder / "f.json");
    EXPECT_NEAR(f["groups"][0]["lower_quartile"]["deepest_mm"].get<double>(), 15, 1e-9);
    EXPECT_NEAR(f["groups"][0]["upper_quartile"]["deepest_mm"].get<double>(), 40, 1e-9);
    const std::string page = base::contentOf(folder / "f.html").value();
    EXPECT_NE(page.find("20.0 (15.0 to 40.0)"), std::string::npos);
    EXPECT_NE(page.find("-0.33"), std::string::npos);
    EXPECT_EQ(f["sessions"].size(), 5U);
    EXPECT_EQ(f["groups"][0]["name"], "new");
    EXPECT_EQ(f["groups"][0]["n"], 3);
    EXPECT_NEAR(f["groups"][0]["median"]["deepest_mm"].get<double>(), 20, 1e-9);
    EXPECT_NEAR(f["groups"][1]["median"]["deepest_mm"].get<double>(), 35, 1e-9);
    EXPECT_EQ(f["effect_size"]["kind"], "cliffs_delta");
    EXPECT_NEAR(f["effect_size"]["deepest_mm"].get<double>(), -1.0 / 3, 1e-12);
    EXPECT_EQ(f["effect_size"]["peak_force_n"], 0);
}

// Nobody fired, and the scene has neither probe nor CT: no figure is made of what was not measured.
TEST(ScoreCommand, GroupsWithoutAValueHaveNoEffectSize)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.010, 1), b = session(folder, "b", 0.020, 1),
                      c = session(folder, "c", 0.030, 1), d = session(folder, "d", 0.040, 1);
    const std::string text = score({"--group", "new=" + a + "," + b, "--group", "old=" + c + "," + d, "--json",
                                    (folder / "f.json").string(), "--report", (folder / "f.html").string()});
    const auto f = readJson(folder / "f.json");
    for (const char* const key : {"targeting_error_mm", "mark_error_mm", "probe_s", "ct_scans", "rest_s"}) {
        EXPECT_TRUE(f["effect_size"][key].is_null()) << key;
        EXPECT_TRUE(f["groups"][0]["median"][key].is_null()) << key;
    }
    EXPECT_EQ(f["effect_size"]["deepest_mm"], -1);
    for (const std::string& shown : {text, base::contentOf(folder / "f.html").value()}) {
        EXPECT_EQ(shown.find("- (- to -)"), std::string::npos) << shown;
    }
    EXPECT_EQ(text.find("probe s"), std::string::npos) << text;
    EXPECT_NE(text.find("deepest mm"), std::string::npos) << text;
}

TEST(ScoreCommand, OneSessionIsNoGroup)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.010, 1), b = session(folder, "b", 0.020, 2);
    const std::string text = score({"--group", "new=" + a, "--group", "old=" + b, "--json", (folder / "f.json").string(),
                                    "--report", (folder / "f.html").string()});
    EXPECT_TRUE(readJson(folder / "f.json")["effect_size"]["deepest_mm"].is_null());
    EXPECT_EQ(text.find("+1.00") + text.find("-1.00"), 2 * std::string::npos) << text;
    EXPECT_NE(base::contentOf(folder / "f.html").value().find("over old: -"), std::string::npos);
}

// 20.01 and 20.02 mm are both printed as 20.0.
TEST(ScoreCommand, ValuesThatArePrintedTheSameAreTies)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.02001, 1), b = session(folder, "b", 0.02001, 2),
                      c = session(folder, "c", 0.02002, 1), d = session(folder, "d", 0.02002, 2);
    score({"--group", "new=" + a + "," + b, "--group", "old=" + c + "," + d, "--json", (folder / "f.json").string(),
           "--report", (folder / "f.html").string()});
    EXPECT_EQ(readJson(folder / "f.json")["effect_size"]["deepest_mm"], 0);
    const std::string page = base::contentOf(folder / "f.html").value();
    EXPECT_NE(page.find("Deepest insertion [mm] 20.0"), std::string::npos) << "it is the same in all sessions";
    EXPECT_EQ(page.find("aria-label=\"Deepest insertion\""), std::string::npos);
}

// Counted twice it would move medians and make a group of one session two.
TEST(ScoreCommand, ARecordIsInAGroupOnce)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.01, 1), b = session(folder, "b", 0.02, 1);
    const std::string copy = (folder / "copy").string(), other = folder.path().string() + "/./a";
    std::filesystem::copy_file(a, copy);
    for (const std::string& again : {a, copy, other}) {
        const std::string error = tests::errorOf([&] { score({"--group", "x=" + a + "," + b + "," + again}); });
        EXPECT_NE(error.find(again + " is the record " + a + ", which is in this group already"), std::string::npos)
            << error;
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
    score({"--group", "x=" + a + "," + b, "--group", "y=" + a, "--json", (folder / "f.json").string()});
    EXPECT_EQ(readJson(folder / "f.json")["groups"][1]["n"], 1) << "it may be in two groups";
}

TEST(ScoreCommand, WrongRequestsAreToldOnOneLine)
{
    const synthetic::Folder folder;
    const std::string a = session(folder, "a", 0.01, 1);
    for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
             {},
             {a, (folder / "none").string()},
             {"--group", "name"},
             {"--group", "=" + a},
             {"--group", "name=" + a + ",," + a},
             {a, "--pictures", folder.path().string()},
             {a, session(folder, "b", 0.01, 1), "--report", (folder / "r.html").string()}}) {
        try {
            score(arguments);
            ADD_FAILURE() << "nothing was refused";
        } catch (const std::runtime_error& e) {
            EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
        }
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "r.html"));
}

}  // namespace
}  // namespace palpate::apps
