#include <training/curriculum.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/nearest.h>
#include <datasets/toml_section.h>
#include <training/case.h>
#include <training/folders.h>
#include <training/toml_lists.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

namespace palpate::training {

namespace fs = std::filesystem;
using datasets::Section;

namespace {

constexpr int maxTrials = 100;
constexpr std::array<std::string_view, 3> guidanceNames{"on", "off", "fade"};
constexpr std::array<std::string_view, 2> modeNames{"any", "test"};

Level readLevel(Section& section)
{
    Level level;
    level.measure = called(section, "measure", "a measure of docs/score.md");
    checkMeasure(section, "measure", level.measure);
    const bool ofHundred = level.measure == "total" || level.measure.ends_with("_pct");
    const auto [low, high] = ofHundred ? std::pair(0.0, 100.0) : std::pair(-1e9, 1e9);
    level.atLeast = section.number("at_least", "", low, high);
    level.atMost = section.number("at_most", "", low, high);
    section.missingIf(!level.atLeast && !level.atMost, "at_most", "or at_least: what the measure has to be");
    section.refuseIf(level.atLeast && level.atMost && *level.atLeast > *level.atMost, "at_least",
                     "nothing can be at least that and at most what at_most says");
    section.finish();
    return level;
}

Gate readGate(Section& section)
{
    Gate gate;
    gate.of = static_cast<int>(section.integer("of", "sessions", 1, maxTrials).value_or(gate.of));
    gate.pass = static_cast<int>(section.integer("pass", "sessions", 1, gate.of).value_or(std::min(gate.pass, gate.of)));
    gate.testOnly = section.choice("mode", modeNames).value_or(0) == 1;
    gate.levels = base::mapped<Level>(section.sections("level"), readLevel);
    for (auto level = gate.levels.begin(); level != gate.levels.end(); ++level) {
        const bool again = std::ranges::find(gate.levels.begin(), level, level->measure, &Level::measure) != level;
        section.refuseIf(again, "level", level->measure + " has two: put at_least and at_most into one");
    }
    section.missingIf(gate.levels.empty(), "level", "at least one [[exercise.level]]: what opens the gate");
    return gate;
}

Exercise readExercise(Section& section, const Curriculum& before)
{
    Exercise e;
    e.id = called(section, "id", "a short name");
    section.refuseIf(before.exercise(e.id) != nullptr, "id", "there is an exercise of this name already");
    section.refuseIf(e.id.find('/') != std::string::npos, "id", "must be without /");
    e.title = called(section, "title", "a few words");
    e.caseId = called(section, "case", "a case: palpate case list");
    try {
        findCase(e.caseId);
    } catch (const std::runtime_error& fault) {
        section.refuse("case", fault.what());
    }
    if (section.has("after")) {
        e.after = section.words("after");
    } else if (!before.exercises.empty()) {
        e.after = {before.exercises.back().id};
    }
    e.guidance =
        static_cast<Guidance>(section.choice("guidance", guidanceNames).value_or(static_cast<std::size_t>(Guidance::fade)));
    section.refuseIf(section.has("fade_trials") && e.guidance != Guidance::fade, "fade_trials",
                     "guidance does not fade here: add guidance = \"fade\"");
    e.fadeTrials = static_cast<int>(section.integer("fade_trials", "sessions", 2, maxTrials).value_or(e.fadeTrials));
    e.gate = readGate(section);
    for (const std::string& other : e.after) {
        // Only those before it: so none wait for one another.
        if (before.exercise(other) == nullptr) {
            const auto ids = base::mapped<std::string>(before.exercises, &Exercise::id);
            section.refuse("after",
                           fmt::format("there is no exercise {} before this one{}", other, base::meant(other, ids)));
        }
    }
    section.finish();
    return e;
}

CusumPlan readCusum(Section& section)
{
    CusumPlan plan;
    plan.p0 = section.number("acceptable_failure", "", 0.001, 0.9).value_or(plan.p0);
    plan.p1 = section.number("unacceptable_failure", "", 0.002, 0.99).value_or(plan.p1);
    section.refuseIf(plan.p1 <= plan.p0, "unacceptable_failure",
                     fmt::format("must be over acceptable_failure, {:g}", plan.p0));
    plan.alpha = section.number("alpha", "", 0.001, 0.4).value_or(plan.alpha);
    plan.beta = section.number("beta", "", 0.001, 0.4).value_or(plan.beta);
    section.finish();
    return plan;
}

// The curriculum's file in the data folders; empty: none.
fs::path fileCalled(const std::string& id)
{
    for (const fs::path& folder : dataFolders("curricula")) {
        const fs::path file = folder / (id + ".toml");
        if (id.find('/') == std::string::npos && fs::is_regular_file(file)) {
            return file;
        }
    }
    return {};
}

}  // namespace

const Exercise* Curriculum::exercise(std::string_view name) const noexcept
{
    const auto at = std::ranges::find(exercises, name, &Exercise::id);
    return at == exercises.end() ? nullptr : &*at;
}

Curriculum loadCurriculum(const fs::path& file)
{
    Curriculum c;
    c.file = fs::absolute(file);
    c.id = file.stem().string();
    const toml::table table = datasets::parseToml(datasets::readText(file), file.string());
    Section top(table, file.string(), "");
    c.title = called(top, "title", "a few words");
    c.about = top.word("about").value_or("");
    c.refreshDays = top.number("refresh_days", "days", 1, 10000).value_or(c.refreshDays);
    if (auto section = top.section("cusum")) {
        c.cusum = readCusum(*section);
    }
    for (Section& section : top.sections("exercise")) {
        c.exercises.push_back(readExercise(section, c));
    }
    top.missingIf(c.exercises.empty(), "exercise", "at least one [[exercise]]");
    top.finish();
    return c;
}

std::vector<std::string> faultsOf(const Curriculum& curriculum)
{
    std::vector<std::string> faults;
    for (const Exercise& e : curriculum.exercises) {
        const Case its = findCase(e.caseId);
        for (const Level& level : e.gate.levels) {
            if (const std::string fault = measureFault(its, level.measure); !fault.empty()) {
                faults.push_back(
                    fmt::format("{}: exercise {}: its gate never opens: {}", curriculum.file.string(), e.id, fault));
            }
        }
    }
    return faults;
}

std::vector<Curriculum> allCurricula(std::vector<std::string>* faults)
{
    auto all = loadedOf<Curriculum>(
        "curricula", [](const fs::path& p) { return p.extension() == ".toml"; }, loadCurriculum, faults);
    std::ranges::sort(all, {}, &Curriculum::title);
    return all;
}

Curriculum findCurriculum(const std::string& id)
{
    if (fs::path(id).extension() == ".toml") {
        return loadCurriculum(id);
    }
    if (const fs::path file = fileCalled(id); !file.empty()) {
        return loadCurriculum(file);
    }
    throw base::error("{}: there is no such curriculum{} (palpate curriculum list)", id,
                      base::meant(id, base::mapped<std::string>(allCurricula(), &Curriculum::id)));
}

std::string nameToFind(const Curriculum& curriculum)
{
    const fs::path named = fileCalled(curriculum.id);
    std::error_code none;
    return !named.empty() && fs::equivalent(named, curriculum.file, none) ? curriculum.id : curriculum.file.string();
}

std::pair<Curriculum, std::string> findExercise(const std::string& named)
{
    // A curriculum in a file has a folder's slashes.
    const std::size_t slash = fs::path(named).extension() == ".toml" ? std::string::npos : named.rfind('/');
    Curriculum curriculum = findCurriculum(named.substr(0, slash));
    std::string exercise = slash == std::string::npos ? "" : named.substr(slash + 1);
    base::failIf(curriculum.exercise(exercise) == nullptr,
                 "--exercise {}: {} has no such exercise: give CURRICULUM/EXERCISE (palpate "
                 "curriculum check {})",
                 named, curriculum.id, named.substr(0, slash));
    return {std::move(curriculum), std::move(exercise)};
}

std::vector<std::string> measuresOf(const Exercise& exercise)
{
    std::vector<std::string> keys{"total"};
    for (const Level& level : exercise.gate.levels) {
        if (std::ranges::find(keys, level.measure) == keys.end()) {
            keys.push_back(level.measure);
        }
    }
    return keys;
}

double guidanceOf(const Exercise& exercise, int number, bool test) noexcept
{
    if (test || exercise.guidance == Guidance::off) {
        return 0;
    }
    const double left = static_cast<double>(exercise.fadeTrials - number) / (exercise.fadeTrials - 1);
    return exercise.guidance == Guidance::on ? 1 : std::clamp(left, 0.0, 1.0);
}

}  // namespace palpate::training
