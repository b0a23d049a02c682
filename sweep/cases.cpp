#include <sweep/plan.h>

#include <base/error.h>
#include <base/split.h>
#include <datasets/scene_text.h>
#include <datasets/toml_fields.h>
#include <haptics/trainee.h>
#include <sweep/formula.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <span>
#include <sstream>
#include <stdexcept>

namespace palpate::sweep {

using datasets::Section;

namespace {

constexpr double wholeLimit = 0x1p53;

constexpr std::array<datasets::Field<Procedure>, 6> procedureFields{{
    {"depth_mm", "mm", 0.1, 200, 1e-3, &Procedure::depth},
    {"speed_mm_s", "mm/s", 0.1, 2000, 1e-3, &Procedure::speed},
    {"hold_ms", "ms", 1, 60000, 1e-3, &Procedure::hold},
    {"aside_mm", "mm", -500, 500, 1e-3, &Procedure::aside},
    {"delay_ms", "ms", 0, 100, 1e-3, &Procedure::delay},
    {"seconds", "s", 0.01, 3600, 1, &Procedure::seconds},
}};

// A number as TOML wants it: keys of whole numbers take no fraction.
void insertValue(toml::table& table, std::string_view key, const KeyValue& value)
{
    std::visit(
        [&](const auto& v) {
            if constexpr (std::is_same_v<std::decay_t<decltype(v)>, double>) {
                if (std::floor(v) == v && std::abs(v) < wholeLimit) {
                    table.insert_or_assign(key, static_cast<std::int64_t>(v));
                    return;
                }
            }
            table.insert_or_assign(key, v);
        },
        value);
}

// The element of a list that a part of a key names: by its own name, or by its number.
toml::table& elementOf(toml::array& list, std::string_view part, const std::string& key)
{
    std::vector<std::string> names;
    const auto number = base::numberIn<std::size_t>(part);
    for (std::size_t i = 0; i < list.size(); ++i) {
        toml::table& table = *list[i].as_table();
        const auto name = table["name"].value<std::string>();
        names.push_back(name.value_or(std::to_string(i)));
        if (name == part || (!name && i == number)) {
            return table;
        }
    }
    throw base::error("key '{}': there is no {}; there are: {}", key, part, fmt::join(names, ", "));
}

// 3: no axis.
std::size_t axisOf(std::string_view part)
{
    return part == "x" ? 0 : part == "y" ? 1 : part == "z" ? 2 : 3;
}

void setCoordinate(toml::array& point, std::string_view part, const std::string& key, const KeyValue& value)
{
    const std::size_t axis = axisOf(part);
    const auto number = numberOf(value);
    base::failIf(axis == 3 || point.size() != 3 || !number, "key '{}': a point has x, y and z, numbers in mm", key);
    point.replace(point.cbegin() + static_cast<std::ptrdiff_t>(axis), *number);
}

// Points that the scene left open, and which coordinates of them were set.
using NewPoints = std::map<std::string, std::set<std::string>>;

std::string pointOf(const std::string& key)
{
    return key.substr(0, key.rfind('.'));
}

void setKey(toml::table& root, const std::string& key, const KeyValue& value, NewPoints& points)
{
    if (key == "model.setting") {
        // The three keys that a setting gives: written out, they would win over it.
        for (const char* const given : {"spacing_mm", "window", "cycles"}) {
            root["model"]["elastic"].as_table()->erase(given);
        }
    }
    toml::table* table = &root;
    const auto parts = base::splitAt('.', key);
    base::failIf(std::ranges::find(parts, "") != parts.end(), "key '{}': has an empty part", key);
    for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
        toml::node* next = table->get(parts[i]);
        base::failIf(next == nullptr && (parts[i] == "insert" || parts[i] == "vital" || parts[i] == "script"),
                     "key '{}': the scene has no [[{}]]", key, parts[i]);
        if (next == nullptr && i + 2 == parts.size() && axisOf(parts.back()) < 3) {
            next = table->insert(parts[i], toml::array(0.0, 0.0, 0.0)).first->second.as_array();
            points.try_emplace(pointOf(key));
        }
        if (next == nullptr) {
            table = table->insert(parts[i], toml::table()).first->second.as_table();
        } else if (next->is_table()) {
            table = next->as_table();
        } else if (next->is_array_of_tables() && i + 2 < parts.size()) {
            table = &elementOf(*next->as_array(), parts[i + 1], key);
            ++i;
        } else if (next->is_array() && !next->is_array_of_tables() && i + 2 == parts.size()) {
            setCoordinate(*next->as_array(), parts[i + 1], key, value);
            if (const auto open = points.find(pointOf(key)); open != points.end()) {
                open->second.emplace(parts[i + 1]);
            }
            return;
        } else {
            throw base::error("key '{}': {} has no keys in it", key, parts[i]);
        }
    }
    insertValue(*table, parts.back(), value);
}

// A setting of the model first: keys of the same level win over it, in whichever order they stand.
void apply(toml::table& root, const std::vector<Setting>& settings, const std::map<std::string, double>& variables)
{
    NewPoints points;
    for (const bool model : {true, false}) {
        for (const Setting& s : settings) {
            const auto* const text = std::get_if<std::string>(&s.value);
            if ((s.key == "model.setting") != model) {
                continue;
            }
            if (text != nullptr && text->starts_with('=')) {
                setKey(root, s.key, evaluate(text->substr(1), variables), points);
            } else {
                setKey(root, s.key, s.value, points);
            }
        }
    }
    for (const auto& [point, axes] : points) {
        base::failIf(axes.size() != 3, "key '{}': the scene leaves this point open: set its x, y and z", point);
    }
}

constexpr std::array<std::string_view, 4> sessionKeys{"trainee", "seed", "delay_ms", "seconds"};
constexpr std::array<std::string_view, 4> pressKeys{"depth_mm", "speed_mm_s", "hold_ms", "aside_mm"};
constexpr std::array<std::string_view, 3> needleKeys{"depth_mm", "speed_mm_s", "hold_ms"};

std::span<const std::string_view> keysOf(ProcedureKind kind)
{
    const std::array<std::span<const std::string_view>, 3> keys{sessionKeys, pressKeys, needleKeys};
    return keys[static_cast<std::size_t>(kind)];
}

// Refuses keys that only another kind of procedure has: they would do nothing.
void checkKind(const Section& section, ProcedureKind kind)
{
    const auto keys = keysOf(kind);
    for (const std::string& key : section.keys()) {
        section.refuseIf(key != "kind" && std::ranges::find(keys, key) == keys.end(), key,
                         fmt::format("a procedure of kind {} has the keys {}",
                                     procedureNames[static_cast<std::size_t>(kind)], fmt::join(keys, ", ")));
    }
}

Procedure readProcedure(toml::table& root)
{
    Procedure procedure;
    Section top(root, "", "");
    if (auto section = top.section("procedure")) {
        if (const auto kind = section->choice("kind", procedureNames)) {
            procedure.kind = static_cast<ProcedureKind>(*kind);
        }
        datasets::readFields<Procedure>(*section, procedureFields, procedure, datasets::Need::some);
        const auto names = haptics::skillNames();
        std::vector<std::string_view> skills(names.begin(), names.end());
        skills.emplace_back("script");
        if (const auto skill = section->choice("trainee", skills)) {
            procedure.trainee = *skill < names.size() ? names[*skill] : "";
        }
        if (const auto seed = section->integer("seed", "", 0, std::numeric_limits<std::int64_t>::max())) {
            procedure.seed = static_cast<std::uint64_t>(*seed);
        }
        section->finish();
        checkKind(*section, procedure.kind);
    }
    root.erase("procedure");
    return procedure;
}

// The scene, and the procedure: a plain one where there is none.
std::pair<datasets::Scene, Procedure> readCase(toml::table root)
{
    try {
        const Procedure procedure = readProcedure(root);
        std::ostringstream text;
        text << root << '\n';
        auto scene = datasets::parseScene(text.str(), "");
        return {std::move(scene), procedure};
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(withoutPlace(e.what()));
    }
}

std::size_t indexAt(const Axis& axis, double unit)
{
    const std::size_t count = axis.values.size();
    return std::min(static_cast<std::size_t>(unit * static_cast<double>(count)), count - 1);
}

KeyValue inRange(const Axis& axis, double unit)
{
    const double value =
        axis.log ? axis.low * std::pow(axis.high / axis.low, unit) : axis.low + unit * (axis.high - axis.low);
    return axis.whole ? KeyValue(static_cast<std::int64_t>(std::llround(value))) : value;
}

}  // namespace

