#include <sweep/plan.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/split.h>
#include <datasets/embedded.h>
#include <datasets/scene_text.h>
#include <datasets/toml_section.h>
#include <haptics/trainee.h>
#include <sweep/formula.h>
#include <sweep/plan_checks.h>
#include <volume/tissue.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <ranges>
#include <set>
#include <stdexcept>

namespace palpate::sweep {

using datasets::Section;

namespace {

constexpr std::int64_t maxSamples = 1'000'000;
constexpr std::int64_t maxSteps = 100'000;
constexpr double furthest = 1e12;

KeyValue valueOf(Section& section, std::string_view key, const toml::node& node)
{
    if (const auto v = node.value_exact<std::int64_t>()) {
        return *v;
    }
    if (const auto v = node.value_exact<double>(); v && std::isfinite(*v)) {
        return *v;
    }
    if (const auto v = node.value_exact<bool>()) {
        return *v;
    }
    if (const auto v = node.value_exact<std::string>()) {
        return *v;
    }
    section.refuse(key, "a value must be a number, text, true or false");
}

void readRange(Section& section, std::string_view key, Axis& axis)
{
    const toml::array* const list = section.node(key)->as_array();
    const auto number = [&](std::size_t i) {
        return list != nullptr && list->size() == 2 ? list->get(i)->value<double>() : std::nullopt;
    };
    section.refuseIf(!number(0) || !number(1) || !(*number(0) < *number(1)) || std::abs(*number(0)) > furthest ||
                         std::abs(*number(1)) > furthest,
                     key, "expected [low, high], two numbers, the lower one first");
    axis.low = *number(0);
    axis.high = *number(1);
    section.refuseIf(axis.log && axis.low <= 0, key, "a logarithmic range must be above 0");
    if (axis.whole) {
        axis.low = std::ceil(axis.low);
        axis.high = std::floor(axis.high);
        section.refuseIf(axis.low > axis.high, key, "there is no whole number in it");
    }
}

void readSteps(Section& section, DesignKind design, Axis& axis)
{
    const auto steps = section.integer("steps", "", 2, maxSteps);
    const bool isGrid = design == DesignKind::grid;
    section.missingIf(!steps && isGrid, "steps", "how many values of the range a grid has");
    section.refuseIf(steps && !isGrid, "steps", "only a grid has them: leave it out");
    axis.steps = static_cast<std::size_t>(steps.value_or(0));
    for (std::size_t i = 1; axis.whole && i < axis.steps; ++i) {
        const KeyValue level = axis.level(i);
        section.refuseIf(level == axis.level(i - 1), "steps",
                         fmt::format("two of them would be the whole number {}: take fewer", toText(level)));
    }
}

void readValues(Section& section, DesignKind design, Axis& axis)
{
    const toml::array* const list = section.node("values")->as_array();
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i) {
        axis.values.push_back(valueOf(section, "values", *list->get(i)));
    }
    section.refuseIf(axis.values.empty(), "values", "expected a list of values");
    const auto isNumber = [](const KeyValue& value) { return numberOf(value).has_value(); };
    section.refuseIf(std::ranges::any_of(axis.values, isNumber) && !std::ranges::all_of(axis.values, isNumber), "values",
                     "numbers and words in one list: give an axis only numbers or only words");
    // A list has its rows as points, and samples may be drawn from one value more often.
    for (auto value = axis.values.begin(); design == DesignKind::grid && value != axis.values.end(); ++value) {
        section.refuseIf(std::find(axis.values.begin(), value, *value) != value, "values",
                         fmt::format("{} is there twice: its points would be there twice too; repeats = N runs each point "
                                     "N times",
                                     toText(*value)));
    }
}

Axis readAxis(Section& section, DesignKind design)
{
    Axis axis;
    axis.key = section.word("key").value_or("");
    axis.name = section.word("name").value_or(columnOf(axis.key));
    section.missingIf(axis.name.empty(), "key",
                      "what varies, such as \"tissue.fat.youngs_kpa\"; or name, for formulas alone");
    section.refuseIf(!isVariable(axis.name), "name", "must be letters, digits and _, and begin with a letter");
    const int ways = (section.has("values") ? 1 : 0) + (section.has("range") ? 1 : 0) + (section.has("log_range") ? 1 : 0);
    section.missingIf(ways != 1, "values", "one of values = [..], range = [low, high], log_range = [low, high]");
    if (section.has("values")) {
        readValues(section, design, axis);
    } else {
        axis.log = section.has("log_range");
        axis.whole = section.flag("whole").value_or(false);
        readRange(section, axis.log ? "log_range" : "range", axis);
        readSteps(section, design, axis);
    }
    section.finish();
    return axis;
}

// Leaves of nested tables: a."b.c" and a.b.c alike.
void flatten(Section& section, std::string_view key, const toml::table& table, const std::string& path,
             std::vector<Setting>& out)
{
    for (const auto& [k, node] : table) {
        const std::string here = path.empty() ? std::string(k.str()) : fmt::format("{}.{}", path, k.str());
        if (const toml::table* inner = node.as_table()) {
            flatten(section, key, *inner, here, out);
        } else {
            out.push_back({here, valueOf(section, key, node)});
        }
    }
}

std::vector<Setting> readSettings(Section& top, std::string_view key)
{
    std::vector<Setting> out;
    if (const toml::node* node = top.node(key)) {
        top.refuseIf(!node->is_table(), key, "expected a table of keys and values");
        flatten(top, key, *node->as_table(), "", out);
    }
    return out;
}

datasets::Scene readScene(Section& top, const std::filesystem::path& origin, SceneSource baseScene)
{
    const auto scene = top.word("scene");
    top.missingIf(!scene, "scene", "a built-in scene, a scene file or a volume");
    return baseScene(*scene, origin);
}

void readDesign(Section& top, SweepPlan& plan)
{
    auto section = top.section("design");
    if (!section) {
        return;
    }
    if (const auto kind = section->choice("kind", designNames)) {
        plan.design = static_cast<DesignKind>(*kind);
    }
    const auto samples = section->integer("samples", "", 1, maxSamples);
    const bool isList = plan.design == DesignKind::list;
    if ((plan.design == DesignKind::grid || isList) == samples.has_value()) {
        const char* const none = isList ? "a list has none: leave it out" : "a grid has none: leave it out";
        section->missing("samples", samples ? none : "how many");
    }
    plan.samples = static_cast<std::size_t>(samples.value_or(0));
    section->finish();
}

void readSlurm(Section& top, SlurmSettings& slurm)
{
    if (auto section = top.section("slurm")) {
        slurm.partition = section->word("partition").value_or("");
        slurm.time = section->word("time").value_or("");
        slurm.account = section->word("account").value_or("");
        slurm.memory = section->word("memory").value_or("");
        slurm.options = section->words("options");
        slurm.chunk = section->integer("chunk", "", 1, maxCases).value_or(0);
        section->finish();
    }
}

void readMarks(Section& top, SweepPlan& plan)
{
    for (Section& section : top.sections("mark")) {
        OutputMark mark;
        mark.output = section.word("output").value_or("");
        const auto at = section.number("at", "", -furthest, furthest);
        section.missingIf(mark.output.empty() || !at, at ? "output" : "at", "a mark has output, at and label");
        mark.at = *at;
        mark.label = section.word("label").value_or(fmt::format("{:g}", mark.at));
        section.finish();
        const bool known = std::ranges::any_of(plan.outputs, [&](const auto& o) { return o.name == mark.output; });
        section.refuseIf(!known, "output", "is none of the plan's outputs");
        plan.marks.push_back(std::move(mark));
    }
}

// The kind of procedure that all cases share: which outputs there are follows from it.
ProcedureKind kindOf(const std::vector<Setting>& settings, Section& top)
{
    for (const Setting& s : settings) {
        if (s.key == "procedure.kind") {
            const auto* const name = std::get_if<std::string>(&s.value);
            const auto* const at =
                name != nullptr ? std::find(procedureNames.begin(), procedureNames.end(), *name) : procedureNames.end();
            if (at != procedureNames.end()) {
                return static_cast<ProcedureKind>(at - procedureNames.begin());
            }
            top.refuse("procedure", fmt::format("kind must be one of {}", fmt::join(procedureNames, ", ")));
        }
    }
    return ProcedureKind::session;
}

// With a reference, each output of the procedure has two more columns. They follow those that the plan lists.
void addComparisons(ProcedureKind kind, SweepPlan& plan)
{
    const std::vector<SweepOutput> listed = plan.reference.empty() ? std::vector<SweepOutput>() : plan.outputs;
    const auto infos = outputsOf(kind);
    for (const SweepOutput& output : listed) {
        const auto info = std::ranges::find(infos, output.name, &OutputInfo::name);
        if (info == infos.end() || !output.formula.empty()) {
            continue;
        }
        for (const std::string& name : namesOf(*info, true)) {
            if (std::ranges::find(listed, name, &SweepOutput::name) == listed.end()) {
                plan.outputs.push_back({name, {}});
            }
        }
    }
}

void readOutputs(Section& top, ProcedureKind kind, SweepPlan& plan)
{
    std::set<std::string> there;
    for (const OutputInfo& o : outputsOf(kind)) {
        for (std::string& name : namesOf(o, !plan.reference.empty())) {
            there.insert(std::move(name));
        }
    }
    auto words = top.words("outputs");
    if (words.empty()) {
        std::ranges::transform(outputsOf(kind), std::back_inserter(words), &OutputInfo::name);
    }
    for (const std::string& word : words) {
        const auto equals = word.find('=');
        SweepOutput output{
            word.substr(0, word.find_last_not_of(' ', equals == std::string::npos ? equals : equals - 1) + 1), {}};
        if (equals != std::string::npos) {
            output.formula = word.substr(equals + 1);
            top.refuseIf(base::trimmed(output.formula).empty(), "outputs",
                         fmt::format("'{}': there is no formula after the =", word));
        } else if (!there.contains(output.name)) {
            top.refuse("outputs", fmt::format("there is no {}; there are {}", output.name, fmt::join(there, ", ")));
        }
        top.refuseIf(!isVariable(output.name), "outputs",
                     fmt::format("'{}': a name must be letters, digits and _, and begin with a letter", output.name));
        plan.outputs.push_back(std::move(output));
    }
    addComparisons(kind, plan);
}

void checkCases(double points, const SweepPlan& plan, Section& top)
{
    const double cases = points * static_cast<double>(plan.repeats);
    top.refuseIf(cases > static_cast<double>(maxCases), "repeats",
                 fmt::format("{:.0f} cases: {} at most", cases, maxCases));
}

// So many points take memory and time; `points` may be more than a std::size_t holds.
void checkCount(double points, const SweepPlan& plan, Section& top)
{
    const bool isGrid = plan.design == DesignKind::grid;
    top.refuseIf(points > static_cast<double>(maxCases), isGrid ? "axis" : "design",
                 fmt::format("{} of {:.0f} points: {} at most; take {}", isGrid ? "a grid" : "a design", points, maxCases,
                             isGrid ? "samples instead" : "fewer samples"));
    if (plan.constraints.empty()) {
        checkCases(points, plan, top);
    }
}

// Before there are any, and before constraints.
double countOf(const SweepPlan& plan)
{
    const auto samples = static_cast<double>(plan.samples), axes = static_cast<double>(plan.axes.size());
    switch (plan.design) {
        case DesignKind::latinHypercube:
        case DesignKind::sobol:
            return samples;
        case DesignKind::saltelli:
            return samples * (axes + 2);
        case DesignKind::morris:
            return samples * (axes + 1);
        case DesignKind::list:
            return static_cast<double>(plan.axes.front().values.size());
        case DesignKind::grid:
            break;
    }
    double count = 1;
    for (const Axis& a : plan.axes) {
        count *= static_cast<double>(a.levels());
    }
    return count;
}

UnitPoints gridPoints(const std::vector<Axis>& axes, std::size_t count)
{
    UnitPoints points(count, std::vector<double>(axes.size()));
    for (std::size_t i = 0; i < points.size(); ++i) {
        std::size_t rest = i;
        for (std::size_t a = axes.size(); a-- > 0;) {
            points[i][a] = static_cast<double>(rest % axes[a].levels());
            rest /= axes[a].levels();
        }
    }
    return points;
}

// Point i has value i of every axis.
UnitPoints listPoints(const std::vector<Axis>& axes, Section& top)
{
    const std::size_t count = axes.front().values.size();
    for (const Axis& a : axes) {
        top.refuseIf(a.values.empty() || a.values.size() != count, "axis",
                     fmt::format("'{}' has {} values and '{}' has {}: in a list every axis has one for each point",
                                 axes.front().name, count, a.name, a.values.size()));
    }
    UnitPoints points;
    for (std::size_t i = 0; i < count; ++i) {
        points.emplace_back(axes.size(), static_cast<double>(i));
    }
    return points;
}

UnitPoints pointsOf(const SweepPlan& plan, Section& top)
{
    const double count = countOf(plan);
    checkCount(count, plan, top);
    const std::size_t columns = plan.axes.size() * (plan.design == DesignKind::saltelli ? 2 : 1);
    const bool ofSobol = plan.design == DesignKind::saltelli || plan.design == DesignKind::sobol;
    top.refuseIf(
        ofSobol && columns > maxSobolAxes, "axis",
        fmt::format("{} axes: {} at most for this design", plan.axes.size(), maxSobolAxes * plan.axes.size() / columns));
    switch (plan.design) {
        case DesignKind::latinHypercube:
            return latinHypercube(plan.samples, plan.axes.size(), plan.seed);
        case DesignKind::sobol:
            return sobolPoints(plan.samples, plan.axes.size(), plan.seed);
        case DesignKind::saltelli:
            return saltelliPoints(plan.samples, plan.axes.size(), plan.seed);
        case DesignKind::morris:
            return morrisPoints(plan.samples, plan.axes.size(), plan.seed);
        case DesignKind::list:
            return listPoints(plan.axes, top);
        case DesignKind::grid:
            break;
    }
    return gridPoints(plan.axes, static_cast<std::size_t>(count));
}

// "depth_mm = 3, d = 10".
std::string namedPoint(const SweepPlan& plan, const SweepCase& c)
{
    const auto out = base::mapped<std::string>(std::views::iota(0UL, plan.axes.size()), [&](std::size_t a) {
        return fmt::format("{} = {}", plan.axes[a].name, toText(c.parameters[a]));
    });
    return fmt::format("{}", fmt::join(out, ", "));
}

bool holds(const std::string& constraint, const SweepPlan& plan, const SweepCase& c)
{
    const double value = evaluate(constraint, c.variables);
    if (!std::isfinite(value)) {
        throw base::error("formula '{}' gives no finite number at {}", constraint, namedPoint(plan, c));
    }
    return value != 0;
}

void applyConstraints(SweepPlan& plan, Section& top)
{
    if (plan.constraints.empty()) {
        return;
    }
    top.refuseIf(plan.design == DesignKind::saltelli || plan.design == DesignKind::morris, "constraints",
                 "a design for sensitivity is whole or none: leave them out, or choose sobol");
    UnitPoints kept;
    const UnitPoints all = std::move(plan.points);
    for (const auto& point : all) {
        plan.points = {point};
        SweepCase c = sweepPoint(plan, 0);
        c.variables.erase("point");  // no point has its number yet, nor what follows from it
        c.variables.erase("repeat");
        c.variables.erase("seed");
        try {
            const bool meets =
                std::ranges::all_of(plan.constraints, [&](const auto& formula) { return holds(formula, plan, c); });
            if (meets) {
                kept.push_back(point);
            }
        } catch (const std::runtime_error& e) {
            top.refuse("constraints", e.what());
        }
    }
    plan.points = std::move(kept);
    top.refuseIf(plan.points.empty(), "constraints", "no point is left");
    checkCases(static_cast<double>(plan.points.size()), plan, top);
}

}  // namespace

