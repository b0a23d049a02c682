#include <training/simulate.h>

#include <tests/folder.h>
#include <tests/training/courses.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

namespace palpate::training {
namespace {

// Counted anew from what was drawn: the number of the session that opens each gate, and that no exercise was given before
// its gate was open, nor after it opened.
void expectGatesOpenWhenTheyShould(const Curriculum& curriculum, const SimulatedCourse& course)
{
    std::size_t at = 0;
    for (const Exercise& exercise : curriculum.exercises) {
        std::vector<int> met;
        bool open = false;
        for (; at < course.sessions.size() && course.sessions[at].exercise == exercise.id; ++at) {
            ASSERT_FALSE(open) << exercise.id << " was given again after its gate opened";
            met.push_back(course.met[at] ? 1 : 0);
            int sum = 0;
            for (std::size_t k = met.size() > static_cast<std::size_t>(exercise.gate.of) ? met.size() - exercise.gate.of
                                                                                         : 0;
                 k < met.size(); ++k) {
                sum += met[k];
            }
            open = sum >= exercise.gate.pass;
        }
        if (at == course.sessions.size()) {
            EXPECT_EQ(course.finished, open && &exercise == &curriculum.exercises.back());
            return;
        }
        ASSERT_TRUE(open) << exercise.id << " was left before its gate was open";
    }
    ADD_FAILURE() << "sessions after the last exercise";
}

TEST(SimulatedCourse, GatesOpenWhenTheyShould)
{
    Curriculum curriculum = breastCourse();
    curriculum.refreshDays = 1000;  // a course of 90 sessions takes 90 days: no refreshers here, see below
    std::size_t sessions = 0, finished = 0;
    for (const LearningLaw& law : learningLaws()) {
        for (std::uint64_t seed = 1; seed <= 20; ++seed) {
            const SimulatedCourse course = simulate(curriculum, law, seed, 300);
            ASSERT_NO_FATAL_FAILURE(expectGatesOpenWhenTheyShould(curriculum, course));
            sessions += course.sessions.size();
            finished += course.finished ? 1 : 0;
        }
    }
    EXPECT_GE(sessions, 200U);
    EXPECT_EQ(finished, 60U);
}

// 200 sessions of three people, unattended, through the file of profiles: what is read again opens the same gates.
TEST(SimulatedCourse, GoesThroughTheFileOfProfiles)
{
    const Curriculum curriculum = breastCourse();
    const tests::Folder folder;
    ProfileStore store(folder / "p.db");
    std::size_t sessions = 0;
    for (const LearningLaw& law : learningLaws()) {
        const Person person = store.add(law.name, Hand::right);
        const SimulatedCourse course = simulate(curriculum, law, 3, 100);
        for (const StoredSession& s : course.sessions) {
            store.store(person, s);
        }
        sessions += course.sessions.size();
        const auto read = store.sessions(person);
        const std::string now = read.back().started;
        const auto direct = progressOf(curriculum, course.sessions, now), kept = progressOf(curriculum, read, now);
        for (std::size_t e = 0; e < curriculum.exercises.size(); ++e) {
            EXPECT_EQ(kept.exercises[e].gate.openedAt, direct.exercises[e].gate.openedAt);
            EXPECT_EQ(kept.exercises[e].met, direct.exercises[e].met);
        }
    }
    EXPECT_GE(sessions, 150U);
}

double medianSessions(const Curriculum& curriculum, const LearningLaw& law)
{
    std::vector<std::size_t> taken;
    for (std::uint64_t seed = 1; seed <= 31; ++seed) {
        taken.push_back(simulate(curriculum, law, seed, 1000).sessions.size());
    }
    std::ranges::sort(taken);
    return static_cast<double>(taken[15]);
}

TEST(SimulatedCourse, WhoIsBetterNeedsFewerSessions)
{
    const Curriculum curriculum = breastCourse();
    const auto& laws = learningLaws();
    const double novice = medianSessions(curriculum, laws[0]), resident = medianSessions(curriculum, laws[1]),
                 expert = medianSessions(curriculum, laws[2]);
    EXPECT_GT(novice, resident);
    EXPECT_GT(resident, expert);
    // Nobody can do with fewer than the gates ask for.
    int least = 0;
    for (const Exercise& e : curriculum.exercises) {
        least += e.gate.pass;
    }
    EXPECT_GE(expert, least);
}

// A law with a constant chance of failing: the charts of the sessions that the curriculum gives signal as the Markov chain
// says. One exercise, whose gate nobody reaches, so that the row is long.
TEST(SimulatedCourse, AlarmsComeAsOftenAsTheorySays)
{
    Curriculum curriculum = breastCourse();
    curriculum.exercises.resize(1);
    curriculum.exercises[0].gate.pass = 101;  // never
    curriculum.exercises[0].gate.of = 200;
    for (const double failure : {curriculum.cusum.p0, curriculum.cusum.p1}) {
        double runs = 0, length = 0;
        for (std::uint64_t seed = 1; seed <= 40; ++seed) {
            const LearningLaw law{"constant", 1 - failure, 1 - failure, 1};
            const auto course = simulate(curriculum, law, seed, 100);
            std::vector<bool> failed;
            const auto progress = progressOf(curriculum, course.sessions, course.sessions.back().started);
            for (const bool met : progress.exercises[0].met) {
                failed.push_back(!met);
            }
            // Joined to one row: sessions are independent of one another.
            const auto chart = cusum(curriculum.cusum, failed);
            runs += static_cast<double>(std::ranges::count_if(chart, &CusumPoint::proficient));
            length += static_cast<double>(chart.size());
        }
        // Rows of 100 end within a run: a signal is counted for each whole run, so the rate is a little low.
        const double expected = averageRunLength(curriculum.cusum, CusumChart::learning, failure);
        if (failure < 0.2) {
            EXPECT_NEAR(length / runs / expected, 1, 0.2) << failure;
        } else {
            EXPECT_GT(length / runs, 3 * averageRunLength(curriculum.cusum, CusumChart::learning, curriculum.cusum.p0));
        }
    }
}

TEST(Progress, WhatWasReachedAndNotPractisedIsRefreshedFirst)
{
    const Curriculum curriculum = breastCourse();
    const auto course = simulate(curriculum, learningLaws()[2], 1, 300);
    ASSERT_TRUE(course.finished);
    const auto soon = progressOf(curriculum, course.sessions, course.sessions.back().started);
    EXPECT_EQ(soon.next(), nullptr);
    const auto later = progressOf(curriculum, course.sessions, "2027-12-31T00:00:00Z");
    ASSERT_NE(later.next(), nullptr);
    EXPECT_EQ(later.next()->exercise->id, "touch") << "the longest ago";
    EXPECT_NE(reasonFor(*later.next()).find("not practised for"), std::string::npos);
}

}  // namespace
}  // namespace palpate::training