std::string withoutPlace(const std::string& error)
{
    const auto colon = error.find(": ");
    return error.starts_with(':') && colon != std::string::npos ? error.substr(colon + 2) : error;
}

std::string columnOf(std::string key)
{
    for (char& c : key) {
        const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        c = plain ? c : '_';
    }
    return key;
}

std::string toText(const KeyValue& value)
{
    return std::visit(
        [](const auto& v) -> std::string {
            if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::string>) {
                return v;
            } else {
                return fmt::format("{}", v);
            }
        },
        value);
}

std::optional<double> numberOf(const KeyValue& value)
{
    if (const auto* const whole = std::get_if<std::int64_t>(&value)) {
        return static_cast<double>(*whole);
    }
    const auto* const number = std::get_if<double>(&value);
    return number != nullptr ? std::optional(*number) : std::nullopt;
}

KeyValue Axis::at(double unit) const
{
    if (!values.empty()) {
        return values[indexAt(*this, unit)];
    }
    if (whole && !log) {
        // Rounding would give the ends half the share of the others.
        return static_cast<std::int64_t>(std::min(high, low + std::floor(unit * (high - low + 1))));
    }
    return inRange(*this, unit);
}

KeyValue Axis::level(std::size_t index) const
{
    if (!values.empty()) {
        return values[index];
    }
    return index + 1 == steps ? inRange(*this, 1.0)
                              : inRange(*this, static_cast<double>(index) / static_cast<double>(steps - 1));
}

