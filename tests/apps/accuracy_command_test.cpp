#include <studies/accuracy/accuracy.h>
#include <studies/accuracy/reference_file.h>
#include <studies/kernel/kernel_rivals.h>

#include <tests/apps/program.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <sstream>

namespace palpate::apps {
namespace {

using namespace studies;
using nlohmann::json;

const char* const sceneText =
    "name = \"small\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 1\n[volume.parameters]\nwidth_mm = 30\n"
    "thickness_mm = 16\ntumours = 0\n[dffb]\nmode = \"off\"\n[target]\nstructure = \"base\"\naim_mm = [0, 16, 0]\n"
    "entry_mm = [0, 0, 0]\n[tool]\nkind = \"sphere\"\nradius_mm = 5\n";

// A folder with a scene, and with stand-ins for its references: the body on a grid of 4 mm, converged.
struct Place {
    Folder folder;
    std::string scene = folder / "small.toml";
    std::string references = folder / "references";

    explicit Place(const std::vector<std::string>& laws = {"linear", "neo-hookean"})
    {
        writeText(scene, sceneText);
        std::filesystem::create_directory(references);
        auto parsed = datasets::parseScene(std::string(sceneText) + "[model]\nlevel = \"spring\"\n", "small.toml");
        auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(parsed));
        const AccuracySubject subject =
            accuracySubject(std::make_shared<const haptics::SessionModel>(haptics::buildModel(std::move(parsed), tissue)));
        const TrialBody body = trialBody(*tissue, subject.model->surface, 4e-3, 0.49, 1U << 20);
        for (const std::string& law : laws) {
            const std::string key = referenceKey(*tissue, subject.path, subject.speed, law);
            const std::array speeds{subject.speed};
            const auto solved = solveReference(body.body, subject.path, speeds,
                                               {.law = *volume::lawNamed(law), .tolerance = 1e-3, .maxCycles = 50});
            saveReference(std::filesystem::path(references) / (law + "-" + key + ".ref"), solved,
                          {key, "small", "sphere_10mm", law, "P2", subject.speed, 1, 2, 3.0, "stand-in", {}, {}});
        }
    }
    std::vector<std::string> command(const std::string& output) const
    {
        return {"accuracy",  "--scenes",        scene,     "--references", references,
                "--methods", "nothing,elastic", "--quick", "-o",           output};
    }
};

const json& entryOf(const json& figures, const std::string& law, const std::string& method)
{
    for (const json& e : figures["chart"]) {
        if (e["law"] == law && e["method"] == method) {
            return e;
        }
    }
    throw std::runtime_error("no entry of " + method);
}

std::vector<std::string> linesOf(const std::filesystem::path& file)
{
    std::vector<std::string> lines;
    std::istringstream in(readText(file));
    for (std::string line; std::getline(in, line);) {
        lines.push_back(line);
    }
    return lines;
}

TEST(AccuracyCommand, ChartsErrorAgainstTimeAndGoesOnWhereItStopped)
{
    const Place place;
    const std::string out = place.folder / "out";
    const json first = figures(place.command(out));
    // Nothing, fast and default, against two laws.
    ASSERT_EQ(first["chart"].size(), 6U);
    EXPECT_EQ(first["cases_run"], 6);
    for (const json& e : first["chart"]) {
        for (const char* key : {"method", "setting", "scene", "law", "us_per_update", "rms_pct", "near_pct", "force_pct",
                                "volume_pct", "press", "drag", "on_front"}) {
            EXPECT_TRUE(e.contains(key)) << key;
        }
        EXPECT_EQ(e["method"] == "nothing", e["force_pct"].is_null());
        EXPECT_FALSE(e["method"] == "nothing" && e["on_front"].get<bool>());
    }
    EXPECT_GT(entryOf(first, "linear", "nothing")["near_pct"], entryOf(first, "linear", "elastic")["near_pct"]);
    ASSERT_EQ(first["floors"].size(), 1U);
    EXPECT_GT(first["floors"][0]["near_pct"], 0.0);
    EXPECT_EQ(first["references"].size(), 2U);

    const std::filesystem::path folder(out);
    EXPECT_EQ(linesOf(folder / "accuracy.csv").size(), 7U);
    EXPECT_EQ(linesOf(folder / "cases.jsonl").size(), 6U);
    EXPECT_NE(readText(folder / "accuracy.html").find("Palpate, small strain"), std::string::npos);
    for (const char* picture : {"small-linear.png", "small-neo-hookean.png"}) {
        EXPECT_TRUE(readText(folder / picture).starts_with("\x89PNG")) << picture;
    }

    const json again = figures(place.command(out));
    EXPECT_EQ(again["cases_run"], 0);
    EXPECT_EQ(again["chart"], first["chart"]);

    // A last line that was cut short is a case that was not finished; the others stand.
    auto lines = linesOf(folder / "cases.jsonl");
    std::string text;
    for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
        text += lines[i] + "\n";
    }
    writeText(folder / "cases.jsonl", text + lines.back().substr(0, lines.back().size() / 2));
    const json mended = figures(place.command(out));
    EXPECT_EQ(mended["cases_run"], 1);
    EXPECT_EQ(mended["chart"].size(), 6U);
    EXPECT_EQ(figures(place.command(out))["cases_run"], 0);

