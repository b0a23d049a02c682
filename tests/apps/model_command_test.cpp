#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace palpate::apps {
namespace {

// A block of fat that is small enough to be solved in no time, pressed by a sphere.
std::string smallScene(const Folder& folder, int width = 20, int thickness = 12)
{
    const std::string file = folder / "small.toml", thick = std::to_string(thickness);
    writeText(file, "[volume]\nphantom = \"block\"\n[volume.parameters]\nwidth_mm = " + std::to_string(width) +
                        "\nthickness_mm = " + thick +
                        "\ntumours = 0\n[tool]\nkind = \"sphere\"\nradius_mm = 5\n[dffb]\nmode = \"off\"\n[target]\n"
                        "structure = \"base\"\naim_mm = [0, " +
                        thick + ", 0]\nentry_mm = [0, 0, 0]\n");
    return file;
}

// For what is measured: enough of it that it is more than the noise of the machine.
std::string measuredScene(const Folder& folder)
{
    return smallScene(folder, 30, 16);
}

TEST(BenchKernel, WritesItsFiguresAndTheChart)
{
    const Folder folder;
    const std::string out = folder / "kernel";
    const auto figures = apps::figures({"bench", "kernel", "--quick", "--scenes", measuredScene(folder), "-o", out});
    for (const char* key :
         {"cases", "operator_ns_per_node", "bound_fraction", "full_solve_ratio", "coarse_grid_ratio", "machine"}) {
        EXPECT_TRUE(figures.contains(key)) << key;
    }
    ASSERT_EQ(figures["cases"].size(), 2U);
    std::set<std::string> settings;
    for (const auto& c : figures["cases"]) {
        settings.insert(c["setting"]);
        EXPECT_EQ(c["tool"], "sphere_5mm");
        EXPECT_NEAR(c["speed_mm_s"].get<double>(), 20.0, 1e-9);
        for (const char* key : {"tick_us_p50", "tick_us_p99", "nodes", "rms_pct", "near_pct", "max_pct", "force_pct"}) {
            EXPECT_GT(c.at(key).get<double>(), 0.0) << key;
        }
        EXPECT_LT(c["rms_pct"].get<double>(), 10.0);
        EXPECT_LE(c["rms_pct"].get<double>(), c["rms_worst_pct"].get<double>());
        EXPECT_LE(c["tick_us_p50"].get<double>(), c["tick_us_p99"].get<double>());
    }
    EXPECT_EQ(settings, (std::set<std::string>{"default", "fast"}));
    EXPECT_GT(figures["operator_ns_per_node"].get<double>(), 0.0);
    EXPECT_GT(figures["bound_fraction"].get<double>(), 0.0);
    EXPECT_LT(figures["bound_fraction"].get<double>(), 1.0);
    EXPECT_GT(figures["full_solve_ratio"].get<double>(), 1.0);
    for (const char* file : {"kernel.json", "kernel.png", "kernel.html"}) {
        EXPECT_GT(std::filesystem::file_size(out + "/" + file), 1000U) << file;
    }
}

TEST(BenchKernel, WhatIsNotThereIsRefusedOnOneLine)
{
    const Folder folder;
    expectRefusal({"bench", "kernel", "--settings", "nosuch"}, "nosuch");
    expectRefusal({"bench", "kernel", "--tools", "nosuch"}, "sphere_5mm, sphere_10mm, needle, shaft");
    expectRefusal({"bench", "kernel", "--speeds", "0"}, "--speeds 0: must be 1 to 1000 mm/s");
    expectRefusal({"bench", "kernel", "--scenes", "nosuch"}, "nosuch");
    writeText(folder / "file", "no folder");
    expectRefusal({"bench", "kernel", "-o", folder / "file"}, "is no folder");
}

// A plan of that scene, once for all tests: what is printed and what --json has.
struct Planned {
    static const Planned& once()
    {
        static const Planned plan;
        return plan;
    }

