#include <studies/accuracy/rival.h>
#include <studies/accuracy/rival_files.h>
#include <studies/kernel/kernel_rivals.h>

#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/studies/small_block.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <array>
#include <fstream>
#include <map>
#include <string>

namespace palpate::studies {
namespace {

using nlohmann::json;
using tests::errorOf;
using tests::Folder;

// The small block under the path's sphere, a mesh of it, and a stand-in reference: its grid of 4 mm, nearly converged.
struct Pushed {
    AccuracySubject subject = accuracySubject(std::make_shared<const haptics::SessionModel>(smallBlock()));
    TetBody mesh = latticeTets(*subject.model->tissue, subject.model->surface, 4e-3, 0.49);
    TrialBody body = trialBody(*subject.model->tissue, subject.model->surface, 4e-3, 0.49, 1U << 20);
    std::array<double, 1> speeds{subject.speed};
    Reference reference = solveReference(body.body, subject.path, speeds, {.tolerance = 1e-3, .maxCycles = 50});

    std::size_t looks() const
    {
        const auto ticks = schedule(subject.path, subject.speed);
        return static_cast<std::size_t>(std::ranges::count_if(ticks, &TrialTick::look));
    }
};

const Pushed& pushed()
{
    static const Pushed p;
    return p;
}

void writeFile(const std::filesystem::path& file, const std::string& text)
{
    std::ofstream(file) << text;
}

// `rows` lines under a head.
std::string table(const std::string& head, std::size_t rows, const std::string& row)
{
    std::string text = head + "\n";
    for (std::size_t i = 0; i < rows; ++i) {
        text += row + "\n";
    }
    return text;
}

void writeStill(const std::filesystem::path& folder)
{
    writeFile(folder / "displacements.csv",
              table("ux_m,uy_m,uz_m", pushed().looks() * pushed().mesh.points.size(), "0,0,0"));
    writeFile(folder / "forces.csv", table("fx_n,fy_n,fz_n", pushed().looks(), "0,0,0"));
    writeFile(folder / "times.csv", "processor_s\n2e-3\n4e-3\n3e-3\n");
}

AccuracyRun runOf(const std::string& command, const Folder& folder, double maxSeconds = 60)
{
    const std::array references{&pushed().reference};
    return runRival({"rival", command, "", {4e-3}}, 4e-3, "small", pushed().subject, references, folder / "run",
                    maxSeconds);
}

// By the theorem of Gauss a closed surface that looks outwards encloses the sum of the tetrahedra's volumes.
TEST(Rival, TheOutsideEnclosesTheTetrahedra)
{
    const TetBody& mesh = pushed().mesh;
    double inside = 0.0, enclosed = 0.0;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        inside += shapeOf(mesh, t).volume;
    }
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (const auto& f : outsideOf(mesh)) {
        enclosed += glm::dot(mesh.points[f[0]], glm::cross(mesh.points[f[1]], mesh.points[f[2]])) / 6.0;
        for (std::size_t i = 0; i < 3; ++i) {
            ++edges[{f[i], f[(i + 1) % 3]}];
            --edges[{f[(i + 1) % 3], f[i]}];
        }
    }
    EXPECT_GT(inside, 0.0);
    EXPECT_NEAR(enclosed, inside, 1e-9 * inside);
    for (const auto& [edge, uses] : edges) {
        ASSERT_EQ(uses, 0);
    }
}

TEST(Rival, ThePushHasTheSceneAsOurMethodsHaveIt)
{
    const Folder folder;
    writeRivalPush(folder.path(), "small", pushed().subject, pushed().mesh);
    std::ifstream in(folder / "push.json");
    const json push = json::parse(in);
    const TetBody& mesh = pushed().mesh;
    EXPECT_EQ(push["palpate_push"], 1);
    ASSERT_EQ(push["points_m"].size(), mesh.points.size());
    ASSERT_EQ(push["tets"].size(), mesh.tets.size());
    for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
        const json& material = push["materials"][push["tet_material"][t].get<std::size_t>()];
        const double nu = material["poisson_ratio"], mu = material["youngs_modulus_pa"].get<double>() / (2.0 * (1.0 + nu));
        ASSERT_NEAR(mu, mesh.mu[t], 1e-9 * mesh.mu[t]);
        ASSERT_NEAR(2.0 * mu * nu / (1.0 - 2.0 * nu), mesh.lambda[t], 1e-6 * mesh.lambda[t]);
    }
    const auto ticks = schedule(pushed().subject.path, pushed().subject.speed);
    ASSERT_EQ(push["tool_centre_m"].size(), ticks.size());
    EXPECT_EQ(push["look_ticks"].size(), pushed().looks());
    for (const json& look : push["look_ticks"]) {
        const std::size_t tick = look;
        EXPECT_TRUE(ticks[tick].look);
        const Vec3 at = pushed().subject.path.at(ticks[tick].pose);
        EXPECT_EQ(push["tool_centre_m"][tick][1], at.y);
    }
}

