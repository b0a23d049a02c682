#include <sweep/case.h>
#include <sweep/plan.h>
#include <sweep/table.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <vector>

namespace palpate::sweep {
namespace {

using Names = std::vector<std::string>;

const std::string listed = "outputs = [\"force_n\", \"twice = 2 * force_n\", \"work_mj\"]\n";
const std::string reference = "[reference]\nmodel.stiffness_n_m = 500\n";

SweepPlan planWith(const std::string& outputs, const std::string& more)
{
    return parsePlan("scene = \"block\"\n" + outputs +
                         "[[axis]]\nname = \"n\"\nvalues = [1]\n[procedure]\nkind = \"press\"\ndepth_mm = 2\nhold_ms = 60\n"
                         "[set]\nvolume.voxel_mm = 4\nmodel.level = \"spring\"\nmodel.stiffness_n_m = 1000\n" +
                         more,
                     "plan.toml", namedScene);
}

Names namesOf(const std::string& outputs, const std::string& more)
{
    Names names;
    std::ranges::transform(planWith(outputs, more).outputs, std::back_inserter(names), &SweepOutput::name);
    return names;
}

// A formula has none, and one of the two may be alone.
TEST(ReferenceColumns, AreThereOnceForEachMeasuredOutput)
{
    EXPECT_EQ(namesOf(listed, ""), (Names{"force_n", "twice", "work_mj"}));
    EXPECT_EQ(namesOf(listed, reference), (Names{"force_n", "twice", "work_mj", "reference_force_n", "force_n_change_pct",
                                                 "reference_work_mj", "work_mj_change_pct"}));
    EXPECT_EQ(namesOf("outputs = [\"force_n_change_pct\", \"force_n\"]\n", reference),
              (Names{"force_n_change_pct", "force_n", "reference_force_n"}));
    EXPECT_EQ(namesOf("outputs = [\"reference_force_n\"]\n", reference), Names{"reference_force_n"});
    EXPECT_EQ(namesOf("outputs = [\"reference_force_n = 1\", \"force_n\"]\n", reference),
              (Names{"reference_force_n", "force_n", "force_n_change_pct"}));
    EXPECT_EQ(namesOf("", reference).size(), 3 * namesOf("", "").size());
}

// F = K d, with K twice that of the reference.
TEST(ReferenceColumns, HoldTheReferenceAndByHowMuchItIsExceeded)
{
    const SweepPlan plan = planWith(listed, reference);
    const CaseRow row = CaseRunner(plan, "test").run(0);
    ASSERT_EQ(row.outputs.size(), 7U);
    EXPECT_NEAR(row.outputs[3], row.outputs[0] / 2, 1e-3);
    EXPECT_NEAR(row.outputs[4], 100, 0.1);
    for (const auto& column : tableOf(plan, {}).columns) {
        EXPECT_NE(column.meaning, "") << column.name;
    }
}

}  // namespace
}  // namespace palpate::sweep
