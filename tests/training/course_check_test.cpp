#include <training/course_check.h>

#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/training/courses.h>

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>

namespace palpate::training {
namespace {

// One success opens this gate: a session that fails comes with the chances f, f^2 .. , and three failures in a row are an
// alarm (weight ln 3 = 1.0986, limit ln 18 = 2.8904): one alarm for each three, f^3 / (1 - f^3) in all.
TEST(ExpectedSignals, OfAGateThatOneSuccessOpensAreAGeometricRow)
{
    const CusumPlan plan;
    const Gate gate{{}, 1, 1, false};
    for (const double f : {0.2, 0.5, 0.8}) {
        const LearningLaw law{"constant", 1 - f, 1 - f, 1};
        const double cubed = f * f * f;
        EXPECT_NEAR(expectedSignals(plan, gate, law, CusumChart::alarm, 1000), cubed / (1 - cubed), 1e-9) << f;
    }
}

// A gate that cannot be reached in so few sessions leaves the chart alone: with a success for sure every ninth session
// signals (0.2513 each, limit 2.2513).
TEST(ExpectedSignals, OfCertainSessionsAreCounted)
{
    const CusumPlan plan;
    const Gate never{{}, 60, 60, false};
    const LearningLaw sure{"sure", 1, 1, 1};
    EXPECT_NEAR(expectedSignals(plan, never, sure, CusumChart::learning, 50), 5, 1e-12);
    EXPECT_EQ(expectedSignals(plan, never, sure, CusumChart::alarm, 50), 0);
}

TEST(CourseCheck, AGateThatLooksTooFarBackIsRefused)
{
    Curriculum course = breastCourse();
    course.exercises[1].gate.pass = 10;
    course.exercises[1].gate.of = 16;
    EXPECT_NE(tests::errorOf([&] { checkCourses(course, 1, 1, 10); }).find("looks at the last 16 sessions"),
              std::string::npos);
}

// What the command does with many people: gates open when they should, signals come as often as theory says.
TEST(CourseCheck, GatesOpenAndSignalsComeAsTheorySays)
{
    const CourseCheck check = checkCourses(breastCourse(), 40, 1, 1000);
    EXPECT_GE(check.sessions, 200U);
    EXPECT_EQ(check.finished, 120U);
    EXPECT_TRUE(check.gateFaults.empty()) << check.gateFaults.front();
    double counted = 0, expected = 0;
    for (const SignalCount& s : check.signals) {
        if (s.chart == CusumChart::alarm) {
            counted += static_cast<double>(s.counted);
            expected += s.expected;
        } else {
            // Nine successes in a row are asked for, and a gate is open after three of five.
            EXPECT_EQ(s.counted, 0U);
            EXPECT_EQ(s.expected, 0);
        }
    }
    EXPECT_GT(counted, 100);
    EXPECT_NEAR(counted / expected, 1, 0.2);
}

TEST(CourseCheck, AFileWhoseWritersAreKilledIsWhole)
{
    const tests::Folder folder;
    const KillCheck check = checkKills(breastCourse(), folder.path(), 10, 3);
    EXPECT_EQ(check.kills, 10);
    EXPECT_GE(check.sessions, 100U) << "and goes on to the end of the courses";
    EXPECT_TRUE(check.faults.empty()) << check.faults.front();
}

// What cannot be stored must end the check, not go on for ever. No file may grow beyond a size that is less than that of
// all courses (72 KiB): its log grows over it on a quick machine, the file itself on a slow one.
TEST(CourseCheck, AFileThatCannotBeWrittenEndsTheCheck)
{
    const tests::Folder folder;
    const auto check = [&] {
        std::signal(SIGXFSZ, SIG_IGN);
        const rlimit most{56 << 10, 56 << 10};
        ::setrlimit(RLIMIT_FSIZE, &most);
        try {
            checkKills(breastCourse(), folder.path(), 1000, 3);
        } catch (const std::exception& e) {
            std::fputs(e.what(), stderr);
            std::_Exit(3);
        }
        std::_Exit(0);
    };
    // Either process may be the first that cannot write.
    EXPECT_EXIT(check(), ::testing::ExitedWithCode(3), "killed.db");
}

}  // namespace
}  // namespace palpate::training
