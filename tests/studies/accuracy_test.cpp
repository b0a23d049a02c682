#include <base/inputs.h>
#include <studies/accuracy/accuracy.h>
#include <studies/accuracy/references.h>
#include <studies/kernel/kernel_rivals.h>
#include <studies/kernel/kernel_trial.h>

#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/studies/small_block.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <random>

namespace palpate::studies {
namespace {

using tests::errorOf;

// The block under a 10 mm sphere, and a stand-in reference: the same body on a grid of 2 mm, converged.
struct PressedBlock {
    AccuracySubject subject = accuracySubject(std::make_shared<const haptics::SessionModel>(smallBlock()));
    TrialBody body = trialBody(*subject.model->tissue, subject.model->surface, 2e-3, 0.49, 1U << 20);
    std::array<double, 1> speeds{subject.speed};
    Reference linear = solveReference(body.body, subject.path, speeds, {});

    std::string key(const std::string& law = "linear", double speed = 20e-3) const
    {
        return referenceKey(*subject.model->tissue, subject.path, speed, law);
    }
};

const PressedBlock& pressedBlock()
{
    static const PressedBlock p;
    return p;
}

ReferenceInfo someInfo()
{
    return {"0123456789abcdef", "small", "sphere_10mm", "linear", "P2", 20e-3, 1234, 5678, 9.5, "stand-in 1", {}, {}};
}

// Follows a reference: its displacements and forces, times `fraction`.
TrialModel follower(const Reference& reference, double fraction)
{
    auto now = std::make_shared<const ReferenceState*>(nullptr);
    TrialModel model = nothingModel();
    model.tick = [=, &reference](const TrialLoad& load) {
        for (const ReferenceState& s : reference.states) {
            *now = s.pose == load.pose() ? &s : *now;
        }
        return chainmail::ElasticResult{};
    };
    auto index = std::make_shared<std::map<std::array<float, 3>, std::size_t>>();
    for (std::size_t i = 0; i < reference.position.size(); ++i) {
        const Vec3f p = reference.position[i];
        index->emplace(std::array{p.x, p.y, p.z}, i);
    }
    model.displacement = [=](Vec3 rest) {
        const Vec3f p(rest);
        return fraction * Vec3((*now)->u[index->at({p.x, p.y, p.z})]);
    };
    model.force = [=] { return fraction * (*now)->force; };
    return model;
}

void write(const std::filesystem::path& file, const std::string& bytes)
{
    std::ofstream(file, std::ios::binary) << bytes;
}

// Rounding to a 32,000th of the largest component of a state, at most half of it off.
TEST(ReferenceFile, GivesBackWhatWasSaved)
{
    const tests::Folder folder;
    const Reference& before = pressedBlock().linear;
    saveReference(folder / "a.ref", before, someInfo());
    const auto [after, info] = loadReference(folder / "a.ref");
    EXPECT_EQ(info.key, someInfo().key);
    EXPECT_EQ(info.program, someInfo().program);
    EXPECT_EQ(info.unknowns, someInfo().unknowns);
    EXPECT_EQ(info.speed, someInfo().speed);
    EXPECT_FALSE(info.press);
    EXPECT_EQ(after.position, before.position);
    EXPECT_EQ(after.peakForce, before.peakForce);
    ASSERT_EQ(after.states.size(), before.states.size());
    for (std::size_t s = 0; s < before.states.size(); ++s) {
        EXPECT_EQ(after.states[s].pose, before.states[s].pose);
        EXPECT_EQ(after.states[s].force, before.states[s].force);
        EXPECT_EQ(after.states[s].focus, before.states[s].focus);
        EXPECT_EQ(after.states[s].largest, before.states[s].largest);
        double worst = 0.0;
        for (std::size_t i = 0; i < before.position.size(); ++i) {
            const Vec3f off = glm::abs(after.states[s].u[i] - before.states[s].u[i]);
            worst = std::max(worst, static_cast<double>(std::max({off.x, off.y, off.z})));
        }
        EXPECT_LE(worst, before.states[s].largest / 32000.0);
        EXPECT_GT(before.states[s].largest, 0.0);
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "a.ref.part"));
}

// Every file that is cut short or damaged is refused on one line that names it, and none ends the program.
TEST(ReferenceFile, RefusesWhatIsNoReference)
{
    const tests::Folder folder;
    Reference small;
    small.position = {{0, 0, 0}, {1e-3F, 0, 0}};
    small.states.resize(1);
    small.states[0].u = {{1e-3F, 0, 0}, {0, 2e-3F, 0}};
    saveReference(folder / "whole.ref", small, someInfo());
    const std::string whole = base::contentOf(folder / "whole.ref").value();
    std::vector<std::string> damaged{"", "no reference", std::string(4096, '\xff')};
    for (std::size_t length = 1; length < whole.size(); length += 7) {
        damaged.push_back(whole.substr(0, length));
    }
    std::minstd_rand random(1);
    for (int i = 0; i < 300; ++i) {
        damaged.push_back(whole);
        damaged.back()[random() % whole.size()] ^= static_cast<char>(1 + random() % 255);
    }
    for (const std::string& bytes : damaged) {
        write(folder / "bad.ref", bytes);
        const std::string error = errorOf([&] { loadReference(folder / "bad.ref"); });
        EXPECT_NE(error.find("bad.ref"), std::string::npos);
        EXPECT_EQ(error.find('\n'), std::string::npos);
    }
    EXPECT_NE(errorOf([&] { loadReference(folder / "missing.ref"); }).find("cannot be read"), std::string::npos);
}

// Two tissues of 4 x 4 x 4 voxels of 1 mm.
struct Cube {
    volume::LabelImage image{Index3(4), {Mat3(1e-3), Vec3(0.0)}, std::vector<std::uint16_t>(64, 1)};
    volume::TissueTable table{"two", std::vector<volume::TissueRow>(3)};

