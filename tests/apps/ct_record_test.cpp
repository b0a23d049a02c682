#include <tests/apps/program.h>

#include <base/png.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <string>

namespace palpate::apps {
namespace {

// A scene with CT has no ultrasound picture: a picture of its record is a scan.
TEST(CtRecord, APictureOfItIsAScan)
{
    const Folder folder;
    const std::string record = folder / "c.db";
    figures(
        {"train", "ct-core-biopsy", "--model", "spring", "--unpaced", "--no-view", "--seconds", "0.2", "--record", record});
    const Outcome outcome =
        palpate({"export", "--record", record, "--at", "0.1s", "--window", "lung", "-o", folder / "a.png"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_NE(base::textInPng(readText(folder / "a.png"), "palpate-ct"), "");
    expectRefusal({"export", "--record", record, "--at", "0.1s", "--what", "ultrasound", "-o", folder / "b.png"},
                  "is guided by CT and has no ultrasound picture");
}

// A scripted trainee's scans and their dose are in the score, and a record gives the scan of any moment, the same twice.
TEST(CtRecord, ATraineeScansAndTheRecordGivesTheScansAgain)
{
    const Folder folder;
    const std::string record = folder / "c.db";
    const auto played = figures({"train", "ct-core-biopsy", "--trainee", "expert", "--model", "spring", "--unpaced",
                                 "--no-view", "--seed", "2", "--record", record});
    const auto& score = played.at("score");
    EXPECT_GE(score.at("ct_scans").get<int>(), 4);
    EXPECT_NEAR(score.at("ct_dose_mgy_cm").get<double>(), 7.5 * score.at("ct_scans").get<double>(), 1e-6);
    EXPECT_TRUE(score.at("probe_s").is_null());
    const auto make = [&](const std::string& name, const std::string& at, const std::string& window) {
        const Outcome outcome = palpate({"export", "--record", record, "--at", at, "--what", "ct", "--window", window,
                                         "--height", "200", "-o", folder / name});
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readText(folder / name);
    };
    const std::string first = make("a.png", "2s", "soft-tissue");
    EXPECT_NE(base::textInPng(first, "palpate-ct").find("\"tick\":2000"), std::string::npos);
    EXPECT_EQ(make("b.png", "2s", "soft-tissue"), first);
    EXPECT_NE(make("c.png", "2s", "lung"), first);
    EXPECT_NE(make("d.png", "0.1s", "soft-tissue"), first);
    EXPECT_EQ(palpate({"replay", record}).status, 0);
    expectRefusal({"export", "--record", record, "--at", "2s", "--what", "ct", "-o", folder / "e.nrrd"},
                  "are written as .png");
    figures({"train", smallLayered(), "--model", "spring", "--unpaced", "--no-view", "--seconds", "1", "--record",
             folder / "s.db"});
    expectRefusal({"export", "--record", folder / "s.db", "--at", "0.5s", "--what", "ct", "-o", folder / "f.png"},
                  "its scene has no CT");
}

}  // namespace
}  // namespace palpate::apps
