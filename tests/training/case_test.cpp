#include <datasets/scene.h>
#include <training/case.h>
#include <training/curriculum.h>

#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/training/courses.h>

#include <gtest/gtest.h>

#include <fstream>

namespace palpate::training {
namespace {

using tests::errorOf;
using tests::Folder;

std::vector<std::string> ownCases()
{
    useOwnData();
    std::vector<std::string> ids;
    for (const Case& c : allCases()) {
        ids.push_back(c.id);
    }
    return ids;
}

class EachCase : public ::testing::TestWithParam<std::string> {};

// Opens the scene, finds a way in, and asks for measures that its task has.
TEST_P(EachCase, IsWithoutFault)
{
    useOwnData();
    for (const std::string& fault : faultsOf(findCase(GetParam()))) {
        ADD_FAILURE() << fault;
    }
}

// The room for a tumour does not depend on the voxels, so the coarsest will do that hold the skin; but inserts need theirs.
TEST_P(EachCase, HasAPhantomForEverySeed)
{
    useOwnData();
    const std::string called = findCase(GetParam()).scene;
    const auto builtIn = datasets::builtInScene(called);
    datasets::Scene scene = builtIn ? *builtIn : datasets::loadScene(called);
    ASSERT_TRUE(scene.source.file.empty()) << "no phantom: see what else its seed decides";
    const double coarsest = scene.source.phantom.name == "layered" ? 3e-3 : 5e-3;
    scene.source.phantom.voxel = scene.source.inserts.empty() ? coarsest : scene.source.phantom.voxel;
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
        scene.source.phantom.seed = seed;
        EXPECT_EQ(errorOf([&] { datasets::sceneVolume(scene); }), "") << "seed " << seed;
    }
}

INSTANTIATE_TEST_SUITE_P(Own, EachCase, ::testing::ValuesIn(ownCases()), [](const auto& one) {
    std::string name = one.param;
    std::erase(name, '-');
    return name;
});

TEST(Case, ADozenComeAlongAndAllCanBeRead)
{
    useOwnData();
    std::vector<std::string> faults;
    EXPECT_GE(allCases(&faults).size(), 12U);
    EXPECT_TRUE(faults.empty()) << faults[0];
}

struct Wrong {
    const char* text;
    const char* said;  // after the folder's name
};

constexpr const char* whole =
    "title = \"T\"\nscene = \"layered\"\ndifficulty = 2\nbriefing = [\"Do it.\"]\nlicence = \"CC0-1.0\"\n";

TEST(Case, ErrorsNameFileLineAndKey)
{
    useOwnData();
    const Folder folder;
    const auto load = [&](const std::string& text) {
        std::ofstream(folder / "case.toml") << text;
        return errorOf([&] { loadCase(folder.path()); });
    };
    EXPECT_EQ(load(whole), "");
    const std::string text(whole);
    const auto file = (folder / "case.toml").string();
    EXPECT_EQ(load(text + "difficult = 3\n").find(file + ":6: difficult"), 0U) << load(text + "difficult = 3\n");
    EXPECT_NE(load(text + "measures = [\"peak_force\"]\n").find(":6: measures"), std::string::npos);
    EXPECT_NE(load(text + "measures = [\"peak_force\"]\n").find("did you mean peak_force_n?"), std::string::npos);
    EXPECT_NE(load(text + "picture = \"p.png\"\n").find("there is no such file"), std::string::npos);
    EXPECT_NE(load(text + "picture = \"../p.png\"\n").find("must lie in the case's folder"), std::string::npos);
    EXPECT_NE(load("title = \"T\"\nscene = \"layerd\"\n")
                  .find(":2: scene = \"layerd\": there is no such built-in scene; did you mean layered?"),
              std::string::npos)
        << load("title = \"T\"\nscene = \"layerd\"\n");
    EXPECT_NE(load("title = \"T\"\n").find("scene is missing"), std::string::npos);
    EXPECT_NE(load("title = \"T\"\nscene = \"layered\"\ndifficulty = 9\n").find(":3: difficulty = 9: must be 1 to 5"),
              std::string::npos);
}

TEST(Case, AMistypedNameIsMetWithTheOneThatWasMeant)
{
    useOwnData();
    EXPECT_NE(errorOf([] { findCase("near-vesel"); }).find("did you mean near-vessel?"), std::string::npos);
    EXPECT_NE(errorOf([] { findCurriculum("palpaton"); }).find("did you mean palpation?"), std::string::npos);
}

TEST(Curriculum, ErrorsNameFileLineAndKey)
{
    useOwnData();
    const Folder folder;
    const auto load = [&](const std::string& text) {
        std::ofstream(folder / "c.toml") << "title = \"T\"\n" << text;
        return errorOf([&] { loadCurriculum(folder / "c.toml"); });
    };
    const std::string one = "[[exercise]]\nid = \"a\"\ntitle = \"A\"\ncase = \"layered\"\n";
    const std::string level = "[[exercise.level]]\nmeasure = \"total\"\nat_least = 50\n";
    EXPECT_EQ(load(one + level), "");
    EXPECT_NE(load(one).find("level is missing"), std::string::npos);
    EXPECT_NE(load(one + "pass = 6\nof = 5\n" + level).find(":6: [[exercise]] pass = 6 sessions: must be 1 to 5"),
              std::string::npos)
        << load(one + "pass = 6\nof = 5\n" + level);
    EXPECT_NE(load("[[exercise]]\nid = \"a\"\ntitle = \"A\"\ncase = \"layerd\"\n" + level).find("did you mean layered?"),
              std::string::npos);
    EXPECT_NE(load(one + "after = [\"b\"]\n" + level).find("there is no exercise b before this one"), std::string::npos);
    EXPECT_NE(load(one + level + one + level).find("there is an exercise of this name already"), std::string::npos);
    EXPECT_NE(load(one + "[[exercise.level]]\nmeasure = \"total\"\nat_least = 5\nat_most = 4\n").find("nothing can be"),
              std::string::npos);
    EXPECT_NE(load(one + level + level).find("total has two"), std::string::npos) << load(one + level + level);
    EXPECT_NE(load("[cusum]\nacceptable_failure = 0.3\nunacceptable_failure = 0.2\n" + one + level)
                  .find("must be over acceptable_failure"),
              std::string::npos);
}

// A curriculum in a file has slashes of its own; ids have none.
TEST(Curriculum, AnExerciseIsNamedByItsCurriculumOrByTheFileOfOne)
{
    useOwnData();
    const Folder folder;
    std::ofstream(folder / "mine.toml") << "title = \"T\"\n[[exercise]]\nid = \"a\"\ntitle = \"A\"\ncase = \"layered\"\n"
                                           "[[exercise.level]]\nmeasure = \"total\"\nat_least = 50\n";
    const auto [mine, exercise] = findExercise((folder / "mine.toml").string() + "/a");
    EXPECT_EQ(mine.id, "mine");
    EXPECT_EQ(exercise, "a");
    const Curriculum ours = breastCourse();
    EXPECT_EQ(findExercise(ours.id + "/" + ours.exercises[0].id).second, ours.exercises[0].id);
    for (const std::string& named :
         {ours.id, ours.id + "/none", (folder / "mine.toml").string(), (folder / "mine.toml").string() + "/b"}) {
        EXPECT_NE(errorOf([&] { findExercise(named); }).find("has no such exercise: give CURRICULUM/EXERCISE"),
                  std::string::npos)
            << named;
    }
}

TEST(Curriculum, GuidanceFadesFromTheFirstTrialToNone)
{
    Exercise fading;
    fading.fadeTrials = 5;
    for (int n = 1; n <= 8; ++n) {
        EXPECT_DOUBLE_EQ(guidanceOf(fading, n, false), n < 5 ? 1 - 0.25 * (n - 1) : 0);
        EXPECT_EQ(guidanceOf(fading, n, true), 0);
    }
}

TEST(Curriculum, TwoComeAlongAndTheFirstHasEightExercises)
{
    useOwnData();
    std::vector<std::string> faults;
    EXPECT_EQ(allCurricula(&faults).size(), 2U);
    EXPECT_TRUE(faults.empty()) << faults[0];
    EXPECT_EQ(breastCourse().exercises.size(), 8U);
}

}  // namespace
}  // namespace palpate::training
