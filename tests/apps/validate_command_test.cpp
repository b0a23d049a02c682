#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace palpate::apps {
namespace {

// Drops of a beam under its own weight and under 0.5 N; `loaded` [mm] is the same of all markers.
std::string beamFile(double loaded)
{
    std::string text = "# two runs\ntip_load_N,marker,settled_down_mm\n";
    for (const char* marker : {"0", "1", "2"}) {
        text += std::string("0,") + marker + ",6.5\n0.5," + marker + "," + std::to_string(loaded) + "\n";
    }
    return text;
}

// Each verdict is what error and bound say, and the exit status repeats them.
TEST(ValidateCommand, ExitStatusRepeatsTheVerdict)
{
    const Folder folder;
    const auto file = folder / "silicone_cantilever_static.csv";
    writeText(file, beamFile(17.0));
    const auto run = [&] {
        const Outcome o = palpate({"validate", "beam", "--quick", "--data", folder.path(), "--json", folder / "v.json"});
        const auto j = nlohmann::json::parse(readText(folder / "v.json")).at("experiments");
        EXPECT_EQ(j.size(), 1U);
        const auto& e = j.at(0);
        for (const char* key : {"name", "quantity", "source", "fitted_on", "predicted", "note"}) {
            EXPECT_FALSE(e.at(key).get<std::string>().empty()) << key;
        }
        EXPECT_EQ(e.at("pass").get<bool>(), e.at("error_pct").get<double>() <= e.at("bound_pct").get<double>());
        EXPECT_EQ(o.status == 0, e.at("pass").get<bool>()) << o.err;
        return std::pair(o, e.at("error_pct").get<double>());
    };
    const double good = run().second;
    EXPECT_LT(good, 8.0);
    writeText(file, beamFile(34.0));
    const auto [outcome, wrong] = run();
    EXPECT_GT(wrong, 40.0);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_NE(outcome.err.find("1 of 1 experiments fail: beam"), std::string::npos) << outcome.err;
}

// A set that is nowhere is not run, says so, and is no success; the others are run all the same.
TEST(ValidateCommand, WhatIsNotThereIsNotRun)
{
    const Folder folder;
    ::unsetenv("PALPATE_MEASURED");
    const Outcome o = palpate({"validate", "needle", "beam", "--quick", "--csv", folder / "v.csv"});
    EXPECT_EQ(o.status, 1);
    EXPECT_NE(o.err.find("not run (name the experiments that you want): needle"), std::string::npos) << o.err;
    const std::string csv = readText(folder / "v.csv");
    EXPECT_NE(csv.find("\nneedle,not run,"), std::string::npos) << csv;
    EXPECT_NE(csv.find("\nbeam,"), std::string::npos) << csv;
}

TEST(ValidateCommand, DamagedMeasurementsAreRefused)
{
    const Folder folder;
    writeText(folder / "silicone_cantilever_static.csv", "tip_load_N,marker,settled_down_mm\n0,0\n");
    expectRefusal({"validate", "beam", "--data", folder.path()}, "silicone_cantilever_static.csv, line 2");
    expectRefusal({"validate", "--data", folder / "none"}, "is no folder");
    expectRefusal({"validate", "bean"}, "bean");
    expectRefusal({"validate", "palpation", "--tissues", "/nonexistent.toml"}, "only the experiment ultrasound");
    const std::string twice = folder / "v", table = folder / "t.toml";
    expectRefusal({"validate", "beam", "--json", twice, "--csv", twice}, "would be written twice");
    writeText(table, "");
    expectRefusal({"validate", "ultrasound", "--tissues", table, "--json", table}, "is a file that is read");
    const std::string measured = folder / "silicone_cantilever_static.csv";
    expectRefusal({"validate", "beam", "--data", folder.path(), "--csv", measured}, "is a file that is read");
}

// One page with a picture per experiment, beside its figures.
TEST(ValidateCommand, FolderHasAPageAndPictures)
{
    const Folder folder;
    const Outcome o = palpate({"validate", "beam", "relaxation", "--quick", "-o", folder / "v"});
    EXPECT_EQ(o.out.find("nan"), std::string::npos) << o.out;
    for (const char* name : {"validation.html", "validation.csv", "validation.json", "beam.png", "relaxation-held.png",
                             "relaxation-hysteresis.png"}) {
        EXPECT_TRUE(std::filesystem::exists((folder / "v") / name)) << name << o.err;
    }
    // Its eleven columns are wider than a narrow window.
    const std::string page = readText(folder / "v/validation.html");
    EXPECT_NE(page.find("<div class=\"scroll\"><table class=\"plain\">"), std::string::npos);
    EXPECT_EQ(page.find("<table>"), std::string::npos);
}

}  // namespace
}  // namespace palpate::apps