    const Folder folder;
    const std::string scene = smallScene(folder), json = folder / "plan.json";
    const Outcome told = palpate({"plan", scene, "--error", "0.05", "--budget", "1ms", "--speed", "50", "--json", json});
};

TEST(Plan, PicksAModelAndSaysWhy)
{
    const Outcome& told = Planned::once().told;
    ASSERT_EQ(told.status, 0) << told.err;
    const auto plan = nlohmann::json::parse(readText(Planned::once().json));
    EXPECT_EQ(plan["level"], "elastic");
    EXPECT_GT(plan["spacing_mm"].get<double>(), 0.0);
    EXPECT_EQ(plan["windows"].size(), 1U);
    EXPECT_GE(plan["sweeps"].get<int>(), 1);
    EXPECT_LE(plan["predicted_error_pct"].get<double>(), 5.0);
    EXPECT_LE(plan["predicted_us"].get<double>(), 1000.0);
    EXPECT_DOUBLE_EQ(plan["error_pct"].get<double>(), 5.0);
    EXPECT_DOUBLE_EQ(plan["budget_us"].get<double>(), 1000.0);
    EXPECT_GT(plan["candidates"].size(), 10U);
    EXPECT_NE(told.out.find("chosen"), std::string::npos);
    EXPECT_NE(told.out.find("over the error"), std::string::npos);
    EXPECT_NE(told.out.find("gives up"), std::string::npos);
}

// The lines to paste are a model: the scene with them is one that trains.
TEST(Plan, ItsLinesMakeAScene)
{
    const Folder folder;
    const Outcome& told = Planned::once().told;
    const std::size_t begin = told.out.find("\n[model]\n");
    ASSERT_NE(begin, std::string::npos) << told.out << told.err;
    const std::string scene = smallScene(folder);
    writeText(scene, readText(scene) + told.out.substr(begin));
    const auto trained = figures({"train", scene, "--headless", "--unpaced", "--seconds", "0.02"});
    EXPECT_EQ(trained.at("model"), "elastic");
}

// A machine ten times as slow gets a cheaper model, or none.
TEST(Plan, TimeFollowsTheMachineAndNotTheClock)
{
    const Folder folder;
    const std::vector<std::string> asked{"plan",  smallScene(folder), "--error", "80%", "--budget",
                                         "100us", "--speed",          "50"};
    const auto here = figures(asked);
    auto slow = asked;
    const std::string law = R"({"slot_ns": 20, "slot_cycle_ns": 90, "contact_ns": 600, "contact_cycle_ns": 1500})";
    const std::string costs = folder / "costs.json";
    writeText(costs, R"({"small": )" + law + R"(, "finite": )" + law + "}");
    slow.insert(slow.end(), {"--costs", costs});
    const auto there = figures(slow);
    EXPECT_DOUBLE_EQ(here["error_pct"].get<double>(), 80.0);
    EXPECT_DOUBLE_EQ(here["budget_us"].get<double>(), 100.0);
    EXPECT_EQ(here["level"], "spring");
    EXPECT_EQ(there["costs"], costs);
    for (std::size_t i = 0; i < here["candidates"].size(); ++i) {
        const auto& named = here["candidates"][i]["law"];
        EXPECT_EQ(named.is_string() ? named == "linear" : here["candidates"][i]["level"] != "elastic",
                  here["candidates"][i]["strain"] == "small");
        for (const auto& other : there["candidates"]) {
            const auto& c = here["candidates"][i];
            const bool same = c["level"] == "elastic" && other["level"] == "elastic" && c["windows"] == other["windows"] &&
                              c["spacing_mm"] == other["spacing_mm"] && c["sweeps"] == other["sweeps"] &&
                              c["strain"] == other["strain"];
            EXPECT_TRUE(!same || other["predicted_us"] > c["predicted_us"]);
        }
    }
}

// What the benchmark measures, the planner reads; and what is no such file is refused.
TEST(BenchCosts, FeedsThePlanner)
{
    const Folder folder;
    const std::string scene = measuredScene(folder), costs = folder / "costs.json";
    const auto measured = figures({"bench", "costs", scene, "--quick"});
    for (const char* law : {"small", "finite"}) {
        // Few models differ little in their cycles, so that the fit may give all of a node's time to either.
        EXPECT_GT(measured[law]["slot_ns"].get<double>() + measured[law]["slot_cycle_ns"].get<double>(), 0.0);
        EXPECT_LT(measured[law]["fit_rms_pct"].get<double>(), 50.0);
    }
    writeText(costs, measured.dump());
    const auto plan = figures({"plan", scene, "--error", "80%", "--budget", "900us", "--speed", "50", "--costs", costs});
    EXPECT_EQ(plan["costs"], costs);
    writeText(costs, R"({"small": {"slot_ns": -1}})");
    expectRefusal({"plan", scene, "--costs", costs}, "no number at /small/slot_ns");
}

TEST(Plan, WhatNothingHoldsEndsOnOneLine)
{
    const Folder folder;
    const std::string scene = smallScene(folder);
    const Outcome outcome = palpate({"plan", scene, "--error", "0.01%", "--budget", "30us", "--speed", "50"});
    EXPECT_EQ(outcome.status, 1);
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_NE(outcome.err.find("the nearest is"), std::string::npos) << outcome.err;
    const Outcome forced =
        palpate({"plan", scene, "--error", "80%", "--force-error", "50%", "--budget", "21us", "--speed", "50"});
    EXPECT_EQ(forced.status, 1);
    EXPECT_NE(forced.err.find("%, of the force not known, in 20 us"), std::string::npos) << forced.err;
}

TEST(Plan, WrongQuantitiesAreRefused)
{
    for (const std::string error : {"0", "0%", "100%", "3", "-1%", "much", "nan", "3 percent"}) {
        expectRefusal({"plan", "block", "--error", error}, "--error: " + error);
    }
    for (const std::string budget : {"0us", "400", "2s", "-1ms", "soon", "400 ns"}) {
        expectRefusal({"plan", "block", "--budget", budget}, "--budget: " + budget);
    }
    expectRefusal({"plan"}, "SCENE");
    expectRefusal({"plan", "nosuch"}, "nosuch");
}

}  // namespace
}  // namespace palpate::apps
