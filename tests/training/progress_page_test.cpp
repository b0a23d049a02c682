#include <base/inputs.h>
#include <training/progress_page.h>
#include <training/simulate.h>

#include <tests/folder.h>
#include <tests/training/courses.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

namespace palpate::training {
namespace {

struct Somebody {
    Curriculum curriculum;
    std::vector<PersonProgress> people;

    explicit Somebody(const std::string& name, Curriculum course = breastCourse()) : curriculum(std::move(course))
    {
        PersonProgress p;
        p.person.name = name;
        p.person.created = "2026-01-01T00:00:00Z";
        p.sessions = simulate(curriculum, learningLaws()[0], 5, 40).sessions;
        p.curricula.push_back(progressOf(curriculum, p.sessions, p.sessions.back().started));
        people.push_back(std::move(p));
    }
};

TEST(ProgressPage, SaysWhatIsNextAndWhatTheChartAssumes)
{
    const tests::Folder folder;
    const Somebody somebody("<b>Eve</b>");
    writeProgressPage(folder / "p.html", somebody.people, {});
    const std::string page = base::contentOf(folder / "p.html").value();
    EXPECT_NE(page.find("&lt;b&gt;Eve&lt;/b&gt;"), std::string::npos);
    EXPECT_EQ(page.find("<b>Eve</b>"), std::string::npos);
    EXPECT_NE(page.find("p0 = 0.1, p1 = 0.3, alpha = 0.05, beta = 0.1"), std::string::npos);
    const auto* const next = somebody.people[0].curricula[0].next();
    ASSERT_NE(next, nullptr);
    EXPECT_NE(page.find("Next: " + next->exercise->title), std::string::npos);
    // Every chart has its place, and every place its chart.
    std::set<std::string> places;
    const std::regex place("class=\"chart small\" id=\"(chart[0-9]+)\"");
    for (std::sregex_iterator at(page.begin(), page.end(), place); at != std::sregex_iterator(); ++at) {
        EXPECT_TRUE(places.insert((*at)[1]).second);
        EXPECT_NE(page.find("\"" + (*at)[1].str() + "\":{"), std::string::npos);
    }
    EXPECT_GE(places.size(), 4U);
}

// The name stands for the file that comes along; of another file it would be none, or the wrong one.
TEST(ProgressPage, NamesTheNextExerciseAsAShellTakesIt)
{
    const tests::Folder folder;
    Curriculum known = breastCourse();
    known.cusum.alpha = known.cusum.beta = 0.4;  // short charts, whose run lengths take no time
    known.exercises.resize(1);
    known.exercises[0].id = "touch it";
    known.exercises[0].gate.pass = known.exercises[0].gate.of = 100;
    Curriculum own = known, other = known;
    own.id = "my own";
    own.file = other.file = folder / "my own.toml";
    std::filesystem::copy_file(known.file, own.file);
    const Somebody one("Eve", known), two("Eve", own), three("Eve", other);
    writeProgressPage(folder / "p.html", {one.people[0], two.people[0], three.people[0]}, {});
    const std::string page = base::contentOf(folder / "p.html").value(), file = own.file.string();
    const std::regex command("--exercise &#39;(.*?)&#39;</pre>");
    std::vector<std::string> named;
    for (std::sregex_iterator at(page.begin(), page.end(), command); at != std::sregex_iterator(); ++at) {
        named.push_back((*at)[1]);
    }
    EXPECT_EQ(named, (std::vector<std::string>{"breast-core-biopsy/touch it", file + "/touch it", file + "/touch it"}));
}

// Of a measure without a unit as well: "at most" alone says nothing.
TEST(ProgressPage, LimitsHaveTheirValueAndUnit)
{
    const tests::Folder folder;
    Somebody somebody("Eve");
    CurriculumProgress& course = somebody.people[0].curricula[0];
    ExerciseProgress& first = course.exercises[0];
    Exercise exercise = *first.exercise;
    exercise.gate.levels = {{"vital_contacts", {}, 0.0}, {"best_target_pct", 33.5, {}}, {"ct_dose_mgy_cm", {}, 120.0}};
    first.exercise = &exercise;
    ASSERT_FALSE(first.sessions.empty());
    for (StoredSession& session : first.sessions) {
        session.values["best_target_pct"] = 40;
        session.values.erase("ct_dose_mgy_cm");
    }
    writeProgressPage(folder / "p.html", somebody.people, {});
    const std::string page = base::contentOf(folder / "p.html").value();
    EXPECT_NE(page.find("\"words\":\"at most 0\""), std::string::npos);
    EXPECT_NE(page.find("\"words\":\"at least 33.5 %\""), std::string::npos);
    EXPECT_NE(page.find("Dose of the CT scans</h3><p class=\"note\">-: no session had a CT scanner; level: at most 120.0 "
                        "mGy cm</p>"),
              std::string::npos);
}

TEST(ProgressCsv, HasALineForEachSession)
{
    const tests::Folder folder;
    const Somebody somebody("=cmd,\"x\"");
    writeProgressCsv(folder / "p.csv", somebody.people);
    std::istringstream in(base::contentOf(folder / "p.csv").value());
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line.find("name,session,started,curriculum,exercise,case,mode,guidance,met"), 0U);
    std::size_t lines = 0;
    for (; std::getline(in, line); ++lines) {
        EXPECT_EQ(line.find("\"'=cmd,\"\"x\"\"\","), 0U) << line;
    }
    EXPECT_EQ(lines, somebody.people[0].sessions.size());
}

TEST(ProgressCsv, BeginsWithTheGroupWhereThereAreGroups)
{
    const tests::Folder folder;
    const Somebody anna("anna"), bert("bert");
    const std::vector<PeopleGroup> groups{{"a, b", anna.people}, {"c", bert.people}};
    writeProgressCsv(folder / "g.csv", bert.people, groups);
    std::istringstream in(base::contentOf(folder / "g.csv").value());
    std::string line;
    std::getline(in, line);
    EXPECT_TRUE(line.starts_with("group,name,session,")) << line;
    std::map<std::string, std::size_t> lines;
    while (std::getline(in, line)) {
        for (const char* const first : {",bert,", "\"a, b\",anna,", "c,bert,"}) {
            lines[first] += line.starts_with(first) ? 1 : 0;
        }
    }
    const std::size_t annas = anna.people[0].sessions.size(), berts = bert.people[0].sessions.size();
    EXPECT_EQ(lines,
              (std::map<std::string, std::size_t>{{",bert,", berts}, {"\"a, b\",anna,", annas}, {"c,bert,", berts}}));
}

// What the specification of xAPI asks of each statement: actor, verb and object with absolute IRIs, a UUID.
TEST(Xapi, StatementsAreWholeAndTheSameAgain)
{
    const tests::Folder folder;
    const Somebody somebody("P-07");
    writeXapi(folder / "a.json", somebody.people);
    writeXapi(folder / "b.json", somebody.people);
    EXPECT_EQ(base::contentOf(folder / "a.json").value(), base::contentOf(folder / "b.json").value());
    const auto statements = nlohmann::json::parse(base::contentOf(folder / "a.json").value());
    ASSERT_EQ(statements.size(), somebody.people[0].sessions.size());
    const std::regex uuid("[0-9a-f]{8}-[0-9a-f]{4}-5[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}"),
        iri("[a-z]+:[A-Za-z0-9._~:/%-]+");
    std::set<std::string> ids;
    for (std::size_t i = 0; i < statements.size(); ++i) {
        const auto& s = statements[i];
        EXPECT_TRUE(std::regex_match(s["id"].get<std::string>(), uuid)) << s["id"];
        EXPECT_TRUE(ids.insert(s["id"]).second);
        EXPECT_TRUE(std::regex_match(s["verb"]["id"].get<std::string>(), iri));
        EXPECT_TRUE(std::regex_match(s["object"]["id"].get<std::string>(), iri));
        EXPECT_EQ(s["actor"]["account"]["name"], "P-07");
        const bool met = meets(somebody.curriculum.exercise(somebody.people[0].sessions[i].exercise)->gate,
                               somebody.people[0].sessions[i].values);
        EXPECT_EQ(s["result"]["success"], met);
        EXPECT_TRUE(s["verb"]["id"].get<std::string>().ends_with(met ? "passed" : "failed"));
    }
}

TEST(Xapi, HasEachSessionOfGroupsOnce)
{
    const tests::Folder folder;
    const Somebody anna("anna");
    writeXapi(folder / "g.json", {}, {{"a", anna.people}});
    writeXapi(folder / "both.json", anna.people, {{"a", anna.people}, {"b", anna.people}});
    EXPECT_EQ(nlohmann::json::parse(base::contentOf(folder / "g.json").value()).size(), anna.people[0].sessions.size());
    EXPECT_EQ(base::contentOf(folder / "g.json").value(), base::contentOf(folder / "both.json").value());
}

TEST(Xapi, NamesWithBlanksMakeNoWrongIri)
{
    const tests::Folder folder;
    Somebody somebody("P-07");
    auto& sessions = somebody.people[0].sessions;
    sessions.resize(1);
    sessions[0].exercise = sessions[0].caseId = "";
    sessions[0].scene = "my scene/Leber \xc3\xbc";
    writeXapi(folder / "a.json", somebody.people);
    EXPECT_EQ(nlohmann::json::parse(base::contentOf(folder / "a.json").value())[0]["object"]["id"],
              "urn:palpate:case:my%20scene%2FLeber%20%C3%BC");
}

}  // namespace
}  // namespace palpate::training
