#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>

namespace palpate::apps {
namespace {

using nlohmann::json;

const json* cellOf(const json& figures, const std::string& id)
{
    for (const json& cell : figures["cells"]) {
        if (cell["id"] == id) {
            return &cell;
        }
    }
    return nullptr;
}

bool passes(const json& figures, const std::string& scene, const std::string& method, const std::string& grip = "grip")
{
    const json* const cell = cellOf(figures, scene + "/" + method + "/premium/" + grip + "/1000");
    EXPECT_NE(cell, nullptr) << scene << " " << method;
    return cell != nullptr && (*cell)["pass"].get<bool>();
}

// The default method holds in every cell of the short matrix, and each other fails where the literature says that it does.
TEST(StabilityCommand, OursHoldsAndEachBaselineFailsWhereItIsKnownTo)
{
    const Folder folder;
    const std::filesystem::path out = folder / "out";
    const Outcome outcome = palpate({"stability", "--quick", "-o", out.string()});
    const json figures = json::parse(readText(out / "stability.json"));
    for (const json& cell : figures["cells"]) {
        for (const char* key : {"id", "scene", "method", "device", "grip", "rate_hz", "pass", "figure", "unit", "bound"}) {
            EXPECT_TRUE(cell.contains(key)) << key;
        }
        EXPECT_TRUE(cell["method"] != "elastic" || cell["pass"].get<bool>()) << cell.dump();
    }
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    for (const json& row : figures["theory"]) {
        EXPECT_LT(std::abs(row["error_pct"].get<double>()), 5.0) << row.dump();
    }
    EXPECT_FALSE(passes(figures, "plate-1mm", "superposed_normals"));
    EXPECT_FALSE(passes(figures, "plate-1mm", "penalty"));
    EXPECT_FALSE(passes(figures, "slide-30deg-20mm_s", "god_object"));
    EXPECT_FALSE(passes(figures, "slide-30deg-20mm_s", "superposed_normals"));
    EXPECT_FALSE(passes(figures, "plate-1mm", "layers"));
    EXPECT_FALSE(passes(figures, "detour", "chainmail_force"));
    EXPECT_FALSE(passes(figures, "tumour-step", "late_60hz"));
    EXPECT_NE(readText(out / "stability.html").find("plate-1mm/elastic/premium/grip/1000"), std::string::npos);
    const std::string csv = readText(out / "stability.csv");
    EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(csv, '\n')), figures["cells"].size() + 1);
}

// Also at another rate than 1 kHz: the record says which.
TEST(StabilityCommand, ACellAgainIsARecordThatReplays)
{
    const Folder folder;
    for (const std::string rate : {"500", "1000"}) {
        const std::string id = "plate-1mm/elastic/touch/grip/" + rate;
        const std::string file = folder / ("cell-" + rate + ".db");
        const json once = figures({"stability", "--case", id});
        const json recorded = figures({"stability", "--case", id, "--record", file});
        EXPECT_EQ(once["cells"], recorded["cells"]);
        const json replayed = figures({"replay", file});
        EXPECT_TRUE(replayed["identical"].get<bool>()) << rate;
        EXPECT_GT(replayed["ticks"], 500);
    }
}

TEST(StabilityCommand, RefusesWhatThereIsNot)
{
    expectRefusal({"stability", "--scenes", "moon"}, "there are plate-1mm");
    expectRefusal({"stability", "--methods", "magic"}, "there are elastic");
    expectRefusal({"stability", "--case", "plate-1mm/elastic"}, "is no cell");
    expectRefusal({"stability", "--fuzz", "-1"}, "--fuzz: ");
    expectRefusal({"stability", "--record", "x.db"}, "--case");
    const std::string cell = "plate-1mm/elastic/touch/grip/";
    expectRefusal({"stability", "--case", cell + "1000x"}, "is no cell");
    expectRefusal({"stability", "--case", cell + "1000", "--record", "r.vdb"}, "it must end in .db");
    EXPECT_FALSE(std::filesystem::exists("r.vdb"));
    expectRefusal({"stability", "--case", cell + "1000", "--record", "q.db", "--json", "q.db"}, "would be written twice");
    expectRefusal({"stability", "--case", cell + "1000", "--record", "q.db", "--json", "q.vdb"}, "would be written twice");
    expectRefusal({"stability", "--case", "puncture-kick/god_object/touch/grip/1000"}, "god_object does not support that");
    for (const char* const option : {"--output", "--scenes", "--methods", "--devices", "--rates", "--fuzz"}) {
        expectRefusal({"stability", "--case", cell + "1000", option, "500"}, option);
    }
}

}  // namespace
}  // namespace palpate::apps
