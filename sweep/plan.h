#pragma once

#include <datasets/scene.h>
#include <sweep/design.h>
#include <sweep/procedure.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace palpate::sweep {

/// A value of a scene's key.
using KeyValue = std::variant<double, std::int64_t, bool, std::string>;
std::string toText(const KeyValue& value);
/// Nothing of a word, true and false.
std::optional<double> numberOf(const KeyValue& value);
/// `key` as a column and a formula name it: letters, digits and _.
std::string columnOf(std::string key);
/// An error of a text that nobody wrote, without its place (":63: ") in a file.
std::string withoutPlace(const std::string& error);

/// What a sweep varies: one key of the scene, or a name for formulas alone.
struct Axis {
    std::string name;              // of its column
    std::string key;               // with dots; empty: none
    std::vector<KeyValue> values;  // a list; empty: a range
    double low = 0, high = 0;      // of a range, both included; of whole numbers the first and the last one
    std::size_t steps = 0;         // of a range in a grid
    bool log = false;              // even in the logarithm
    bool whole = false;            // whole numbers only

    /// In a grid.
    std::size_t levels() const noexcept { return values.empty() ? steps : values.size(); }
    /// At a place in [0, 1) of the axis, as samples have it: each value of a list and each whole number of a range has an
    /// equal part of [0, 1). Whole numbers of a logarithmic range are rounded.
    KeyValue at(double unit) const;
    /// Of a grid or a list: whole numbers are rounded.
    KeyValue level(std::size_t index) const;
    /// Where at(unit) lies between the first value (0) and the last one (1): of a list by its number there, of whole
    /// numbers in the range, or in its logarithm.
    double placeAt(double unit) const;
    /// What formulas call a word of this axis: NAME_WORD.
    std::string variableOf(const KeyValue& word) const;
};

/// A key that every case sets: to a value, or to that of a formula ("= depth_mm + 2").
struct Setting {
    std::string key;
    KeyValue value;
};

/// A column of results: an output of the procedure, or a formula over outputs and axes.
struct SweepOutput {
    std::string name;
    std::string formula;  // empty: the output called so
};

/// A value of an output that a report marks, such as a threshold of perception.
struct OutputMark {
    std::string output, label;
    double at = 0;
};

/// How a job array is asked for; empty: as the cluster has it.
struct SlurmSettings {
    std::string partition, time, account, memory;
    std::vector<std::string> options;  // more of sbatch, such as "--qos=long"
    std::int64_t chunk = 0;            // cases per task; 0: about a hundred tasks
};

/// A plan has no more cases.
inline constexpr std::int64_t maxCases = 10'000'000;

/// A sweep as its file says it, checked. docs/sweeps.md explains the file.
struct SweepPlan {
    std::string name, about;
    std::string text;  // the file
    datasets::Scene base;
    std::uint64_t seed = 1;
    std::size_t repeats = 1;
    bool commonSeeds = false;  // repeat n has the same seed at every point
    bool records = false;      // a record per case
    double caseLimit = 3600;   // by the clock, after which a case is given up, and its row says so [s]
    DesignKind design = DesignKind::grid;
    std::size_t samples = 0;
    std::vector<Axis> axes;
    std::vector<std::string> constraints;  // formulas; a point that one gives 0 for is left out
    std::vector<Setting> settings;
    std::vector<Setting> reference;  // what differs in the case that each is compared with; empty: none
    std::vector<SweepOutput> outputs;
    std::vector<OutputMark> marks;
    SlurmSettings slurm;
    UnitPoints
        points;  // that satisfy the constraints; of a grid or a list the index of each value in place of a coordinate

    std::size_t cases() const noexcept { return points.size() * repeats; }
};

/// Reads a plan. `baseScene` gives the scene that its key `scene` names. Throws std::runtime_error
/// ("FILE:LINE: what is wrong"), also when a case's scene would be none: if `probed`.
using SceneSource = datasets::Scene (*)(const std::string& what, const std::filesystem::path& origin);
SweepPlan parsePlan(const std::string& text, const std::filesystem::path& origin, SceneSource baseScene,
                    bool probed = true);
/// The scene that a plan names alone. Throws std::runtime_error.
datasets::Scene sceneOfPlan(const std::string& text, const std::filesystem::path& origin, SceneSource baseScene);
/// A built-in scene by name, a scene (.toml) or a volume (.vdb) from the plan's folder.
datasets::Scene namedScene(const std::string& what, const std::filesystem::path& origin);

std::vector<std::string> builtInPlans();
/// Text of a built-in plan (datasets/sweeps); empty when there is none of this name.
std::string_view builtInPlan(const std::string& name);

/// One case: what follows from the plan and its number alone.
struct SweepCase {
    std::size_t index = 0, point = 0, repeat = 0;
    std::uint64_t seed = 0;
    std::vector<KeyValue> parameters;         // by axis
    std::map<std::string, double> variables;  // what formulas see: axes (of words: AXIS_WORD, 1 or 0), seed, repeat, point
    datasets::Scene scene, reference;         // `reference`: of plans that have one
    Procedure procedure, referenceProcedure;
};
SweepCase sweepCase(const SweepPlan& plan, std::size_t index);
/// The scene with these keys set. Throws std::runtime_error for a key or a value that no scene has.
datasets::Scene sceneWith(const datasets::Scene& scene, const std::vector<Setting>& settings);
/// The parameters alone: cannot fail.
SweepCase sweepPoint(const SweepPlan& plan, std::size_t index);

}  // namespace palpate::sweep
