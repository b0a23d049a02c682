#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

namespace palpate::apps {
namespace {

// A block of fat that is small enough to be solved in no time, a ball 2 mm into it and out again, and points in it.
class PressCommand : public ::testing::Test {
protected:
    void SetUp() override
    {
        writeText(scene,
                  "[volume]\nphantom = \"block\"\n[volume.parameters]\nwidth_mm = 30\nthickness_mm = 16\ntumours = "
                  "0\n[tool]\nkind = \"sphere\"\nradius_mm = 5\n[dffb]\nmode = \"off\"\n[target]\nstructure = "
                  "\"base\"\naim_mm = [0, 16, 0]\nentry_mm = [0, 0, 0]\n");
        writeText(path, "# in and out\nseconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.1,0,-3,0\n0.2,0,-5.5,0\n");
        writeText(points, "x_mm,y_mm,z_mm\n0,0,0\n0,8,0\n");
    }

    const Folder folder;
    const std::string scene = folder / "small.toml", path = folder / "path.csv", points = folder / "at.csv";
};

TEST_F(PressCommand, FiguresHaveTheTissuesForceAndTheWayOfThePoints)
{
    const auto j = figures({"press", scene, "--path", path, "--at", points, "--setting", "fast"});
    EXPECT_EQ(j.at("setting"), "fast");
    EXPECT_EQ(j.at("tool").at("kind"), "sphere");
    EXPECT_EQ(j.at("ticks"), 201);
    EXPECT_TRUE(j.at("held_from_s").is_null());
    EXPECT_TRUE(j.at("passed_from_s").is_null());
    EXPECT_GT(j.at("tick_us").at("p99").get<double>(), 0.0);
    ASSERT_EQ(j.at("samples").size(), 201U);
    double peak = 0.0;
    for (const auto& s : j.at("samples")) {
        ASSERT_EQ(s.at("position_mm").size(), 3U);
        ASSERT_EQ(s.at("force_n").size(), 3U);
        for (const char* key : {"seconds", "contact_mm2", "energy_mj", "residual", "depth_mm", "behind_mm", "us"}) {
            EXPECT_TRUE(s.at(key).is_number()) << key;
        }
        peak = std::max(peak, -s.at("force_n").at(1).get<double>());
    }
    EXPECT_GT(peak, 0.01);
    EXPECT_NEAR(j.at("peak_force_n").get<double>(), peak, 1e-3 * peak);
    const auto& deepest = j.at("samples").at(100);
    EXPECT_NEAR(deepest.at("seconds").get<double>(), 0.1, 1e-9);
    EXPECT_NEAR(deepest.at("position_mm").at(1).get<double>(), -3.0, 1e-6);
    EXPECT_GT(deepest.at("contact_mm2").get<double>(), 1.0);
    EXPECT_GT(deepest.at("energy_mj").get<double>(), 1e-3);
    ASSERT_EQ(j.at("displacement").size(), 2U);
    EXPECT_EQ(j.at("displacement").at(1).at("at_mm"), nlohmann::json({0.0, 8.0, 0.0}));
    EXPECT_EQ(j.at("displacement").at(1).at("by_mm"), nlohmann::json({0.0, 0.0, 0.0}));
}

TEST_F(PressCommand, SaysWhatASceneHasOfItsOwnInPlaceOfASetting)
{
    EXPECT_NE(palpate({"press", scene, "--path", path, "--setting", "fast"}).out.find(", setting fast, "),
              std::string::npos);
    writeText(scene, readText(scene) + "[model.elastic]\nspacing_mm = 4\nwindow = 9\n");
    const std::string out = palpate({"press", scene, "--path", path}).out;
    EXPECT_NE(out.find(", setting of the scene, 4 mm, window 9, cycles "), std::string::npos) << out;
}

TEST_F(PressCommand, AToolSmallerThanACellIsSaidToBe)
{
    const Outcome small = palpate({"press", scene, "--path", path, "--radius-mm", "1"});
    EXPECT_EQ(small.status, 0) << small.err;
    EXPECT_NE(small.err.find("less than 1.25 cells of 2 mm: the force depends on where it lies"), std::string::npos)
        << small.err;
    EXPECT_EQ(palpate({"press", scene, "--path", path, "--radius-mm", "3"}).err, "");
}

TEST_F(PressCommand, APathThatBeginsInsideTheBodyIsSaidTo)
{
    writeText(path, "x_mm,y_mm,z_mm\n0,5,0\n0,5,0\n");
    const Outcome inside = palpate({"press", scene, "--path", path});
    EXPECT_EQ(inside.status, 0) << inside.err;
    EXPECT_NE(inside.err.find("the path begins with the tool's middle 5.0 mm inside the body"), std::string::npos)
        << inside.err;
    writeText(path, "x_mm,y_mm,z_mm\n0,-2,0\n0,-2,0\n");
    const Outcome touching = palpate({"press", scene, "--path", path});
    EXPECT_NE(touching.err.find("the path begins with the tool 3.0 mm in the body"), std::string::npos) << touching.err;
    writeText(path, "x_mm,y_mm,z_mm\n0,-5,0\n0,-4,0\n");
    EXPECT_EQ(palpate({"press", scene, "--path", path}).err, "");
}

TEST_F(PressCommand, AToolThatIsHeldBackIsSaidToBe)
{
    writeText(path, "x_mm,y_mm,z_mm\n0,0,0\n0,0,0\n");
    const Outcome outcome = palpate({"press", scene, "--path", path});
    EXPECT_NE(outcome.out.find("from 0.000 s on the tool is deeper than the model bears"), std::string::npos)
        << outcome.out;
    const auto j = figures({"press", scene, "--path", path});
    EXPECT_EQ(j.at("held_from_s"), 0.0);
    EXPECT_GT(j.at("samples").at(0).at("behind_mm").get<double>(), 1.0);
}

TEST_F(PressCommand, TheTableHasOneRowPerSampleAndAColumnPerName)
{
    const std::string csv = folder / "out.csv";
    const Outcome outcome =
        palpate({"press", scene, "--path", path, "--at", points, "--every", "30", "--converge", "--csv", csv});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("peak force "), std::string::npos) << outcome.out;
    std::istringstream in(readText(csv));
    std::string line;
    ASSERT_TRUE(std::getline(in, line));
    EXPECT_EQ(line,
              "seconds,x_mm,y_mm,z_mm,force_x_n,force_y_n,force_z_n,contact_mm2,energy_mj,residual,depth_mm,behind_mm,us,"
              "u1_x_mm,u1_y_mm,u1_z_mm,u2_x_mm,u2_y_mm,u2_z_mm");
    const auto columns = std::ranges::count(line, ',');
    std::size_t rows = 0;
    while (std::getline(in, line)) {
        ++rows;
        EXPECT_EQ(std::ranges::count(line, ','), columns) << line;
    }
    EXPECT_EQ(rows, 8U);
}

TEST_F(PressCommand, StandardOutputHasTheFiguresAndNothingElse)
{
    const Outcome j = palpate({"press", scene, "--path", path, "--every", "100", "--json", "-"});
    ASSERT_EQ(j.status, 0) << j.err;
    EXPECT_EQ(nlohmann::json::parse(j.out).at("samples").size(), 3U);
    const Outcome c = palpate({"press", scene, "--path", path, "--every", "100", "--csv", "-"});
    ASSERT_EQ(c.status, 0) << c.err;
    EXPECT_EQ(std::ranges::count(c.out, '\n'), 4);
    expectRefusal({"press", scene, "--path", path, "--csv", "-", "--json", "-"}, "standard output takes one of them");
}

TEST_F(PressCommand, AnotherToolIsTakenOnlyWithWhatTheSceneDoesNotSay)
{
    const auto tool = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"press", scene, "--path", path, "--every", "1000"});
        return figures(more).at("tool");
    };
    EXPECT_EQ(tool({"--tool", "capsule", "--length-mm", "12"}).at("length_mm"), 12.0);
    EXPECT_EQ(tool({"--radius-mm", "4"}).at("radius_mm"), 4.0);
    const std::string inside = folder / "inside.csv";
    writeText(inside, "x_mm,y_mm,z_mm\n0,8,0\n0,8.1,0\n");
    const auto needle = [&](std::vector<std::string> more) {
        more.insert(more.begin(), {"press", scene, "--path", inside, "--tool", "needle"});
        return figures(more);
    };
    EXPECT_EQ(needle({}).at("tool").at("radius_mm"), 1.05);
    EXPECT_EQ(needle({"--radius-mm", "0.6"}).at("tool").at("radius_mm"), 0.6);
    EXPECT_GT(needle({}).at("peak_force_n"), needle({"--radius-mm", "0.6"}).at("peak_force_n"));
    expectRefusal({"press", scene, "--path", path, "--tool", "capsule"}, "add --length-mm for this one");
    expectRefusal({"press", "layered", "--path", path, "--tool", "sphere"}, "add --radius-mm for this one");
    expectRefusal({"press", scene, "--path", path, "--length-mm", "3"}, "--length-mm: the tool is a sphere");
    for (const std::string radius : {"0", "-1", "1000", "nan"}) {
        expectRefusal({"press", scene, "--path", path, "--radius-mm", radius},
                      "--radius-mm " + radius + ": must be 0.1 to");
    }
}

