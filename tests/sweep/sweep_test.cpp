#include <base/inputs.h>
#include <sweep/case.h>
#include <sweep/formula.h>
#include <sweep/plan.h>

#include <datasets/scene.h>
#include <datasets/scene_text.h>
#include <sweep/folder.h>

#include <tests/error_of.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::sweep {
namespace {

// A ball on a small block with a lump: some milliseconds a case.
const std::string small =
    "scene = \"find-lump\"\n"
    "[procedure]\nkind = \"press\"\ndepth_mm = 4\nspeed_mm_s = 40\nhold_ms = 40\n"
    "[set]\ntool.kind = \"sphere\"\nvolume.voxel_mm = 2\nvolume.parameters.width_mm = 48\nvolume.parameters.thickness_mm = "
    "28\n"
    "model.setting = \"fast\"\n"
    "insert.lump.centre_mm.x = 0\ninsert.lump.centre_mm.z = 0\n";

// `set`: more lines of the table [set].
SweepPlan planOf(const std::string& more, const std::string& set = "")
{
    const auto table = small.find("[procedure]");
    return parsePlan(small.substr(0, table) + more + small.substr(table) + set, "plan.toml", namedScene);
}

std::string refusal(const std::string& text)
{
    return tests::errorOf([&] { parsePlan(text, "plan.toml", namedScene); });
}

const std::string depths = "[[axis]]\nname = \"depth_mm\"\nvalues = [4, 8]\n";

TEST(SweepPlan, AnAxisReachesWhatItNames)
{
    const SweepPlan plan = parsePlan(
        "scene = \"behind-rib\"\n"
        "[[axis]]\nkey = \"tissue.liver.youngs_kpa\"\nvalues = [7]\n"
        "[[axis]]\nkey = \"tissue.liver.poisson\"\nvalues = [0.3]\n"
        "[[axis]]\nkey = \"insert.lesion.tissue\"\nvalues = [\"dcis\"]\n"
        "[[axis]]\nkey = \"insert.lesion.diameter_mm\"\nvalues = [9]\n"
        "[[axis]]\nkey = \"insert.lesion.centre_mm.y\"\nvalues = [31]\n"
        "[[axis]]\nkey = \"volume.voxel_mm\"\nvalues = [2]\n"
        "[[axis]]\nkey = \"volume.seed\"\nvalues = [12]\n"
        "[[axis]]\nkey = \"model.level\"\nvalues = [\"chainmail\"]\n"
        "[[axis]]\nkey = \"model.setting\"\nvalues = [\"fine\"]\n"
        "[[axis]]\nkey = \"model.elastic.cycles\"\nvalues = [5]\n"
        "[[axis]]\nkey = \"safety.device\"\nvalues = [\"touch\"]\n"
        "[[axis]]\nkey = \"dffb.structure.force_n\"\nvalues = [0.5]\n"
        "[[axis]]\nkey = \"vital.rib.gain\"\nvalues = [2]\n"
        "[[axis]]\nkey = \"procedure.trainee\"\nvalues = [\"novice\"]\n"
        "[[axis]]\nkey = \"procedure.delay_ms\"\nvalues = [3]\n"
        "[[axis]]\nkey = \"procedure.seed\"\nvalues = [99]\n",
        "plan.toml", namedScene);
    ASSERT_EQ(plan.cases(), 1U);
    const SweepCase c = sweepCase(plan, 0);
    ASSERT_EQ(c.scene.tissueChanges.size(), 1U);
    EXPECT_EQ(c.scene.tissueChanges[0].tissue, "liver");
    const std::map<std::string, double> values(c.scene.tissueChanges[0].values.begin(),
                                               c.scene.tissueChanges[0].values.end());
    EXPECT_EQ(values, (std::map<std::string, double>{{"youngs_kpa", 7}, {"poisson", 0.3}}));
    const auto lesion = std::ranges::find(c.scene.source.inserts, "lesion", &datasets::Insert::name);
    EXPECT_EQ(lesion->tissue, "dcis");
    EXPECT_DOUBLE_EQ(lesion->diameter, 9e-3);
    EXPECT_DOUBLE_EQ(lesion->centre.y, 31e-3);
    EXPECT_DOUBLE_EQ(c.scene.source.phantom.voxel, 2e-3);
    EXPECT_EQ(c.scene.source.phantom.seed, 12U);
    EXPECT_EQ(c.scene.model.level, datasets::ModelLevel::chainmail);
    EXPECT_EQ(c.scene.model.elastic.spacing, datasets::elasticSetting("fine").spacing);
    EXPECT_EQ(c.scene.model.elastic.cycles, 5);
    EXPECT_EQ(c.scene.device, "touch");
    EXPECT_DOUBLE_EQ(c.scene.dffb.structure.force, 0.5);
    EXPECT_DOUBLE_EQ(c.scene.vital[0].gain, 2);
    EXPECT_EQ(c.procedure.trainee, "novice");
    EXPECT_DOUBLE_EQ(c.procedure.delay, 3e-3);
    EXPECT_EQ(c.procedure.seed, 99U);
}

// What was not measured is neither over nor under a limit.
TEST(Formula, IsMissingWhereANumberInItIs)
{
    const double none = std::numeric_limits<double>::quiet_NaN();
    for (const char* formula : {"a >= 5", "a < 5", "a < 5 ? 1 : 2", "b + 0 * a", "a > 1 || b > 0"}) {
        EXPECT_TRUE(std::isnan(evaluate(formula, {{"a", none}, {"b", 1}}))) << formula;
    }
    EXPECT_EQ(evaluate("b > 0", {{"a", none}, {"b", 1}}), 1);
    EXPECT_EQ(evaluate("a >= 5", {{"a", std::numeric_limits<double>::infinity()}}), 1);
    EXPECT_THROW(evaluate("a = 5", {{"a", 1}}), std::runtime_error);
}

// muParser takes the last of several values: 0,5 was 5.
TEST(Formula, RefusesADecimalComma)
{
    for (const char* formula : {"0,5", "a * 0,5", "1 + (a, 2)"}) {
        const std::string error = tests::errorOf([&] { evaluate(formula, {{"a", 2}}); });
        EXPECT_TRUE(error.starts_with("formula '" + std::string(formula) + "': ")) << formula << ": " << error;
    }
    EXPECT_EQ(tests::errorOf([] { evaluate("0,5", {}); }), "formula '0,5': has several values: write a decimal point");
    EXPECT_EQ(evaluate("max(1, 5) * 0.5", {}), 2.5);
}

TEST(SweepPlan, FormulasRangesAndConstraints)
{
    const SweepPlan plan = planOf(
        "constraints = [\"depth_mm + 2 * d <= 20\"]\n"
        "[[axis]]\nname = \"depth_mm\"\nrange = [4, 12]\nsteps = 5\n"
        "[[axis]]\nname = \"d\"\nlog_range = [1, 100]\nsteps = 3\n"
        "[[axis]]\nname = \"n\"\nrange = [1, 4]\nsteps = 2\nwhole = true\n");
    std::vector<std::array<double, 3>> points;
    for (std::size_t i = 0; i < plan.cases(); ++i) {
        const auto v = sweepPoint(plan, i).variables;
        points.push_back({v.at("depth_mm"), v.at("d"), v.at("n")});
    }
    // d = 1 with each of 4, 6, .. 12; d = 10 with none below 20 - 20; d = 100 with none.
    std::vector<std::array<double, 3>> expected;
    for (const double depth : {4.0, 6.0, 8.0, 10.0, 12.0}) {
        expected.push_back({depth, 1.0, 1.0});
        expected.push_back({depth, 1.0, 4.0});
    }
    EXPECT_EQ(points, expected);
}

// Each text is refused on one line that names the file and holds the hint.
void expectRefused(const std::vector<std::pair<std::string, std::string>>& wrong)
{
    for (const auto& [text, hint] : wrong) {
        const std::string error = refusal(text);
        EXPECT_NE(error.find(hint), std::string::npos) << text << "\n  gives: " << error;
        EXPECT_TRUE(error.starts_with("plan.toml")) << error;
        EXPECT_EQ(error.find('\n'), std::string::npos) << error;
    }
}

std::string axesOf(int count)
{
    std::string out;
    for (int i = 0; i < count; ++i) {
        out += "[[axis]]\nname = \"a" + std::to_string(i) + "\"\nrange = [0, 1]\n";
    }
    return out;
}

TEST(SweepPlan, RefusesWhatCannotBe)
{
    const std::string scene = "scene = \"block\"\n";
    const auto axis = [](const std::string& key, const std::string& values) {
        return "[[axis]]\nkey = \"" + key + "\"\nvalues = " + values + "\n";
    };
    const std::vector<std::pair<std::string, std::string>> wrong{
        {"[[axis]]\nname = \"a\"\nvalues = [1]\n", "scene is missing"},
        {scene, "[[axis]] is missing"},
        {scene + axis("dffb.gian", "[1]"), "did you mean gain?"},
        {scene + axis("dffb.gain", "[0, 7]"), "must be 0 to 1"},
        {scene + axis("tissue.fat.youngs_kpa", "[\"a\"]"), "expected a number"},
        {scene + axis("tissue.fatt.youngs_kpa", "[3]"), "it has: skin, fat"},
        {scene + axis("insert.nose.diameter_mm", "[1]"), "the scene has no [[insert]]"},
        {scene + axis("script.2.too_mm", "[1]"), "did you mean to_mm?"},
        {scene + "nmae = \"a\"\n" + axis("dffb.gain", "[1]"), "did you mean name?"},
        {scene + axis("dffb.gain", "[]"), "expected a list"},
        {scene + axis("dffb.gain", "[1, 0, 1]"), "1 is there twice"},
        {scene + "[[axis]]\nkey = \"dffb.gain\"\nrange = [0, 1]\n", "steps is missing"},
        {scene + "[[axis]]\nkey = \"dffb.gain\"\nrange = [1, 0]\nsteps = 3\n", "the lower one first"},
        {scene + "[[axis]]\nkey = \"dffb.gain\"\nlog_range = [0, 1]\nsteps = 3\n", "above 0"},
        {scene + "[design]\nsamples = 3\n" + axis("dffb.gain", "[1]"), "a grid has none"},
        {scene + "[design]\nkind = \"sobol\"\n" + axis("dffb.gain", "[1]"), "samples is missing"},
        {scene + axis("dffb.gain", "[1]") + axis("dffb.gain", "[1]"), "is a column already"},
        {scene + "outputs = [\"hapiness\"]\n" + axis("dffb.gain", "[1]"), "there is no hapiness"},
        {scene + "outputs = [\"a = totall / 2\"]\n" + axis("dffb.gain", "[1]"), "there is no totall; did you mean total?"},
        {scene + "constraints = [\"dffb_gain > \"]\n" + axis("dffb.gain", "[1]"), "formula"},
        {scene + "constraints = [\"dffb_gain > 2\"]\n" + axis("dffb.gain", "[1]"), "no point is left"},
        {scene + "constraints = [\"point < 3\"]\n" + axis("dffb.gain", "[1]"), "point"},
        {scene + "constraints = [\"seed > 0\"]\n" + axis("dffb.gain", "[1]"), "seed"},
        {scene + "constraints = [\"dffb_gain > 2\"]\n[design]\nkind = \"morris\"\nsamples = 2\n" + axis("dffb.gain", "[1]"),
         "whole or none"},
        {"scene = \"moon\"\n" + axis("dffb.gain", "[1]"), "built-in scenes are"},
        {scene + axis("dffb.gain", "[1]") + "[[axis]]\nname = \"g\"\nkey = \"dffb.gain\"\nvalues = [1]\n",
         "key 'dffb.gain' is set twice"},
        {scene + axis("dffb.gain", "[1]") + "[set]\ndffb.gain = 0.5\n", "key 'dffb.gain' is set twice"},
        {scene + axis("dffb.range_mm", "[9]") + "[set]\ndffb.gain = 0.5\n\"dffb.gain\" = 1\n",
         "key 'dffb.gain' is set twice"},
        {scene + axis("procedure.seconds", "[9]") + "[procedure]\nseconds = 5\n", "key 'procedure.seconds' is set twice"},
        {scene + "outputs = [\"Gain = 1\"]\n[[axis]]\nname = \"gain\"\nkey = \"dffb.gain\"\nvalues = [1]\n",
         "'Gain' is a column already"},
        {scene + "[[axis]]\nname = \"Seed\"\nvalues = [1]\n", "'Seed' is a column already"},
        {scene + "constraints = [\"0 / (1 - dffb_gain)\"]\n" + axis("dffb.gain", "[0, 1]"),
         "gives no finite number at dffb_gain = 1"},
        {scene + axis("procedure.delay_ms", "[1]") + "[procedure]\nkind = \"press\"\n",
         "a procedure of kind press has the keys depth_mm"},
        {scene + axis("procedure.aside_mm", "[1]") + "[procedure]\nkind = \"needle\"\n",
         "a procedure of kind needle has the keys depth_mm"},
        {scene + axis("dffb.gain", "[1]") + "[procedure]\ntrainee = \"novice\"\nkind = \"press\"\n",
         "a procedure of kind press has the keys depth_mm"},
        {scene + axis("procedure.depth_mm", "[1]"), "a procedure of kind session has the keys trainee"},
        {scene + axis("dffb.gain", "[1]") + "[procedure]\nseconds = \"= 0,5\"\n", "write a decimal point"},
        {scene + "[[axis]]\nname = \"x\"\nvalues = [1, \"two\", 3]\n", "only numbers or only words"},
        {scene + "[[axis]]\nname = \"x\"\nvalues = [true, 2.5]\n", "only numbers or only words"},
        {scene + "[[axis]]\nname = \"w\"\nvalues = [\"a-b\", \"a b\"]\n",
         "the word 'a-b' of axis 'w' and the word 'a b' of axis 'w' alike, 'w_a_b'"},
        {scene + "[[axis]]\nname = \"a\"\nvalues = [\"b\"]\n[[axis]]\nname = \"a_b\"\nvalues = [5]\n",
         "axis 'a_b' and the word 'b' of axis 'a' alike"},
        {scene + "outputs = [\"work_mj\"]\n[procedure]\nkind = \"press\"\n[[axis]]\nname = \"force_n\"\nvalues = [1]\n",
         "an output of the procedure and axis 'force_n' alike"},
        {scene + "outputs = [\"work_mj\"]\n[procedure]\nkind = \"press\"\n[[axis]]\nname = \"force_n_change_pct\"\n"
                 "values = [1]\n[reference]\ndffb.gain = 0\n",
         "an output of the procedure and axis 'force_n_change_pct' alike"},
    };
    expectRefused(wrong);
}

TEST(SweepPlan, RefusesDesignsThatCannotBe)
{
    const std::string scene = "scene = \"block\"\n", range = "[[axis]]\nkey = \"dffb.gain\"\nrange = [0, 1]\n";
    expectRefused({
        {scene + "outputs = [\"q =\"]\n" + range + "steps = 2\n",
         "plan.toml:2: outputs = [\"q =\"]: 'q =': there is no formula after the ="},
        {scene + "[design]\nkind = \"sobol\"\nsamples = 4\n" + range + "steps = 3\n", "steps = 3: only a grid has them"},
        {scene + range + "whole = true\nsteps = 3\n", "two of them would be the whole number 1: take fewer"},
        {scene + "[[axis]]\nname = \"n\"\nlog_range = [1, 10]\nwhole = true\nsteps = 8\n",
         "the whole number 1: take fewer"},
        {scene + "[[axis]]\nname = \"n\"\nrange = [2.1, 2.9]\nwhole = true\nsteps = 2\n", "there is no whole number in it"},
        {scene + "repeats = 4\n[design]\nkind = \"saltelli\"\nsamples = 1000000\n" + range,
         "plan.toml:2: repeats = 4: 12000000 cases: 10000000 at most"},
        {scene + "repeats = 11\n[design]\nkind = \"sobol\"\nsamples = 1000000\n" + range, "11000000 cases"},
        {scene + "[design]\nkind = \"saltelli\"\nsamples = 1000000\n" + axesOf(9), "design of 11000000 points: 10000000"},
        {scene + "[design]\nkind = \"morris\"\nsamples = 1000000\n" + axesOf(10), "a design of 11000000 points"},
        {scene + "[design]\nkind = \"sobol\"\nsamples = 2\n" + axesOf(3668), "3668 axes: 3667 at most for this design"},
        {scene + "[design]\nkind = \"saltelli\"\nsamples = 2\n" + axesOf(1834), "1834 axes: 1833 at most"},
    });
}

// What formulas cannot mix up is let through: a word that comes twice, and what only another procedure measures.
TEST(SweepPlan, NamesThatDifferAreNotRefused)
{
    EXPECT_EQ(refusal("scene = \"block\"\n[design]\nkind = \"list\"\n[[axis]]\nname = \"w\"\nvalues = [\"a\", \"b\", "
                      "\"a\"]\n[[axis]]\nname = \"force_n\"\nvalues = [1, 2.5, 3]\n"),
              "");
}

// 61 x 61 cases, of which 60 are tried evenly, every 63rd: none of them has the one wrong value.
TEST(SweepPlan, TriesEachValueOfAListOnce)
{
    std::string gains = "0", masses = "0.1";
    for (int i = 1; i < 61; ++i) {
        const std::string other = ", " + std::to_string(0.1 + 0.001 * i);
        gains += i == 7 ? ", 7" : other;
        masses += other;
    }
    const std::string mass = "scene = \"block\"\n[[axis]]\nname = \"m\"\nvalues = [" + masses + "]\n";
    const std::string error = refusal(mass + "[[axis]]\nkey = \"dffb.gain\"\nvalues = [" + gains + "]\n");
    EXPECT_NE(error.find("case 7: "), std::string::npos) << error;
    EXPECT_NE(error.find("must be 0 to 1"), std::string::npos) << error;
    EXPECT_NE(refusal(mass + "[[axis]]\nkey = \"tissue.fatt.youngs_kpa\"\nvalues = [3]\n").find("it has: skin, fat"),
              std::string::npos);
}

// A volume has a table of its own; the reference cases change it too.
TEST(SweepPlan, TriesTissuesOfVolumesAndReferences)
{
    const tests::Folder home;
    datasets::Scene small = *datasets::builtInScene("block");
    small.source.phantom.voxel = 4e-3;
    const volume::Tissue tissue = datasets::sceneVolume(small);
    tissue.save(home / "b.vdb");
    const std::string scene = "scene = \"" + (home / "b.vdb").string() + "\"\n";
    const std::string axis = "[[axis]]\nkey = \"tissue.fatt.youngs_kpa\"\nvalues = [3]\n";
    EXPECT_NE(refusal(scene + axis).find("case 0: [tissue.fatt]: is not in the volume's tissue table"), std::string::npos)
        << refusal(scene + axis);
    const std::string fat = "[[axis]]\nkey = \"tissue.fat.youngs_kpa\"\nvalues = [3]\n";
    EXPECT_EQ(refusal(scene + fat), "");
    for (const std::string& body : {scene, std::string("scene = \"block\"\n")}) {
        const std::string error = refusal(body + fat + "[reference]\ntissue.fatt.youngs_kpa = 3\n");
        EXPECT_NE(error.find("case 0: [tissue.fatt]: is not in the volume's tissue table"), std::string::npos) << error;
    }
}

// Each whole number of the range, and no other, has an equal part of the samples: of 60 strata 20. Rounding gave the ends
// half of the others' share, and 6 for 5.6. A grid has both ends and rounds between them.
TEST(SweepPlan, WholeNumbersAreSampledAlikeAndInTheRange)
{
    const std::string axis = "[[axis]]\nname = \"k\"\nwhole = true\n";
    const std::string samples = "[design]\nkind = \"latin_hypercube\"\nsamples = 60\n";
    const auto counts = [](const SweepPlan& plan) {
        std::map<double, int> out;
        for (std::size_t i = 0; i < plan.cases(); ++i) {
            ++out[sweepPoint(plan, i).variables.at("k")];
        }
        return out;
    };
    EXPECT_EQ(counts(planOf(samples + axis + "range = [-1, 1]\n")), (std::map<double, int>{{-1, 20}, {0, 20}, {1, 20}}));
    EXPECT_EQ(counts(planOf(samples + axis + "range = [2.6, 5.6]\n")), (std::map<double, int>{{3, 20}, {4, 20}, {5, 20}}));
    EXPECT_EQ(counts(planOf(samples + axis + "log_range = [2.6, 4.6]\n")).size(), 2U) << "3 and 4";
    EXPECT_EQ(counts(planOf(samples + axis + "range = [2.6, 3.4]\n")), (std::map<double, int>{{3, 60}}));
    EXPECT_EQ(counts(planOf(axis + "range = [2.6, 5.6]\nsteps = 3\n")), (std::map<double, int>{{3, 1}, {4, 1}, {5, 1}}));
    EXPECT_EQ(counts(planOf(axis + "range = [1, 4]\nsteps = 3\n")), (std::map<double, int>{{1, 1}, {3, 1}, {4, 1}}));
}

TEST(SweepPlan, ReadyPlansAreWhole)
{
    for (const std::string& name : builtInPlans()) {
        const std::string text(builtInPlan(name));
        ASSERT_FALSE(text.empty()) << name;
        const SweepPlan plan = parsePlan(text, name + ".toml", namedScene);
        EXPECT_GE(plan.cases(), 10U) << name;
        EXPECT_FALSE(plan.about.empty());
    }
}

TEST(SweepCase, SeedsAreOwnOrCommonToTheRepeats)
{
    const SweepPlan own = planOf("repeats = 3\n" + depths), common = planOf("repeats = 3\ncommon_seeds = true\n" + depths);
    std::vector<std::uint64_t> seeds;
    for (std::size_t i = 0; i < own.cases(); ++i) {
        seeds.push_back(sweepPoint(own, i).seed);
    }
    std::ranges::sort(seeds);
    EXPECT_EQ(std::ranges::adjacent_find(seeds), seeds.end());
    EXPECT_EQ(sweepPoint(common, 1).seed, sweepPoint(common, 4).seed);
    EXPECT_NE(sweepPoint(common, 1).seed, sweepPoint(common, 2).seed);
}

TEST(TissueChanges, AreInTheSceneAndInItsTextAndRefuseWhatCannotBe)
{
    const std::string scene = "[volume]\nphantom = \"layered\"\n[target]\nstructure = \"tumour\"\n";
    const auto parsed =
        datasets::parseScene(scene + "[tissue.fat]\nyoungs_kpa = 20\n[tissue.skin]\npuncture_n = 5\n", "a.toml");
    const auto again = datasets::parseScene(datasets::sceneText(parsed), "a.toml");
    const auto volume = datasets::sceneVolume(again);
    EXPECT_DOUBLE_EQ(volume.table().rows[*volume.table().find("fat")].youngsModulus, 20e3);
    EXPECT_DOUBLE_EQ(volume.table().rows[*volume.table().find("skin")].punctureForce, 5);
    const auto refused = [&](const std::string& more) {
        try {
            datasets::sceneVolume(datasets::parseScene(scene + more, "a.toml"));
            return std::string();
        } catch (const std::runtime_error& e) {
            return std::string(e.what());
        }
    };
    EXPECT_NE(refused("[tissue.fatt]\nyoungs_kpa = 20\n").find("it has: skin, fat"), std::string::npos);
    EXPECT_NE(refused("[tissue.fat]\nyoung_kpa = 20\n").find("did you mean youngs_kpa?"), std::string::npos);
    EXPECT_NE(refused("[tissue.fat]\nyoungs_kpa = 0\n").find("must be 0.01 to 2e+07 kPa"), std::string::npos);
    EXPECT_NE(refused("[tissue.fat]\npuncture_n = 0\n").find("cutting_n"), std::string::npos);
    // The file and the line, as in other errors of a scene: of the value, or of the section where that does not say it.
    EXPECT_TRUE(refused("[tissue.fat]\nyoungs_kpa = 0\n").starts_with("a.toml:6: [tissue.fat] youngs_kpa = 0 kPa: must"));
    EXPECT_TRUE(refused("[tissue.fat]\npuncture_n = 0\n").starts_with("a.toml:5: [tissue.fat] cutting_n: must"));
    EXPECT_TRUE(refused("[tissue.fatt]\nyoungs_kpa = 20\n").starts_with("a.toml:5: [tissue.fatt]: is not in"));
}

std::vector<std::uint64_t> bitsOf(const CaseRow& row)
{
    std::vector<std::uint64_t> out;
    std::ranges::transform(row.outputs, std::back_inserter(out), [](double v) { return std::bit_cast<std::uint64_t>(v); });
    return out;
}

// A case follows from the plan and its number: in any order, beside any others, its row has the same bits.
TEST(CaseRunner, RowsDoNotDependOnTheOrder)
{
    const SweepPlan plan = planOf(
        "outputs = [\"force_n\", \"work_mj\", \"force_n_change_pct\", \"twice = 2 * force_n\"]\n"
        "reference.insert.lump.tissue = \"fat\"\n"
        "[[axis]]\nkey = \"tissue.idc_high_grade.youngs_kpa\"\nvalues = [10, 40]\n"
        "[[axis]]\nkey = \"insert.lump.centre_mm.y\"\nvalues = [11, 15]\n");
    CaseRunner forward(plan, "test"), backward(plan, "test");
    std::vector<std::vector<std::uint64_t>> rows(plan.cases());
    for (std::size_t i = 0; i < plan.cases(); ++i) {
        const CaseRow row = forward.run(i);
        rows[i] = bitsOf(row);
        EXPECT_GT(row.outputs[0], 0.01);
        EXPECT_DOUBLE_EQ(row.outputs[3], 2 * row.outputs[0]);
    }
    for (std::size_t i = plan.cases(); i-- > 0;) {
        EXPECT_EQ(bitsOf(backward.run(i)), rows[i]);
    }
    EXPECT_EQ(bitsOf(CaseRunner(plan, "test").run(2)), rows[2]);
    EXPECT_NE(rows[0], rows[1]);
}

double contrastAt(const SweepPlan& plan, CaseRunner& runner, double youngs, double diameter, double depth)
{
    for (std::size_t i = 0; i < plan.cases(); ++i) {
        const auto v = sweepPoint(plan, i).variables;
        if (v.at("youngs_kpa") == youngs && v.at("d") == diameter && v.at("depth_mm") == depth) {
            return runner.run(i).outputs[0];
        }
    }
    throw std::logic_error("no such case");
}

// What is felt of a lump: more of a stiffer, a larger and a nearer one; nothing of one that is fat.
TEST(CaseRunner, ForceContrastFallsWithDepthAndRisesWithSizeAndStiffness)
{
    const SweepPlan plan = planOf(
        "outputs = [\"force_n_change_pct\"]\n"
        "reference.insert.lump.tissue = \"fat\"\nreference.insert.lump.diameter_mm = 8\nreference.insert.lump.centre_mm.y "
        "= 14\n"
        "reference.tissue.idc_high_grade.youngs_kpa = 10\n"
        "[[axis]]\nname = \"youngs_kpa\"\nkey = \"tissue.idc_high_grade.youngs_kpa\"\nvalues = [3.25, 10, 20, 80]\n"
        "[[axis]]\nname = \"d\"\nkey = \"insert.lump.diameter_mm\"\nvalues = [6, 10, 14]\n"
        "[[axis]]\nname = \"depth_mm\"\nvalues = [3, 6, 10]\n",
        "insert.lump.centre_mm.y = \"= depth_mm + d / 2\"\ntissue.idc_high_grade.stiffening = 0\n");
    CaseRunner runner(plan, "test");
    const auto contrast = [&](double e, double d, double depth) { return contrastAt(plan, runner, e, d, depth); };
    const double middle = contrast(20, 10, 6);
    EXPECT_LT(contrast(10, 10, 6), middle);
    EXPECT_LT(middle, contrast(80, 10, 6));
    EXPECT_LT(contrast(20, 6, 6), middle);
    EXPECT_LT(middle, contrast(20, 14, 6));
    EXPECT_GT(contrast(20, 10, 3), middle);
    EXPECT_GT(middle, contrast(20, 10, 10));
    EXPECT_GT(contrast(10, 6, 10), 0.0);
    EXPECT_NEAR(contrast(3.25, 10, 6), 0.0, 0.05);
}

// F = K d: 1 N/mm, 10 mm deep. The hand gets at most the device's 8.5 N, and after a fast press less for some ticks.
TEST(CaseRunner, TheForceOfAPressIsThatOfTheTissueAndNotWhatTheHandGets)
{
    const SweepPlan plan = parsePlan(
        "scene = \"block\"\noutputs = [\"force_n\", \"stiffness_n_m\", \"peak_force_n\"]\n"
        "[[axis]]\nkey = \"procedure.hold_ms\"\nvalues = [1, 60]\n"
        "[procedure]\nkind = \"press\"\ndepth_mm = 10\nspeed_mm_s = 2000\n"
        "[set]\nvolume.voxel_mm = 4\nmodel.level = \"spring\"\nmodel.stiffness_n_m = 1000\n",
        "plan.toml", namedScene);
    CaseRunner runner(plan, "test");
    for (const std::size_t hold : {0U, 1U}) {
        const CaseRow row = runner.run(hold);
        EXPECT_NEAR(row.outputs[0], 10, 0.01) << hold;
        EXPECT_NEAR(row.outputs[1], 1000, 1) << hold;
        EXPECT_LT(row.outputs[2], 9) << hold;
    }
}

// K d^2 / 2: 50 N/m, 10 mm deep. The speed is no part of it.
TEST(CaseRunner, TheWorkOfAPressOnASpringIsItsEnergyAtAnySpeed)
{
    const SweepPlan plan = parsePlan(
        "scene = \"block\"\noutputs = [\"work_mj\"]\n"
        "[[axis]]\nkey = \"procedure.speed_mm_s\"\nvalues = [10, 100, 300]\n"
        "[procedure]\nkind = \"press\"\ndepth_mm = 10\nhold_ms = 60\n"
        "[set]\nvolume.voxel_mm = 4\nmodel.level = \"spring\"\nmodel.stiffness_n_m = 50\n",
        "plan.toml", namedScene);
    CaseRunner runner(plan, "test");
    for (const std::size_t i : {0U, 1U, 2U}) {
        EXPECT_NEAR(runner.run(i).outputs[0], 2.5, 0.02) << i;
    }
}

// A late force is felt late: the same hand, another session.
TEST(CaseRunner, DelayChangesASession)
{
    const SweepPlan plan = parsePlan(
        "scene = \"block\"\noutputs = [\"path_mm\", \"tissue_work_mj\", \"finished\"]\n"
        "[[axis]]\nkey = \"procedure.delay_ms\"\nvalues = [0, 8]\n"
        "[procedure]\nkind = \"session\"\nseconds = 20\n"
        "[set]\nvolume.voxel_mm = 4\nvolume.parameters.width_mm = 40\nmodel.level = \"chainmail\"\nmodel.spacing_mm = 4\n",
        "plan.toml", namedScene);
    CaseRunner runner(plan, "test");
    const auto prompt = runner.run(0), late = runner.run(1);
    EXPECT_EQ(prompt.outputs[2], 1.0);
    EXPECT_NE(bitsOf(prompt), bitsOf(late));
}

// A case's file is what was written, or the case has no row and its file and key are named.
TEST(SweepFolder, ADamagedCaseIsNamedWithItsKeyAndHasNoRow)
{
    const tests::Folder home;
    const std::string plan = home / "plan.toml";
    const auto table = small.find("[procedure]");
    std::ofstream(plan) << small.substr(0, table) + depths + small.substr(table);
    SweepFolder folder(home / "sweep", plan, true);
    SweepRow row;
    row.build = "one";
    row.machine = "here";
    row.seconds = 0.1 + 0.2;  // a number whose digits do not end
    row.outputs.assign(folder.plan().outputs.size(), 1.0 / 3.0);
    folder.write(row);
    const auto file = home / "sweep/cases/000/0.json";
    const std::string whole = base::contentOf(file).value();
    std::vector<std::string> damaged;
    EXPECT_TRUE(folder.rows(&damaged).at(0));
    EXPECT_TRUE(damaged.empty());
    const std::vector<std::pair<std::string, std::string>> edits{{"\"tick_us\":0.0", "\"tick_us\":\"0\""},
                                                                 {"\"build\":\"one\"", "\"build\":1"},
                                                                 {"\"error\":\"\"", "\"error\":null"},
                                                                 {"\"case\":0", "\"case\":-3"},
                                                                 {"\"machine\":\"here\"", "\"machine\":\"there\""},
                                                                 {"0.3333", "0.4333"},
                                                                 {"\"checksum\"", "\"sum\""}};
    const std::vector<std::string> named{"tick_us", "build", "error", "case", "checksum", "checksum", "checksum"};
    for (std::size_t i = 0; i < edits.size(); ++i) {
        std::string text = whole;
        const auto at = text.find(edits[i].first);
        ASSERT_NE(at, std::string::npos) << edits[i].first << " in " << text;
        text.replace(at, edits[i].first.size(), edits[i].second);
        std::ofstream(file) << text;
        damaged.clear();
        EXPECT_FALSE(folder.rows(&damaged).at(0)) << edits[i].second;
        ASSERT_EQ(damaged.size(), 1U) << edits[i].second;
        EXPECT_NE(damaged[0].find("cases/000/0.json: key " + named[i]), std::string::npos) << damaged[0];
    }
}

}  // namespace
}  // namespace palpate::sweep
