#include <trainer/results.h>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <stdexcept>
#include <system_error>
#include <tuple>
#include <utility>

namespace palpate::trainer {

namespace fs = std::filesystem;

namespace {

nlohmann::json parsed(const fs::path& file)
{
    std::ifstream in(file);
    return nlohmann::json::parse(in, nullptr, false);
}

// Those that tell beginners from experts (docs/score.md), and the rest on request: palpate score.
void addMeasures(const nlohmann::json& score, Result& result)
{
    constexpr std::array shown{std::tuple{"targeting_error_mm", "Targeting error", "mm", 1},
                               std::tuple{"best_target_pct", "Target in the best core", "%", 0},
                               std::tuple{"best_target_length_mm", "Length in the target", "mm", 1},
                               std::tuple{"mark_error_mm", "Error of the marks", "mm", 1},
                               std::tuple{"mark_size_error_mm", "Error of the size", "mm", 1},
                               std::tuple{"vital_margin_mm", "Nearest to a vital structure", "mm", 1},
                               std::tuple{"vital_contacts", "Touches of vital structures", "", 0},
                               std::tuple{"passes", "Cores taken", "", 0},
                               std::tuple{"skin_contacts", "Skin contacts", "", 0},
                               std::tuple{"redirects", "Redirects", "", 0},
                               std::tuple{"inserted_path_mm", "Path of the tip inside", "mm", 0},
                               std::tuple{"peak_force_n", "Largest force", "N", 2},
                               std::tuple{"seconds", "Time", "s", 1}};
    for (const auto& [key, label, unit, decimals] : shown) {
        const auto value = score.find(key);
        if (value != score.end() && value->is_number()) {
            result.measures.emplace_back(label, fmt::format("{:.{}f} {}", value->get<double>(), decimals, unit));
        }
    }
}

}  // namespace

Result readResult(const fs::path& figures)
{
    Result result;
    const auto json = parsed(figures);
    try {
        const auto& score = json.at("score");
        result.total = score.at("total").get<double>();
        for (const auto& [key, name, most] :
             {std::tuple{"core", "Core", 50.0}, {"vital", "Vital structures", 25.0}, {"technique", "Technique", 25.0}}) {
            result.parts.push_back({name, score.at("points").at(key).get<double>(), most});
        }
        for (const auto& loss : score.value("losses", nlohmann::json::array())) {
            result.losses.push_back({loss.at("points").get<double>(), loss.at("words").get<std::string>()});
        }
        addMeasures(score, result);
    } catch (const nlohmann::json::exception&) {
        result = {};
        result.problem = figures.string() + ": has no score: the session did not come to its end";
    }
    return result;
}

DeviceCheck readDevices(const fs::path& figures)
{
    DeviceCheck check;
    check.done = true;
    const auto json = parsed(figures);
    const auto falcons = json.is_object() ? json.value("falcons", nlohmann::json::array()) : nlohmann::json();
    if (!falcons.is_array()) {
        check.falcon = "The look for devices failed";
        check.remedy = "Type 'palpate devices' in a terminal to see why. The mouse works.";
        return check;
    }
    if (falcons.empty()) {
        check.falcon = "No Novint Falcon is plugged in";
        check.remedy = "To use one, plug in its cable and its power supply, and look again.";
        return check;
    }
    const auto& f = falcons.front();
    if (!f.value("allowed", false)) {
        check.falcon = "A Novint Falcon is there, but may not be opened";
        check.remedy = "Run 'sudo palpate devices --install-udev' once, and plug it in again.";
    } else if (!f.value("firmware_runs", false)) {
        check.falcon = "A Novint Falcon is there; its firmware is not loaded";
        check.remedy = "Name the firmware file of its maker below: the session loads it.";
        check.falconReady = true;
    } else {
        check.falcon = f.value("homed", false) ? "A Novint Falcon is ready" : "A Novint Falcon is there, not homed yet";
        check.remedy = f.value("homed", false) ? "" : "The session tells how to move the grip, to find its zero.";
        check.falconReady = true;
    }
    return check;
}

SessionFolder::SessionFolder(fs::path folder) : folder_(std::move(folder)) {}

SessionFiles SessionFolder::filesFor(const CaseEntry& of)
{
    std::error_code failed;
    fs::create_directories(folder_, failed);
    if (failed) {
        throw std::runtime_error(folder_.string() + ": cannot be made (" + failed.message() + ")");
    }
    const std::string stem = fmt::format("{}-{:%Y%m%d-%H%M%S}", of.id, fmt::localtime(std::time(nullptr)));
    for (int i = 0;; ++i) {
        const fs::path base = folder_ / (i == 0 ? stem : fmt::format("{}-{}", stem, i));
        const fs::path record = base.string() + ".db", figures = base.string() + ".json";
        if (!fs::exists(record) && !fs::exists(figures)) {
            return {record, figures};
        }
    }
}

std::optional<double> SessionFolder::best(const CaseEntry& of) const
{
    std::optional<double> best;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_, none)) {
        const std::string name = entry.path().filename().string();
        // A date follows the id: "layered-2" is another case than "layered".
        const bool ofCase = name.starts_with(of.id + "-") && name.size() > of.id.size() + 9 &&
                            name.find_first_not_of("0123456789", of.id.size() + 1) == of.id.size() + 9;
        if (!ofCase || entry.path().extension() != ".json") {
            continue;
        }
        if (const Result r = readResult(entry.path()); r.problem.empty()) {
            best = std::max(best.value_or(0), r.total);
        }
    }
    return best;
}

fs::path sessionsFolder()
{
    if (const char* data = std::getenv("XDG_DATA_HOME"); data != nullptr && *data != '\0') {
        return fs::path(data) / "palpate" / "sessions";
    }
    const char* home = std::getenv("HOME");
    return fs::path(home != nullptr ? home : "/tmp") / ".local" / "share" / "palpate" / "sessions";
}

}  // namespace palpate::trainer