// A volume need not be one for a biopsy: without a lesion and without a way to anything it is pressed all the same. What a
// planned line would say, the direction of a tool that has one, must then be in the file.
TEST_F(PressCommand, AVolumeWithoutALesionIsPressed)
{
    const std::string volume = folder / "block.vdb";
    ASSERT_EQ(palpate({"phantom", "block", "--set", "tumours=0", "width_mm=30", "thickness_mm=16", "-o", volume}).status,
              0);
    const std::vector<std::string> ball{"press", volume, "--path", path, "--tool", "sphere", "--radius-mm", "5"};
    const auto j = figures(ball);
    EXPECT_GT(j.at("peak_force_n").get<double>(), 0.01);
    EXPECT_EQ(j.at("peak_force_n"), figures({"press", scene, "--path", path, "--setting", "default"}).at("peak_force_n"));
    const std::vector<std::string> capsule{"press",   volume,        "--path", path,          "--tool",
                                           "capsule", "--radius-mm", "5",      "--length-mm", "10"};
    expectRefusal(capsule, path + ": the scene has no planned line: add the columns axis_x,axis_y,axis_z");
    writeText(path, "seconds,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n0,0,-5.5,0,0,1,0\n0.1,0,-3,0,0,1,0\n");
    EXPECT_GT(figures(capsule).at("peak_force_n").get<double>(), 0.01);
}