double Axis::placeAt(double unit) const
{
    if (!values.empty()) {
        const auto last = static_cast<double>(values.size() - 1);
        return last > 0 ? static_cast<double>(indexAt(*this, unit)) / last : 0.0;
    }
    if (!whole) {
        return unit;
    }
    if (low >= high) {
        return 0.0;
    }
    const double value = *numberOf(at(unit));
    const double place = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
    return std::clamp(place, 0.0, 1.0);
}

std::string Axis::variableOf(const KeyValue& word) const
{
    return name + "_" + columnOf(toText(word));
}

SweepCase sweepPoint(const SweepPlan& plan, std::size_t index)
{
    SweepCase c;
    c.index = index;
    c.point = index / plan.repeats;
    c.repeat = index % plan.repeats;
    c.seed = mixedSeed({plan.seed, plan.commonSeeds ? 0 : c.point + 1, c.repeat}) >> 11U;
    c.variables = {{"seed", static_cast<double>(c.seed)},
                   {"repeat", static_cast<double>(c.repeat)},
                   {"point", static_cast<double>(c.point)}};
    for (std::size_t a = 0; a < plan.axes.size(); ++a) {
        const double x = plan.points[c.point][a];
        const Axis& axis = plan.axes[a];
        const bool byNumber = plan.design == DesignKind::grid || plan.design == DesignKind::list;
        c.parameters.push_back(byNumber ? axis.level(static_cast<std::size_t>(x)) : axis.at(x));
        if (const auto number = numberOf(c.parameters.back())) {
            c.variables[axis.name] = *number;
        } else {
            for (const KeyValue& value : axis.values) {
                c.variables[axis.variableOf(value)] = value == c.parameters.back() ? 1 : 0;
            }
        }
    }
    return c;
}

datasets::Scene sceneWith(const datasets::Scene& scene, const std::vector<Setting>& settings)
{
    toml::table root = datasets::parseToml(datasets::sceneText(scene), "");
    apply(root, settings, {});
    try {
        std::ostringstream text;
        text << root << '\n';
        return datasets::parseScene(text.str(), "");
    } catch (const std::runtime_error& e) {
        throw std::runtime_error(withoutPlace(e.what()));
    }
}

SweepCase sweepCase(const SweepPlan& plan, std::size_t index)
{
    SweepCase c = sweepPoint(plan, index);
    toml::table root = datasets::parseToml(datasets::sceneText(plan.base), "");
    std::vector<Setting> settings;
    for (std::size_t a = 0; a < plan.axes.size(); ++a) {
        if (!plan.axes[a].key.empty()) {
            settings.push_back({plan.axes[a].key, c.parameters[a]});
        }
    }
    settings.insert(settings.end(), plan.settings.begin(), plan.settings.end());
    apply(root, settings, c.variables);
    std::tie(c.scene, c.procedure) = readCase(root);
    if (!plan.reference.empty()) {
        apply(root, plan.reference, c.variables);
        std::tie(c.reference, c.referenceProcedure) = readCase(std::move(root));
    }
    return c;
}

}  // namespace palpate::sweep