    Cube()
    {
        std::fill_n(image.values.begin(), 16, std::uint16_t{2});
        const char* const names[]{"air", "fat", "base"};
        for (std::size_t i = 0; i < 3; ++i) {
            table.rows[i].name = names[i];
        }
        table.rows[0].role = volume::Role::air;
        table.rows[1].youngsModulus = 3e3;
        table.rows[2].youngsModulus = 9e3;
    }
    std::string key(const TrialPath& path, double speed = 20e-3, const std::string& law = "linear",
                    double poissonCap = 0.49) const
    {
        const volume::LabelName names[]{{1, "fat", "fat"}, {2, "base", "base"}};
        return referenceKey(volume::Tissue::fromLabels(image, table, names, {}), path, speed, law, poissonCap);
    }
};

TEST(ReferenceFile, TheKeyChangesWithEverythingThatTheSolutionDependsOn)
{
    const TrialPath path = pressedBlock().subject.path;
    EXPECT_EQ(Cube().key(path), Cube().key(path));
    EXPECT_EQ(Cube().key(path).size(), 16U);
    std::vector<std::string> keys{Cube().key(path), Cube().key(path, 30e-3), Cube().key(path, 20e-3, "neo-hookean")};
    const auto addPath = [&](auto&& change) {
        TrialPath other = path;
        change(other);
        keys.push_back(Cube().key(other));
    };
    addPath([](TrialPath& o) { o.press += 1e-5; });
    addPath([](TrialPath& o) { o.drag += 1e-5; });
    addPath([](TrialPath& o) { o.gap += 1e-5; });
    addPath([](TrialPath& o) { o.start.x += 1e-5; });
    addPath([](TrialPath& o) { o.tool.radius += 1e-5; });
    addPath([](TrialPath& o) { o.inward = glm::normalize(o.inward + Vec3(1e-3, 0, 0)); });
    addPath([](TrialPath& o) { o.sideways = -o.sideways; });
    addPath([](TrialPath& o) { o.ties.push_back({Vec3(1e-3), Vec3(0.0), Vec3(0, 0, 1), 10.0, 10.0}); });
    const auto addCube = [&](auto&& change) {
        Cube other;
        change(other);
        keys.push_back(other.key(path));
    };
    addCube([](Cube& c) { c.image.values[40] = 2; });
    addCube([](Cube& c) { c.image.affine.origin.y = 1e-4; });
    addCube([](Cube& c) { c.image.affine.linear *= 1.001; });
    addCube([](Cube& c) { c.table.rows[2].youngsModulus += 1.0; });
    addCube([](Cube& c) { c.table.rows[1].poissonRatio += 0.001; });
    addCube([](Cube& c) { c.table.rows[1].stiffening = 1.0; });
    addCube([](Cube& c) { c.table.rows[2].fixed = true; });
    addCube([](Cube& c) { c.table.rows[2].role = volume::Role::bone; });
    Cube stiff;
    stiff.table.rows[1].poissonRatio = 0.48;
    keys.push_back(stiff.key(path));
    keys.push_back(stiff.key(path, 20e-3, "linear", 0.45));
    std::ranges::sort(keys);
    EXPECT_EQ(std::unique(keys.begin(), keys.end()), keys.end());
}

// Another machine's rounding of the path is no other problem.
TEST(ReferenceFile, TheKeyDoesNotFeelRounding)
{
    const auto& p = pressedBlock();
    TrialPath path = p.subject.path;
    path.press *= 1.0 + 1e-12;
    path.start *= 1.0 - 1e-12;
    path.inward = glm::normalize(path.inward + Vec3(1e-12));
    EXPECT_EQ(referenceKey(*p.subject.model->tissue, path, p.subject.speed, "linear"), p.key());
}

// A folder of references of one body; `solve` puts one there that presses beside the scene's entry.
struct Shelf {
    tests::Folder folder;
    ReferenceFolders folders{std::filesystem::path(std::string(folder / "")), {}};
    AccuracySubject subject = pressedBlock().subject;