TEST_F(PressCommand, WhatIsWrongIsSaidOnOneLine)
{
    const std::string bad = folder / "bad.csv", none = folder / "none.csv";
    writeText(bad, "x_mm,y_mm,z_mm\n0,0,0\n0,0,fifteen\n");
    expectRefusal({"press", scene}, "--path");
    expectRefusal({"press", scene, "--path", none}, none + ": there is no such file: check the name; give a path");
    expectRefusal({"press", scene, "--path", bad}, bad + ":3: z_mm = 'fifteen': must be a number");
    expectRefusal({"press", "nosuch", "--path", path}, "layered, block, plate, pair");
    expectRefusal({"press", scene, "--path", path, "--model", "chainmail"}, "chainmail");
    expectRefusal({"press", scene, "--path", path, "--every", "0"}, "--every");
    expectRefusal({"press", scene, "--path", path, "--json", folder / "no" / "j.json"}, "make it first");
    expectRefusal({"press", scene, "--path", path, "--tool", "needle"}, path + ": the needle's tip is not in tissue");
    writeText(points, "x_mm,y_mm,z_mm\n0,0,0\n\n0,-9,0\n");
    expectRefusal({"press", scene, "--path", path, "--at", points}, points + ":4: the point lies 9.0");
}

}  // namespace
}  // namespace palpate::apps