    // A method that has failed, such as one over its limit, is run again.
    lines = linesOf(folder / "cases.jsonl");
    json last = json::parse(lines.back());
    last["entry"]["failure"] = "takes 700 ms per tick: stopped after 20 s";
    writeText(folder / "cases.jsonl", readText(folder / "cases.jsonl") + last.dump() + "\n");
    EXPECT_EQ(figures(place.command(out))["cases_run"], 1);
}

// A law of finite strain has a floor of its own: what the linear law is off it.
TEST(AccuracyCommand, EachLawOfFiniteStrainHasItsFloor)
{
    const Place place({"linear", "neo-hookean", "exponential"});
    auto command = place.command(place.folder / "out");
    command[6] = "nothing";
    command.insert(command.end(), {"--law", "linear,neo-hookean,exponential"});
    const json all = figures(command);
    ASSERT_EQ(all["floors"].size(), 2U);
    EXPECT_EQ(all["floors"][0]["law"], "neo-hookean");
    EXPECT_EQ(all["floors"][1]["law"], "exponential");
    const std::string out = palpate(command).out;
    EXPECT_LT(out.find("exponential reference"), out.rfind("the linear law itself is")) << out;
    EXPECT_LT(out.find("the linear law itself is"), out.find("exponential reference")) << out;
}

// Linear tetrahedra in Python: of the program as it is documented.
TEST(AccuracyCommand, ARivalStandsInTheSameTableAndChart)
{
    const Place place;
    const std::string out = place.folder / "out";
    const std::vector<std::string> command{"accuracy",
                                           "--scenes",
                                           place.scene,
                                           "--references",
                                           place.references,
                                           "--methods",
                                           "nothing",
                                           "-o",
                                           out,
                                           "--rival-mesh-mm",
                                           "6",
                                           "--rival",
                                           "/usr/bin/python3 " PALPATE_SOURCE_DIR "/examples/rivals/linear_tets.py"};
    const json first = figures(command);
    ASSERT_EQ(first["chart"].size(), 4U);
    const json &linear = entryOf(first, "linear", "linear_tets"), &finite = entryOf(first, "neo-hookean", "linear_tets");
    EXPECT_EQ(linear["setting"], "6 mm");
    EXPECT_LT(linear["near_pct"], 0.6 * entryOf(first, "linear", "nothing")["near_pct"].get<double>());
    EXPECT_LT(linear["force_pct"], 40.0);
    EXPECT_NE(linear["near_pct"], finite["near_pct"]);
    EXPECT_GT(linear["us_per_update"], 0.0);
    EXPECT_TRUE(linear["on_front"].get<bool>());
    EXPECT_NE(linear["rival"].get<std::string>().find("linear_tets.py"), std::string::npos);
    const std::filesystem::path folder(out);
    EXPECT_NE(readText(folder / "accuracy.csv").find("\"linear_tets\",\"6 mm\""), std::string::npos);
    EXPECT_NE(readText(folder / "accuracy.html").find("linear_tets"), std::string::npos);
    EXPECT_TRUE(std::filesystem::exists(folder / "rivals" / "linear_tets" / "small-6mm" / "push.json"));
    EXPECT_EQ(figures(command)["cases_run"], 0);
}

// Somebody else's engine with somebody else's law: as near as linear tetrahedra of this size come (20 to 30 % of the
// force).
TEST(AccuracyCommand, BulletStandsBesideThem)
{
    const Place place;
    const json all = figures({"accuracy", "--scenes", place.scene, "--references", place.references, "--methods",
                              "nothing,bullet", "--quick", "--law", "neo-hookean"});
    const json& bullet = entryOf(all, "neo-hookean", "bullet");
    ASSERT_TRUE(bullet.contains("near_pct")) << bullet;
    EXPECT_EQ(bullet["setting"], "6 mm, explicit, Poisson 0.45");
    EXPECT_LT(bullet["near_pct"], 0.6 * entryOf(all, "neo-hookean", "nothing")["near_pct"].get<double>());
    EXPECT_LT(bullet["force_pct"], 50.0);
    EXPECT_GT(bullet["us_per_update"], 0.0);
}

TEST(AccuracyCommand, ARivalThatFailsIsLeftOutAndSpoilsNothing)
{
    const Place place;
    const std::filesystem::path out = place.folder / "out";
    auto command = place.command(out.string());
    command.insert(command.end(),
                   {"--law", "linear", "--rival", "broken=sh -c 'echo no licence; exit 7'", "--rival", "silent=true"});
    const Outcome outcome = palpate(command);
    EXPECT_EQ(outcome.status, 1);
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_NE(outcome.err.find("rival broken, small, 4 mm: exit status 7"), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("ends with: no licence"), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("rival silent, small, 4 mm: "), std::string::npos) << outcome.err;
    const json figures = json::parse(readText(out / "accuracy.json"));
    EXPECT_EQ(figures["chart"].size(), 5U);
    EXPECT_GT(entryOf(figures, "linear", "elastic")["near_pct"], 0.0);
    EXPECT_TRUE(entryOf(figures, "linear", "broken").contains("failure"));
    EXPECT_EQ(readText(out / "accuracy.html").find("broken"), std::string::npos);
    // What has been mended is run again, and nothing else.
    EXPECT_EQ(palpate(command).status, 1);
    const json again = json::parse(readText(out / "accuracy.json"));
    EXPECT_EQ(again["cases_run"], 2);
    EXPECT_EQ(entryOf(again, "linear", "elastic"), entryOf(figures, "linear", "elastic"));
}

