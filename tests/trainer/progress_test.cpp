#include <trainer/instructor.h>
#include <trainer/progress.h>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <string>

namespace palpate::trainer {
namespace {

using nlohmann::json;

json progressFigures()
{
    return json::parse(R"({
      "measures": [{"key": "total", "label": "Total", "unit": "of 100", "decimals": 0},
                   {"key": "passes", "label": "Passes", "unit": "", "decimals": 0}],
      "exercises": [
        {"name": "Ada", "curriculum": "c", "curriculum_title": "C", "exercise": "touch", "title": "Touch", "case": "first",
         "state": "refresh", "next": true, "test": false, "sessions": 2, "recent_met": 1, "recent_tried": 2, "pass": 3, "of": 5,
         "days_since": 91.5, "met": [false, true],
         "levels": [{"measure": "passes", "at_least": 1, "at_most": null}],
         "curves": {"total": [40, 60.5], "passes": [null, 1]},
         "cusum": {"p0": 0.1, "p1": 0.3, "alarm": [1.1, 0.8], "learning": [0, 0.25], "alarm_limit": 2.9, "learning_limit": 2.3}},
        {"name": "Ada", "exercise": "torn"}],
      "sessions": [
        {"name": "Ada", "session": 7, "started": "2026-11-22T09:14:05Z", "case": "first", "scene": "s", "mode": "test",
         "record": "r.db", "rating": 4, "note": "calm", "measures": {"total": 60.5}},
        {"name": "Ada", "session": 8, "started": "2026-11-22T10:14:05Z", "case": "first", "scene": "s", "mode": "practice",
         "record": "", "rating": 0, "note": "", "measures": {"total": 51}}]})");
}

TEST(Progress, IsReadAsTheCommandWritesIt)
{
    const Progress p = progressIn(progressFigures());
    ASSERT_EQ(p.exercises.size(), 1U) << "what is not whole is left out";
    const ExerciseEntry& e = p.exercises[0];
    EXPECT_EQ(e.standing, ExerciseEntry::Standing::refresh);
    EXPECT_NE(reasonFor(e).find("91 days"), std::string::npos);
    ASSERT_EQ(e.curves.size(), 2U);
    EXPECT_EQ(e.curves[1].label, "Total");
    EXPECT_EQ(e.curves[1].values[1], 60.5);
    EXPECT_TRUE(std::isnan(e.curves[0].values[0])) << "a session without a value";
    EXPECT_TRUE(e.curves[0].atLeast == 1.0 && !e.curves[0].atMost);
    EXPECT_EQ(levelsInWords(e), std::vector<std::string>{"Passes: at least 1"}) << "also of one without a session";
    EXPECT_EQ(e.alarm.atMost, 2.9);
    EXPECT_EQ(e.learning.values.size(), 2U);
    EXPECT_EQ(p.next(), 0U);
    ASSERT_EQ(p.sessions.size(), 2U);
    EXPECT_TRUE(p.sessions[0].test && p.sessions[0].rating == 4 && p.sessions[0].number == 7);
    EXPECT_EQ(p.best("first"), 60.5);
    EXPECT_FALSE(p.best("other"));
}

TEST(Progress, WhatIsNoAnswerIsNoProgress)
{
    for (const char* other : {"null", "[]", "{}", R"({"exercises": 3, "sessions": [1, null, {}]})"}) {
        const Progress p = progressIn(json::parse(other));
        EXPECT_TRUE(p.exercises.empty() && p.sessions.empty() && !p.next()) << other;
        EXPECT_TRUE(liveIn(json::parse(other)).empty()) << other;
        EXPECT_TRUE(comparisonIn(json::parse(other)).names.empty()) << other;
    }
    EXPECT_TRUE(liveIn(json::parse("{", nullptr, false)).empty());
}

TEST(Instructor, SessionsThatRunAreReadAsTheCommandWritesThem)
{
    const auto all = liveIn(json::parse(R"({"sessions": [
      {"session": "train-1", "who": "Ada", "scene": "breast", "process": 1, "state": "inserted", "seconds": 12.5, "age_s": 0.01,
       "inserted_mm": 20.5, "target": "tumour", "target_mm": 3, "vital": "artery", "vital_mm": null, "warning": "touching",
       "warned": "vein", "force_n": 1.5, "cores": 1, "last_core_target_pct": 45},
      {"session": "train-2", "who": "", "scene": "breast", "process": 2, "state": "paused", "seconds": 1, "age_s": 30,
       "inserted_mm": 0, "target": "tumour", "target_mm": 3, "vital": null, "vital_mm": null, "warning": "none",
       "warned": null, "force_n": 0, "cores": 0, "last_core_target_pct": null},
      {"session": "replay-3", "who": "Ada", "scene": "breast", "process": 3, "state": "outside", "seconds": 1, "age_s": 0,
       "inserted_mm": 0, "target": "tumour", "target_mm": 3, "vital": null, "vital_mm": null, "warning": "none",
       "warned": null, "force_n": 0, "cores": 0, "last_core_target_pct": null}]})"));
    ASSERT_EQ(all.size(), 2U) << "what is seen again does not run";
    EXPECT_TRUE(all[0].touching && !all[0].stuck);
    EXPECT_NE(all[0].warning.find("vein"), std::string::npos);
    EXPECT_TRUE(all[0].target == 3.0 && !all[0].vital && all[0].lastCore == 45.0);
    EXPECT_TRUE(all[1].warning.empty());
    EXPECT_FALSE(all[1].stuck) << "who pauses is not stuck";
}

