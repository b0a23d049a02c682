#include <studies/accuracy/figures.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/split.h>
#include <studies/kernel/figures.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <utility>

namespace palpate::studies {

using nlohmann::json;

namespace {

constexpr double shortest = 20.0, longest = 10'000.0;  // where level elastic shall be on the front [us]

constexpr std::array columns{"scene",          "law",           "method",   "setting",       "us_per_update", "tick_us_p50",
                             "tick_us_p99",    "near_pct",      "rms_pct",  "max_pct",       "force_pct",     "volume_pct",
                             "press_near_pct", "drag_near_pct", "on_front", "build_seconds", "failure"};

json lookFigures(std::span<const TrialErrors> looks, bool hasForce)
{
    json out = errorFigures(looks);
    if (!hasForce) {
        out["force_pct"] = out["force_worst_pct"] = nullptr;
    }
    out.erase("energy_pct");
    out.erase("energy_worst_pct");
    return out;
}

// Of the press, and of what comes after it: turn, drag and rest.
void addParts(json& out, std::span<const TrialErrors> looks, bool hasForce)
{
    std::vector<TrialErrors> press, drag;
    for (const TrialErrors& e : looks) {
        (e.phase == TrialPhase::press ? press : drag).push_back(e);
    }
    out["press"] = lookFigures(press, hasForce);
    out["drag"] = lookFigures(drag, hasForce);
}

double numberAt(const json& entry, const char* key)
{
    const auto found = entry.find(key);
    return found != entry.end() && found->is_number() ? found->get<double>() : std::numeric_limits<double>::quiet_NaN();
}

// What solves nothing is no rival: it takes no time, and so would always be on the front.
bool competes(const json& entry)
{
    const std::string method = entry.at("method");
    return method != "nothing" && method != "spring" && entry.contains("near_pct");
}

// Entries of each scene and law, in the order in which they come.
std::vector<std::vector<json*>> groups(json& chart)
{
    std::vector<std::vector<json*>> out;
    for (json& entry : chart) {
        const auto same = [&](const std::vector<json*>& g) {
            return g.front()->at("scene") == entry.at("scene") && g.front()->at("law") == entry.at("law");
        };
        auto found = std::ranges::find_if(out, same);
        if (found == out.end()) {
            found = out.insert(out.end(), std::vector<json*>{});
        }
        found->push_back(&entry);
    }
    return out;
}

std::string cell(const json& entry, const char* key, int digits)
{
    const double v = numberAt(entry, key);
    return std::isnan(v) ? "-" : fmt::format("{:.{}f}", v, digits);
}

void printRow(const json& e)
{
    fmt::print("  {:>9} {:>8} {:>8} {:>8} {:>8}  {} {}\n", cell(e, "us_per_update", 1), cell(e, "near_pct", 2),
               cell(e, "rms_pct", 2), cell(e, "force_pct", 1), cell(e, "volume_pct", 2), e.at("method").get<std::string>(),
               e.at("setting").get<std::string>());
}

// Ours that are not on the front, each with the fastest point that is no worse and takes no longer.
void printBeaten(const std::vector<json*>& group)
{
    for (const json* e : group) {
        const double time = numberAt(*e, "us_per_update"), error = numberAt(*e, "near_pct");
        const bool ours = e->at("method").get<std::string>().starts_with("elastic");
        if (!ours || !competes(*e) || e->at("on_front").get<bool>() || time < shortest || time > longest) {
            continue;
        }
        const json* by = nullptr;
        for (const json* other : group) {
            const bool beats = competes(*other) && other != e && numberAt(*other, "us_per_update") <= time &&
                               numberAt(*other, "near_pct") <= error;
            by = beats && (by == nullptr || numberAt(*other, "near_pct") < numberAt(*by, "near_pct")) ? other : by;
        }
        if (by != nullptr) {
            fmt::print("  not on the front: {} {} ({:.0f} us, {:.2f} %): {} {} has {:.2f} % in {:.0f} us\n",
                       e->at("method").get<std::string>(), e->at("setting").get<std::string>(), time, error,
                       by->at("method").get<std::string>(), by->at("setting").get<std::string>(), numberAt(*by, "near_pct"),
                       numberAt(*by, "us_per_update"));
        }
    }
}

// Who asks for a rival looks for it, on the front or not.
void printRivals(const std::vector<json*>& group)
{
    bool first = true;
    for (const json* e : group) {
        if (!e->contains("rival") || e->contains("failure")) {
            continue;
        }
        if (std::exchange(first, false)) {
            fmt::print("  rivals that others wrote:\n");
        }
        printRow(*e);
    }
}

std::string csvCell(const json& entry, const std::string& key)
{
    const std::size_t part = key.starts_with("press_") ? 6 : key.starts_with("drag_") ? 5 : 0;
    const json& from = part > 0 ? entry.value(key.substr(0, part - 1), json::object()) : entry;
    const auto found = from.find(key.substr(part));
    const bool none = found == from.end() || found->is_null();
    return none ? "" : found->is_string() ? base::csvQuoted(found->get<std::string>()) : found->dump();
}

}  // namespace

json accuracyEntry(const std::string& scene, const std::string& law, const Baseline& method, const AccuracyRun& run,
                   const TrialResult* result)
{
    json out{{"scene", scene}, {"law", law}, {"method", method.method}, {"setting", method.setting}};
    if (result == nullptr) {
        out["failure"] = run.failure;
        return out;
    }
    out.update(lookFigures(result->looks, run.hasForce));
    addParts(out, result->looks, run.hasForce);
    out["us_per_update"] = 1e6 * result->cpu;
    out["tick_us_mean"] = 1e6 * result->mean;
    out["tick_us_p50"] = 1e6 * result->p50;
    out["tick_us_p99"] = 1e6 * result->p99;
    out["ticks"] = result->ticks;
    out["touched"] = result->meanTouched;
    out["build_seconds"] = run.buildSeconds;
    return out;
}

json floorEntry(const std::string& scene, const std::string& law, std::span<const TrialErrors> looks)
{
    json out = lookFigures(looks, true);
    addParts(out, looks, true);
    out["scene"] = scene;
    out["law"] = law;
    return out;
}

json referenceEntry(const ReferenceInfo& info)
{
    return {{"scene", info.scene},       {"law", info.law},   {"tool", info.tool},         {"speed_mm_s", 1e3 * info.speed},
            {"elements", info.elements}, {"tets", info.tets}, {"unknowns", info.unknowns}, {"seconds", info.seconds},
            {"program", info.program},   {"key", info.key}};
}

void markFronts(json& figures)
{
    for (const auto& group : groups(figures.at("chart"))) {
        std::vector<AccuracyPoint> points;
        for (json* entry : group) {
            (*entry)["on_front"] = false;
            points.push_back({numberAt(*entry, "us_per_update"),
                              competes(*entry) ? numberAt(*entry, "near_pct") : std::numeric_limits<double>::quiet_NaN()});
        }
        for (const std::size_t i : paretoFront(points)) {
            (*group[i])["on_front"] = true;
        }
    }
}

void printAccuracy(const json& figures)
{
    json chart = figures.at("chart");
    for (auto& group : groups(chart)) {
        fmt::print("\n{}, {} reference: the front (errors in % of the largest displacement, of the force, of the volume)\n",
                   group.front()->at("scene").get<std::string>(), group.front()->at("law").get<std::string>());
        fmt::print("  {:>9} {:>8} {:>8} {:>8} {:>8}\n", "us", "near", "rms", "force", "volume");
        std::ranges::stable_sort(
            group, {}, [](const json* e) { return e->value("us_per_update", std::numeric_limits<double>::infinity()); });
        for (const json* e : group) {
            if (!competes(*e) && !e->contains("failure")) {
                printRow(*e);
            } else if (e->at("on_front").get<bool>()) {
                printRow(*e);
            }
        }
        for (const json& f : figures.at("floors")) {
            if (f.at("scene") == group.front()->at("scene") && f.at("law") == group.front()->at("law")) {
                fmt::print("  the linear law itself is {} % off\n", cell(f, "near_pct", 2));
            }
        }
        printRivals(group);
        printBeaten(group);
        for (const json* e : group) {
            if (e->contains("failure")) {
                fmt::print("  no figures: {} {}: {}\n", e->at("method").get<std::string>(),
                           e->at("setting").get<std::string>(), e->at("failure").get<std::string>());
            }
        }
    }
}

std::string accuracyCsv(const json& figures)
{
    std::string out = fmt::format("{}\n", fmt::join(columns, ","));
    for (const json& entry : figures.at("chart")) {
        const auto cells = base::mapped<std::string>(columns, [&](const char* key) { return csvCell(entry, key); });
        out += fmt::format("{}\n", fmt::join(cells, ","));
    }
    return out;
}

AccuracyLog::AccuracyLog(std::filesystem::path file, std::string build) : file_(std::move(file)), build_(std::move(build))
{
    if (file_.empty() || !std::filesystem::exists(file_)) {
        return;
    }
    std::ifstream in(file_);
    base::failIf(!in, "{}: cannot be read: check its permissions", file_.native());
    for (std::string line; std::getline(in, line);) {
        json parsed = json::parse(line, nullptr, false);
        const bool whole = parsed.is_object() && parsed.value("build", json()).is_string() &&
                           parsed.value("reference", json()).is_string() && parsed.value("entry", json()).is_object();
        if (whole && parsed["build"] == build_) {
            lines_.push_back(std::move(parsed));
        }
    }
}

const json* AccuracyLog::find(const std::string& reference, const std::string& method, const std::string& setting) const
{
    // From the end: what was run again counts as it was the last time.
    const auto found = std::find_if(lines_.rbegin(), lines_.rend(), [&](const json& line) {
        const json& entry = line["entry"];
        return line["reference"] == reference && entry.value("method", json()) == method &&
               entry.value("setting", json()) == setting;
    });
    return found != lines_.rend() ? &(*found)["entry"] : nullptr;
}

void AccuracyLog::add(const std::string& reference, const json& entry)
{
    lines_.push_back({{"build", build_}, {"reference", reference}, {"entry", entry}});
    if (file_.empty()) {
        return;
    }
    // A line that was cut short ends here, so that this one stands alone.
    std::ofstream out(file_, std::ios::app);
    std::ifstream before(file_, std::ios::binary | std::ios::ate);
    bool ended = true;
    if (before.tellg() > 0) {
        before.seekg(-1, std::ios::end);
        ended = before.get() == '\n';
    }
    out << (ended ? "" : "\n") << lines_.back().dump(-1, ' ', false, json::error_handler_t::replace) << std::endl;
    base::failIf(!out, "{}: cannot be written: check the folder and the space on the disk", file_.native());
}

}  // namespace palpate::studies