    void solve(const std::string& name, const std::string& law, Vec3 beside)
    {
        TrialPath path = subject.path;
        path.start += beside;
        ReferenceInfo info = someInfo();
        info.law = law;
        info.key = referenceKey(*subject.model->tissue, path, subject.speed, law);
        info.body = referenceKey(*subject.model->tissue, path, subject.speed, law, 0.49, false);
        info.press = pressOf(path);
        saveReference(folder / (name + "-" + info.key + ".ref"), {}, info);
    }
    // Name of the reference that is taken; what went wrong where none is.
    std::string taken(const std::string& law)
    {
        std::string name;
        const std::string error =
            errorOf([&] { name = solvedReference("no such scene", subject, law, folders, [](const auto&) {}).second.law; });
        return name.empty() ? error : name;
    }
};

// The surface is read from voxels, and a scene's entry with it: the press of the reference counts, for all laws alike.
TEST(References, OneBesideTheEntryIsTakenAndItsPathToo)
{
    Shelf shelf;
    const Vec3 own = shelf.subject.path.start;
    shelf.solve("near", "linear", Vec3(1e-5, -2e-4, 0.0));
    shelf.solve("same", "neo-hookean", Vec3(1e-5, -2e-4, 0.0));
    shelf.solve("other", "exponential", Vec3(0.0));
    EXPECT_EQ(shelf.taken("linear"), "linear");
    EXPECT_NEAR(glm::distance(shelf.subject.path.start, own + Vec3(1e-5, -2e-4, 0.0)), 0.0, 1e-12);
    EXPECT_EQ(shelf.taken("neo-hookean"), "neo-hookean");
    EXPECT_NE(shelf.taken("exponential"), "exponential");  // its path is another one than the first reference's
    EXPECT_EQ(shelf.subject.pathOf.filename().string().substr(0, 4), "near");
}

TEST(References, OneFarFromTheEntryOrOfAnotherBodyIsNotTaken)
{
    Shelf shelf;
    shelf.solve("far", "linear", Vec3(1.1e-3, 0.0, 0.0));
    EXPECT_NE(shelf.taken("linear"), "linear");
    shelf.subject.speed *= 2.0;
    shelf.solve("fast", "linear", Vec3(1e-5, 0.0, 0.0));
    shelf.subject.speed /= 2.0;
    EXPECT_NE(shelf.taken("linear"), "linear");
    EXPECT_TRUE(shelf.subject.pathOf.empty());
}

// One that cannot be read is in nobody's way but of those who ask for it.
TEST(References, ADamagedOneHidesNoOther)
{
    Shelf shelf;
    write(shelf.folder / "a.ref", "no reference");
    shelf.solve("near", "linear", Vec3(1e-5, 0.0, 0.0));
    EXPECT_EQ(shelf.taken("linear"), "linear");
}

TEST(Accuracy, AModelThatIsTheReferenceHasNoErrorAndHalfOfItHalf)
{
    const auto& p = pressedBlock();
    const TrialResult same = runTrial(follower(p.linear, 1.0), p.subject.path, p.subject.speed, p.linear);
    ASSERT_FALSE(same.looks.empty());
    for (const TrialErrors& e : same.looks) {
        EXPECT_EQ(e.rms, 0.0);
        EXPECT_EQ(e.near, 0.0);
        EXPECT_EQ(e.max, 0.0);
        EXPECT_EQ(e.force, 0.0);
        EXPECT_EQ(e.volume, 0.0);
    }
    const TrialResult half = runTrial(follower(p.linear, 0.5), p.subject.path, p.subject.speed, p.linear);
    EXPECT_NEAR(half.looks.back().max, 50.0, 1e-5);
    EXPECT_NEAR(half.looks.back().force, 50.0, 1e-9);
    EXPECT_GT(half.looks.back().volume, 0.0);
}

// A lattice of which one point is missing, 2 mm: u = a x along x and 0 else has J = 1 + a in every cell.
TEST(Accuracy, TheVolumeErrorIsTheMeanDifferenceOfDeterminants)
{
    Reference reference;
    for (int i = 0; i < 124; ++i) {
        reference.position.emplace_back(2e-3F * Vec3f(i % 5, (i / 5) % 5, i / 25));
    }
    const PositionCells cells = positionCells(reference.position);
    EXPECT_NEAR(cells.side, 2e-3, 1e-9);
    EXPECT_EQ(cells.corners.size(), 63U);
    ReferenceState state;
    state.focus = Vec3(4e-3);
    state.largest = 1e-3;
    std::vector<Vec3> u;
    for (const Vec3f& p : reference.position) {
        state.u.emplace_back(0.02F * p.x, 0.0F, 0.0F);
        u.emplace_back(0.05 * static_cast<double>(p.x), 0.0, 0.0);
    }
    EXPECT_NEAR(errorsOf(u, {}, reference, cells, state).volume, 3.0, 1e-4);
    state.focus = Vec3(1.0);  // nothing is near it
    EXPECT_EQ(errorsOf(u, {}, reference, cells, state).volume, 0.0);
}

TEST(Accuracy, PositionsWithoutALatticeHaveNoCells)
{
    std::minstd_rand random(3);
    std::uniform_real_distribution<float> place(0.0F, 0.05F);
    std::vector<Vec3f> position;
    for (int i = 0; i < 500; ++i) {
        position.emplace_back(place(random), place(random), place(random));
    }
    EXPECT_TRUE(positionCells(position).corners.empty());
    EXPECT_TRUE(positionCells({}).corners.empty());
}

// Against another law the law itself is the error, and the looks are those of a run.
TEST(Accuracy, TheFloorIsTheErrorOfOneReferenceAgainstTheOther)
{
    const auto& p = pressedBlock();
    Reference other = p.linear;
    for (ReferenceState& s : other.states) {
        for (Vec3f& u : s.u) {
            u *= 0.9F;
        }
        s.force *= 0.8;
    }
    const auto floor = errorsBetween(other, p.linear, p.subject.path, p.subject.speed);
    const auto run = runTrial(nothingModel(), p.subject.path, p.subject.speed, p.linear).looks;
    ASSERT_EQ(floor.size(), run.size());
    for (std::size_t i = 0; i < floor.size(); ++i) {
        EXPECT_EQ(floor[i].phase, run[i].phase);
        EXPECT_NEAR(floor[i].near, 0.1 * run[i].near, 1e-4);
        EXPECT_LE(floor[i].force, 20.0 + 1e-9);
    }
    EXPECT_NEAR(floor.back().force, 20.0, 1e-9);
    other.position.pop_back();
    EXPECT_THROW(errorsBetween(other, p.linear, p.subject.path, p.subject.speed), std::runtime_error);
}

// One run against two references gives what two runs give.
TEST(Accuracy, ManyReferencesShareARun)
{
    const auto& p = pressedBlock();
    Reference half = p.linear;
    half.peakForce *= 0.5;
    for (ReferenceState& s : half.states) {
        s.largest *= 0.5;
    }
    const std::array both{&p.linear, static_cast<const Reference*>(&half)};
    const auto together = runTrials(nothingModel(), p.subject.path, p.subject.speed, both);
    ASSERT_EQ(together.size(), 2U);
    const auto alone = runTrial(nothingModel(), p.subject.path, p.subject.speed, p.linear);
    for (std::size_t i = 0; i < alone.looks.size(); ++i) {
        EXPECT_EQ(together[0].looks[i].near, alone.looks[i].near);
        EXPECT_NEAR(together[1].looks[i].near, 2.0 * alone.looks[i].near, 1e-9);
    }
    EXPECT_EQ(together[0].ticks, alone.ticks);
}

// No point of the front is beaten, and every other point is beaten by one of the front.
TEST(ParetoFront, IsBeatenByNothingAndBeatsTheRest)
{
    std::minstd_rand random(7);
    std::uniform_int_distribution<int> grid(1, 20);  // coarse, so that points coincide
    for (int run = 0; run < 200; ++run) {
        std::vector<AccuracyPoint> points;
        for (int i = 0; i < 40; ++i) {
            points.push_back({grid(random) * 1e-4, grid(random) * 0.5});
        }
        points.push_back({std::numeric_limits<double>::quiet_NaN(), 0.0});
        points.push_back({0.0, std::numeric_limits<double>::quiet_NaN()});
        const auto front = paretoFront(points);
        const auto beats = [&](std::size_t a, std::size_t b) {
            return points[a].seconds <= points[b].seconds && points[a].error <= points[b].error;
        };
        for (std::size_t i = 0; i < 40; ++i) {
            const bool on = std::ranges::find(front, i) != front.end();
            const bool beaten = std::ranges::any_of(front, [&](std::size_t f) { return f != i && beats(f, i); });
            EXPECT_NE(on, beaten);
        }
        EXPECT_TRUE(std::ranges::none_of(front, [](std::size_t f) { return f >= 40; }));
        EXPECT_TRUE(std::ranges::is_sorted(front, {}, [&](std::size_t f) { return points[f].seconds; }));
    }
}

TEST(Accuracy, AMethodThatFailsOrIsTooSlowSaysWhy)
{
    const auto& p = pressedBlock();
    const std::array references{&p.linear};
    const Baseline broken{"broken", "", []() -> TrialModel { throw std::runtime_error("the scene is too large"); }};
    const AccuracyRun failed = runAccuracy(broken, p.subject, references, 10.0);
    EXPECT_TRUE(failed.results.empty());
    EXPECT_EQ(failed.failure, "the scene is too large");
    const AccuracyRun slow = runAccuracy({"nothing", "", nothingModel}, p.subject, references, 0.0);
    EXPECT_TRUE(slow.results.empty());
    EXPECT_NE(slow.failure.find("per tick"), std::string::npos) << slow.failure;
    const auto apart = [] {
        TrialModel model = nothingModel();
        model.displacement = [](Vec3) { return Vec3(NAN); };
        return model;
    };
    const AccuracyRun nowhere = runAccuracy({"apart", "", apart}, p.subject, references, 10.0);
    EXPECT_TRUE(nowhere.results.empty());
    EXPECT_NE(nowhere.failure.find("no finite numbers"), std::string::npos) << nowhere.failure;
}

// Level spring pushes straight out of the surface, with a force that is proportional to the depth.
TEST(Accuracy, LevelSpringsForceIsProportionalToTheDepth)
{
    const auto& p = pressedBlock();
    const auto methods = rigidMethods(p.subject);
    ASSERT_EQ(methods[1].method, "spring");
    const TrialModel spring = methods[1].build();
    TrialLoad load(p.subject.path);
    load.set({p.subject.path.gap + 1e-3, 0.0});
    spring.tick(load);
    const Vec3 first = spring.force();
    load.set({p.subject.path.gap + 3e-3, 0.0});
    spring.tick(load);
    EXPECT_GT(glm::dot(first, -p.subject.path.inward), 0.01);
    EXPECT_NEAR(glm::length(spring.force()), 3.0 * glm::length(first), 0.15 * glm::length(first));
    EXPECT_GT(glm::dot(glm::normalize(first), -p.subject.path.inward), 0.999);
}

// The windows of the settings are the settings', and finer ones are nearer to the reference.
TEST(Accuracy, LevelElasticIsRunAtItsSettings)
{
    const auto& p = pressedBlock();
    const std::array references{&p.linear};
    double fast = 0.0, standard = 0.0;
    for (const Baseline& b : elasticMethods(p.subject)) {
        if (b.method == "elastic" && (b.setting == "fast" || b.setting == "default")) {
            const AccuracyRun run = runAccuracy(b, p.subject, references, 60.0);
            ASSERT_EQ(run.results.size(), 1U) << run.failure;
            EXPECT_TRUE(run.hasForce);
            EXPECT_GT(run.results[0].cpu, 0.0);
            (b.setting == "fast" ? fast : standard) = spreadOf(run.results[0].looks, &TrialErrors::near).median;
        }
    }
    EXPECT_GT(standard, 0.0);
    EXPECT_LT(standard, fast);
}

}  // namespace
}  // namespace palpate::studies