// "0 (0 to 1)" with its bar in the middle: the median is a half.
TEST(Instructor, MediansBetweenCountsAreNotRounded)
{
    const auto decimals = [](double median) {
        json figures = json::parse(R"({"measures": [{"key": "passes", "label": "Passes", "unit": "", "decimals": 0}],
            "groups": [{"name": "a", "n": 2, "median": {"passes": 0}, "lower_quartile": {"passes": 0},
                        "upper_quartile": {"passes": 1}, "values": {"passes": [0, 1]}}]})");
        figures["groups"][0]["median"]["passes"] = median;
        return comparisonIn(figures).measures.at(0).decimals;
    };
    EXPECT_EQ(decimals(0.5), 1);
    EXPECT_EQ(decimals(1), 0);
}

TEST(Instructor, MeasuresThatDoNotDifferAreNotCompared)
{
    const Comparison c = comparisonIn(json::parse(R"({
      "measures": [{"key": "total", "label": "Total", "unit": "", "decimals": 0},
                   {"key": "passes", "label": "Passes", "unit": "", "decimals": 0}],
      "groups": [
        {"name": "a", "n": 2, "median": {"total": 60, "passes": 1}, "lower_quartile": {"total": 55, "passes": 1},
         "upper_quartile": {"total": null, "passes": 1}, "values": {"total": [50, null], "passes": [1, 1]}},
        {"name": "b", "n": 1, "median": {"total": 90, "passes": 1}, "lower_quartile": {"total": 90, "passes": 1},
         "upper_quartile": {"total": 90, "passes": 1}, "values": {"total": [90], "passes": [1]}}],
      "effect_size": {"total": -0.5, "passes": 0}})"));
    ASSERT_EQ(c.measures.size(), 1U);
    EXPECT_EQ(c.measures[0].label, "Total");
    EXPECT_EQ(c.same, std::vector<std::string>{"Passes 1"});
    EXPECT_EQ(c.measures[0].effect, -0.5);
    EXPECT_TRUE(std::isinf(c.measures[0].groups[0].upper)) << "more than a quarter have no value";
    EXPECT_EQ(c.measures[0].groups[0].values.size(), 1U);
    EXPECT_EQ(c.sessions[0], 2);
    constexpr double none = std::numeric_limits<double>::infinity();
    EXPECT_EQ(inWords({2, 1.5, 3, {}}, 1), "2.0 (1.5 to 3.0)");
    EXPECT_EQ(inWords({2, 1.5, none, {}}, 1), "2.0 (1.5 to -)");
    EXPECT_EQ(inWords({none, none, none, {}}, 1), "no value") << "it was \"- (- to -)\"";
}

// As the page has it: what is printed alike is the same, and so is having no value; a value that some lack is not.
TEST(Instructor, MeasuresThatAreTheSameInAllSessionsAreNamed)
{
    const auto compared = [](const std::string& first, const std::string& second) {
        const std::string group =
            R"({"name": "a", "n": 1, "median": {}, "lower_quartile": {}, "upper_quartile": {}, "values": )";
        return comparisonIn(
            json::parse(R"({"measures": [{"key": "m", "label": "Largest force", "unit": "N", "decimals": 2}],
            "groups": [)" +
                        group + R"({"m": [)" + first + "]}}, " + group + R"({"m": [)" + second + "]}}]}"));
    };
    const Comparison same = compared("1.2301", "1.2299"), without = compared("null", "null"),
                     some = compared("1.23", "null");
    EXPECT_EQ(same.same, std::vector<std::string>{"Largest force [N] 1.23"});
    EXPECT_TRUE(same.measures.empty());
    EXPECT_EQ(without.same, std::vector<std::string>{"Largest force [N] without a value"});
    EXPECT_TRUE(some.same.empty());
    EXPECT_EQ(some.measures.size(), 1U);
}

}  // namespace
}  // namespace palpate::trainer