SweepPlan parsePlan(const std::string& text, const std::filesystem::path& origin, SceneSource baseScene, bool probed)
{
    const toml::table root = datasets::parseToml(text, origin.string());
    Section top(root, origin.string(), "");
    SweepPlan plan;
    plan.text = text;
    plan.name = top.word("name").value_or(origin.stem().string());
    plan.about = top.word("about").value_or("");
    plan.base = readScene(top, origin, baseScene);
    plan.seed =
        static_cast<std::uint64_t>(top.integer("seed", "", 0, std::numeric_limits<std::int64_t>::max()).value_or(1));
    plan.repeats = static_cast<std::size_t>(top.integer("repeats", "", 1, maxSamples).value_or(1));
    plan.commonSeeds = top.flag("common_seeds").value_or(false);
    plan.records = top.flag("records").value_or(false);
    plan.caseLimit = top.number("case_limit_s", "s", 0.001, 1e7).value_or(3600.0);
    readDesign(top, plan);
    plan.axes = base::mapped<Axis>(top.sections("axis"), [&](Section& section) { return readAxis(section, plan.design); });
    top.missingIf(plan.axes.empty(), "[[axis]]", "what varies");
    plan.settings = readSettings(top, "set");
    plan.reference = readSettings(top, "reference");
    auto procedure = readSettings(top, "procedure");
    for (Setting& s : procedure) {
        s.key = "procedure." + s.key;
    }
    const ProcedureKind kind = kindOf(procedure, top);
    plan.settings.insert(plan.settings.begin(), procedure.begin(), procedure.end());
    plan.constraints = top.words("constraints");
    readOutputs(top, kind, plan);
    readMarks(top, plan);
    readSlurm(top, plan.slurm);
    top.finish();
    checkColumns(top, plan);
    checkVariables(top, plan, kind);
    checkKeys(top, plan);
    plan.points = pointsOf(plan, top);
    applyConstraints(plan, top);
    if (probed) {
        probeCases(plan, origin.string());
        probeOutputs(plan, origin.string());
    }
    return plan;
}

datasets::Scene sceneOfPlan(const std::string& text, const std::filesystem::path& origin, SceneSource baseScene)
{
    const toml::table root = datasets::parseToml(text, origin.string());
    Section top(root, origin.string(), "");
    return readScene(top, origin, baseScene);
}

datasets::Scene namedScene(const std::string& what, const std::filesystem::path& origin)
{
    if (auto scene = datasets::builtInScene(what)) {
        return *scene;
    }
    const std::filesystem::path path = origin.parent_path() / what;
    if (path.extension() == ".vdb") {
        const auto file = std::filesystem::absolute(path).lexically_normal();
        return datasets::sceneForVolume(file, volume::Tissue::load(file));
    }
    if (!std::filesystem::exists(path)) {
        throw base::error("{}: scene = \"{}\": no such file; built-in scenes are: {}", origin.string(), what,
                          fmt::join(datasets::builtInScenes(), ", "));
    }
    return datasets::loadScene(path);
}

std::vector<std::string> builtInPlans()
{
    return {"palpation", "guidance", "needle-force", "voxel-size", "model-ladder"};
}

std::string_view builtInPlan(const std::string& name)
{
    return datasets::embeddedFile("sweeps/" + name + ".toml");
}

}  // namespace palpate::sweep
