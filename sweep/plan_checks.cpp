#include <sweep/plan_checks.h>

#include <base/error.h>
#include <datasets/tables.h>
#include <sweep/formula.h>
#include <volume/tissue.h>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <stdexcept>
#include <vector>

namespace palpate::sweep {

using datasets::Section;

namespace {

constexpr std::size_t evenProbes = 60;    // cases whose scene is tried before a sweep begins
constexpr std::size_t valueProbes = 600;  // and those beside them that have a value of a list for the first time

std::string lowerCase(std::string name)
{
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return name;
}

void insertKey(Section& top, const char* where, const std::string& key, std::set<std::string>& keys)
{
    top.refuseIf(!key.empty() && !keys.insert(key).second, where, fmt::format("key '{}' is set twice: leave one out", key));
}

// By axis: the values that are tried one by one; of a range of a grid its ends.
std::vector<std::set<KeyValue>> valuesOf(const SweepPlan& plan)
{
    std::vector<std::set<KeyValue>> out;
    for (const Axis& a : plan.axes) {
        std::set<KeyValue>& values = out.emplace_back(a.values.begin(), a.values.end());
        if (a.values.empty() && plan.design == DesignKind::grid) {
            values = {a.level(0), a.level(a.steps - 1)};
        }
    }
    return out;
}

// The first case with each value that an axis lists.
std::set<std::size_t> casesOfValues(const SweepPlan& plan)
{
    auto values = valuesOf(plan);
    const bool byNumber = plan.design == DesignKind::grid || plan.design == DesignKind::list;
    std::set<std::size_t> cases;
    for (std::size_t p = 0; p < plan.points.size() && cases.size() < valueProbes; ++p) {
        for (std::size_t a = 0; a < plan.axes.size(); ++a) {
            const double x = plan.points[p][a];
            const Axis& axis = plan.axes[a];
            if (!values[a].empty() &&
                values[a].erase(byNumber ? axis.level(static_cast<std::size_t>(x)) : axis.at(x)) > 0) {
                cases.insert(p * plan.repeats);
            }
        }
    }
    return cases;
}

// The table that a scene changes: of its volume, of a file, or the standard one.
volume::TissueTable tableOf(const datasets::Scene& scene)
{
    return !scene.source.file.empty() ? volume::Tissue::load(scene.source.file).table()
           : scene.tissues.empty()    ? datasets::defaultTissues()
                                      : datasets::loadTissues(scene.tissues);
}

void checkTissues(const datasets::Scene& scene, std::map<std::string, volume::TissueTable>& tables)
{
    if (scene.tissueChanges.empty() && scene.tissues.empty()) {
        return;
    }
    const std::string file = scene.source.file.empty() ? scene.tissues : scene.source.file.string();
    auto at = tables.find(file);
    if (at == tables.end()) {
        at = tables.emplace(file, tableOf(scene)).first;
    }
    datasets::withChanges(at->second, scene.tissueChanges);
}

}  // namespace

std::vector<std::string> namesOf(const OutputInfo& output, bool compared)
{
    return compared ? std::vector<std::string>{output.name, "reference_" + output.name, output.name + "_change_pct"}
                    : std::vector<std::string>{output.name};
}

void checkColumns(Section& top, const SweepPlan& plan)
{
    std::set<std::string> columns{"case",  "point", "repeat",  "seed",    "status",
                                  "error", "build", "machine", "tick_us", "case_s"};
    const auto insert = [&](const char* where, const std::string& name) {
        top.refuseIf(!columns.insert(lowerCase(name)).second, where,
                     fmt::format("'{}' is a column already (letter case does not count): give it another name", name));
    };
    for (const Axis& a : plan.axes) {
        insert("axis", a.name);
    }
    for (const SweepOutput& o : plan.outputs) {
        insert("outputs", o.name);
    }
}

void checkVariables(Section& top, const SweepPlan& plan, ProcedureKind kind)
{
    std::map<std::string, std::string> owners;  // by name in formulas: whose it is
    for (const OutputInfo& o : outputsOf(kind)) {
        for (const std::string& name : namesOf(o, !plan.reference.empty())) {
            owners.emplace(name, "an output of the procedure");
        }
    }
    const auto insert = [&](const std::string& name, const std::string& owner) {
        const auto [there, isNew] = owners.emplace(name, owner);
        top.refuseIf(
            !isNew && there->second != owner, "axis",
            fmt::format("formulas would call {} and {} alike, '{}': give one another name", there->second, owner, name));
    };
    for (const Axis& a : plan.axes) {
        insert(a.name, fmt::format("axis '{}'", a.name));
    }
    for (const Axis& a : plan.axes) {
        for (const KeyValue& value : a.values) {
            if (!numberOf(value)) {
                insert(a.variableOf(value), fmt::format("the word '{}' of axis '{}'", toText(value), a.name));
            }
        }
    }
}

void checkKeys(Section& top, const SweepPlan& plan)
{
    std::set<std::string> keys, ofReference;
    for (const Setting& s : plan.settings) {
        insertKey(top, s.key.starts_with("procedure.") && top.has("procedure") ? "procedure" : "set", s.key, keys);
    }
    for (const Axis& a : plan.axes) {
        insertKey(top, "axis", a.key, keys);
    }
    for (const Setting& s : plan.reference) {
        insertKey(top, "reference", s.key, ofReference);
    }
}

void probeCases(const SweepPlan& plan, const std::string& file)
{
    std::set<std::size_t> cases = casesOfValues(plan);
    const std::size_t count = std::min(plan.cases(), evenProbes);
    for (std::size_t i = 0; i < count; ++i) {
        cases.insert(count > 1 ? i * (plan.cases() - 1) / (count - 1) : 0);
    }
    std::map<std::string, volume::TissueTable> tables;
    for (const std::size_t index : cases) {
        try {
            const SweepCase c = sweepCase(plan, index);
            checkTissues(c.scene, tables);
            if (!plan.reference.empty()) {
                checkTissues(c.reference, tables);
            }
        } catch (const std::runtime_error& e) {
            throw base::error("{}: case {}: {}", file, index, withoutPlace(e.what()));
        }
    }
}

// Formulas see all that the first case has; 1 stands for what it would measure.
void probeOutputs(const SweepPlan& plan, const std::string& file)
{
    const SweepCase first = sweepCase(plan, 0);
    std::map<std::string, double> numbers = first.variables;
    for (const OutputInfo& o : outputsOf(first.procedure.kind)) {
        for (const std::string& name : namesOf(o, !plan.reference.empty())) {
            numbers[name] = 1;
        }
    }
    for (const SweepOutput& output : plan.outputs) {
        try {
            numbers[output.name] = output.formula.empty() ? 1 : evaluate(output.formula, numbers);
        } catch (const std::runtime_error& e) {
            throw base::error("{}: outputs: {}", file, e.what());
        }
    }
}

}  // namespace palpate::sweep