// A copy of the program has no palpate-reference beside it.
TEST(AccuracyCommand, WithoutAReferenceItSaysWhatToDo)
{
    const Folder folder;
    std::filesystem::copy_file(std::filesystem::path(PALPATE_BIN_DIR) / "palpate", folder / "palpate");
    writeText(folder / "small.toml", sceneText);
    const Outcome outcome = Program(folder / "palpate", {"accuracy", "--scenes", folder / "small.toml", "--references",
                                                         folder / "none", "--quick"})
                                .wait();
    EXPECT_EQ(outcome.status, 1);
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_NE(outcome.err.find("-DPALPATE_REFERENCE=ON"), std::string::npos) << outcome.err;
}

TEST(AccuracyCommand, RefusesWhatThereIsNot)
{
    const Place place;
    expectRefusal({"accuracy", "--scenes", place.scene, "--references", place.references, "--methods", "magic"},
                  "chainmail, chainmail_fifo");
    expectRefusal({"accuracy", "--verify", "-o", "never"}, "--output");
    expectRefusal({"accuracy", "--verify", "--scenes", "block"}, "--scenes");
    expectRefusal({"accuracy", "--verify", "--depth"}, "--verify");
    expectRefusal({"accuracy", "--depth", "--volume", "v.vdb"}, "--volume");
    expectRefusal({"accuracy", "--depth", "--methods", "elastic"}, "--methods");
    expectRefusal({"accuracy", "--depth", "--law", "linear"}, "--law");
    expectRefusal({"accuracy", "--law", "hooke"}, "there are linear, neo-hookean, exponential");
    expectRefusal({"accuracy", "--scenes", place.scene, "--references", place.references, "--rival", "xpbd=true"},
                  "xpbd is a method of this command");
    expectRefusal({"accuracy", "--rival", "a=true", "--rival", "a=false"}, "there is another one called a");
    expectRefusal({"accuracy", "--rival", "a="}, "there is no command in it");
    expectRefusal({"accuracy", "--scenes", "nowhere"}, "no such scene");
    expectRefusal({"accuracy", "--scenes", place.scene + "," + place.scene, "--references", place.references},
                  "another scene called small");
    const std::filesystem::path damaged = *std::filesystem::directory_iterator(place.references);
    writeText(damaged, "no reference");
    expectRefusal({"accuracy", "--scenes", place.scene, "--references", place.references, "--quick"},
                  damaged.filename().string());
}

// The coarsest setting alone, at two places in the grid: from first touch to two radii and back.
TEST(AccuracyCommand, DepthComparesForcesOnTheWayInAndOut)
{
    const Folder folder;
    const std::string out = folder / "deep";
    const json all = figures({"accuracy", "--depth", "--quick", "--settings", "fast", "--speed", "40", "-o", out});
    ASSERT_EQ(all["summary"].size(), 1U);
    EXPECT_EQ(all["summary"][0]["pull_n"], 0.0);
    EXPECT_GT(all["summary"][0]["us_p99"], 0.0);
    std::size_t deep = 0;
    for (const json& e : all["depth"]) {
        for (const char* key : {"scene", "tool", "setting", "way", "depth_mm", "force_n", "reference_n", "error_pct",
                                "direction_deg", "place_cells", "zone", "reference_edges_mm"}) {
            EXPECT_TRUE(e.contains(key)) << key;
        }
        if (e["depth_mm"] > 4.0) {
            ++deep;
            EXPECT_LT(std::abs(e["error_pct"].get<double>()), 8.0) << e;
        }
    }
    EXPECT_EQ(deep, 2U * (6U + 1U + 5U));  // in, hold, out
    const std::filesystem::path made(out);
    EXPECT_EQ(linesOf(made / "depth.csv").size(), 1U + all["depth"].size());
    EXPECT_TRUE(std::filesystem::exists(made / "depth.html"));
    for (const char* part : {"touch", "press", "retreat"}) {
        const auto picture = made / ("depth-block-sphere-10-mm-" + std::string(part) + ".png");
        EXPECT_TRUE(readText(picture).starts_with("\x89PNG")) << picture;
    }
}

TEST(AccuracyCommand, DepthRefusesWhatThereIsNot)
{
    expectRefusal({"accuracy", "--depth", "--scenes", "breast"},
                  "has no stored forces; scenes with stored forces are block, find-lump, pair, plate");
    expectRefusal({"accuracy", "--depth", "--settings", "finest"}, "there are fast, default, fine");
}

}  // namespace
}  // namespace palpate::apps