// Who answers that nothing moves is as wrong as the method "nothing", and misses all of the force.
TEST(Rival, TissueThatStaysIsAsWrongAsOurMethodNothing)
{
    const Folder folder;
    writeStill(folder.path());
    const AccuracyRun run = runOf(fmt::format("sh -c 'cp {}/*.csv \"$0\"'", folder.path().string()), folder);
    ASSERT_EQ(run.failure, "");
    ASSERT_EQ(run.results.size(), 1U);
    const TrialResult nothing = runTrial(nothingModel(), pushed().subject.path, pushed().subject.speed, pushed().reference);
    const TrialResult& result = run.results[0];
    ASSERT_EQ(result.looks.size(), nothing.looks.size());
    for (std::size_t i = 0; i < result.looks.size(); ++i) {
        EXPECT_DOUBLE_EQ(result.looks[i].near, nothing.looks[i].near);
        EXPECT_DOUBLE_EQ(result.looks[i].volume, nothing.looks[i].volume);
        EXPECT_EQ(result.looks[i].phase, nothing.looks[i].phase);
    }
    EXPECT_NEAR(result.looks.back().force, 100.0, 1e-9);
    EXPECT_NEAR(result.cpu, 3e-3, 1e-12);
    EXPECT_NEAR(result.p50, 3e-3, 1e-12);
    EXPECT_EQ(result.ticks, 3U);
}

TEST(Rival, AnswersOfBeforeDoNotCount)
{
    const Folder folder;
    writeStill(folder.path());
    EXPECT_EQ(runOf(fmt::format("sh -c 'cp {}/*.csv \"$0\"'", folder.path().string()), folder).failure, "");
    const std::string failure = runOf("true", folder).failure;
    EXPECT_NE(failure.find("displacements.csv: was not written"), std::string::npos) << failure;
}

TEST(Rival, WhatGoesWrongIsOneLine)
{
    const Folder folder;
    const auto expectFailure = [&](const std::string& command, const std::string& hint, double seconds = 60) {
        const AccuracyRun run = runOf(command, folder, seconds);
        EXPECT_TRUE(run.results.empty());
        EXPECT_NE(run.failure.find(hint), std::string::npos) << run.failure;
        EXPECT_EQ(run.failure.find('\n'), std::string::npos) << run.failure;
    };
    expectFailure("sh -c 'echo one; echo the reason >&2; exit 3'", "exit status 3 (");
    expectFailure("sh -c 'echo one; echo the reason >&2; exit 3'", "ends with: the reason)");
    expectFailure("no-such-solver", "exit status 127");
    expectFailure("sh -c 'kill -9 $$'", "was ended by ");
    // What the command has started ends with it: else this would wait for the pipe that nobody closes.
    expectFailure("sh -c 'sleep 600 & sleep 600'", "has not ended in 0.2 s", 0.2);
}

TEST(Rival, AMalformedAnswerNamesFileAndLine)
{
    const std::size_t looks = pushed().looks(), points = pushed().mesh.points.size();
    const auto refusal = [&](const std::string& file, const std::string& text) {
        const Folder folder;
        writeStill(folder.path());
        writeFile(folder / file, text);
        return errorOf([&] { readRivalAnswer(folder.path(), looks, points); });
    };
    const auto expect = [](const std::string& message, const std::string& hint) {
        EXPECT_NE(message.find(hint), std::string::npos) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    };
    const std::string head = "fx_n,fy_n,fz_n";
    expect(refusal("forces.csv", table(head, looks - 1, "0,0,0")), fmt::format("{} rows: must be {}", looks - 1, looks));
    expect(refusal("forces.csv", table(head, looks + 1, "0,0,0")), fmt::format("more than {} rows", looks));
    expect(refusal("forces.csv", table(head, looks, "0,nan,0")), "line 2: 'nan': must be a finite number");
    expect(refusal("forces.csv", table(head, looks, "0,1e300,0")), "line 2: '1e300'");
    expect(refusal("forces.csv", table(head, looks, "0,0")), "line 2: 2 values");
    expect(refusal("forces.csv", table("x,y,z", looks, "0,0,0")), "its first line must be fx_n,fy_n,fz_n");
    expect(refusal("forces.csv", ""), "its first line must be");
    expect(refusal("displacements.csv", table("ux_m,uy_m,uz_m", looks * points - 1, "0,0,0")),
           fmt::format("must be {}, {} points at each of {} looks", looks * points, points, looks));
    expect(refusal("times.csv", "processor_s\n"), "no rows");
    expect(refusal("times.csv", "processor_s\n0\n"), "must be over 0");
}

TEST(Rival, HasTheNameThatIsSaidOrThatOfItsFile)
{
    const Folder folder;
    writeFile(folder / "spring_net.py", "pass");
    const auto named = [](const std::string& text) { return rivalOf(text, {}).name; };
    EXPECT_EQ(named("febio=run-febio --quiet"), "febio");
    EXPECT_EQ(rivalOf("febio=run-febio --quiet", {}).command, "run-febio --quiet");
    EXPECT_EQ(named("sh " + (folder / "spring_net.py").string()), "spring_net");
    EXPECT_EQ(named("/opt/run-it.sh --a=b"), "run-it");
    EXPECT_NE(errorOf([&] { named("x="); }).find("no command"), std::string::npos);
    EXPECT_NE(errorOf([&] { named("$HOME/a*b"); }).find("write NAME=COMMAND"), std::string::npos);
}

// A changed program is another rival, and an unchanged one the same.
TEST(Rival, TheFingerprintFollowsTheFilesInTheCommand)
{
    const Folder folder;
    const Rival rival{"r", "sh " + (folder / "a.sh").string(), "", {}};
    writeFile(folder / "a.sh", "true");
    const std::string first = fingerprint(rival);
    EXPECT_EQ(fingerprint(rival), first);
    writeFile(folder / "a.sh", "false");
    EXPECT_NE(fingerprint(rival), first);
}

}  // namespace
}  // namespace palpate::studies
