#include <trainer/results.h>

#include <base/mapped.h>
#include <base/outputs.h>
#include <base/printable.h>
#include <base/said.h>
#include <base/told_losses.h>
#include <base/user_files.h>
#include <trainer/lists.h>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <ctime>
#include <map>
#include <stdexcept>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>

namespace palpate::trainer {

namespace fs = std::filesystem;
using base::marked;
using base::said;
using base::tr;

namespace {

bool canBeWritten(const fs::path& folder)
{
    try {
        base::checkOutputFolder(folder);
        return true;
    } catch (const std::runtime_error&) {
        return false;
    }
}

// What a level asks for, and whether it was met; empty: there is none.
std::string levelInWords(const nlohmann::json& asked)
{
    const auto met = asked.find("met");
    if (met == asked.end() || !met->is_boolean()) {
        return "";
    }
    std::string words;
    if (const auto least = numberAt(asked, "at_least")) {
        words += ", " + said(tr("at least {:Lg}"), *least);
    }
    if (const auto most = numberAt(asked, "at_most")) {
        words += ", " + said(tr("at most {:Lg}"), *most);
    }
    return words + ": " + (met->get<bool>() ? tr("met") : tr("not met"));
}

std::string withUnit(double value, int decimals, const std::string& unit)
{
    return said("{:.{}Lf}{}{}", base::printable(value, decimals), decimals, unit.empty() ? "" : " ", unit);
}

// What the case is about, and the levels of the exercise. Labels of those that are shown already stay; the total, in large
// letters, is one of them.
void addAsked(const nlohmann::json& asked, const nlohmann::json& score, std::map<std::string, std::size_t>& rows,
              Result& result)
{
    for (const auto& one : asked) {
        const auto key = one.at("measure").get<std::string>();
        const std::string level = levelInWords(one);
        const auto value = numberAt(score, key.c_str());
        const bool isShown = key == "total" && level.empty();
        if (!isShown && !rows.contains(key) && (value || !level.empty())) {
            rows[key] = result.measures.size();
            const std::string unit = tr(one.at("unit").get<std::string>());
            result.measures.emplace_back(tr(one.at("label").get<std::string>()),
                                         value ? withUnit(*value, one.at("decimals").get<int>(), unit) : "-");
        }
        if (rows.contains(key)) {
            result.measures[rows[key]].second += level;
        }
    }
}

// Those that tell beginners from experts (docs/score.md), and the rest on request: palpate score.
void addMeasures(const nlohmann::json& asked, const nlohmann::json& score, const std::string& judged, Result& result)
{
    const bool noCore = judged != "core" && score.value("passes", 0.0) == 0;
    constexpr std::array shown{std::tuple{"targeting_error_mm", marked("Targeting error"), "mm", 1},
                               std::tuple{"best_target_pct", marked("Target in the best core"), "%", 0},
                               std::tuple{"best_target_length_mm", marked("Length in the target"), "mm", 1},
                               std::tuple{"mark_error_mm", marked("Error of the marks"), "mm", 1},
                               std::tuple{"mark_size_error_mm", marked("Error of the size"), "mm", 1},
                               std::tuple{"rest_s", marked("Rest on the skin"), "s", 1},
                               std::tuple{"tip_to_target_mm", marked("Tip's nearest to the target"), "mm", 1},
                               std::tuple{"vital_margin_mm", marked("Nearest to a vital structure"), "mm", 1},
                               std::tuple{"vital_contacts", marked("Touches of vital structures"), "", 0},
                               std::tuple{"passes", marked("Cores taken"), "", 0},
                               std::tuple{"skin_contacts", marked("Skin contacts"), "", 0},
                               std::tuple{"redirects", marked("Redirects"), "", 0},
                               std::tuple{"inserted_path_mm", marked("Path of the tip inside"), "mm", 0},
                               std::tuple{"peak_force_n", marked("Largest force"), "N", 2},
                               std::tuple{"seconds", marked("Time"), "s", 1}};
    std::map<std::string, std::size_t> rows;
    for (const auto& [key, label, unit, decimals] : shown) {
        const bool ofCores = std::string_view(key).starts_with("best_target") || std::string_view(key) == "passes";
        const bool ofMarks = std::string_view(key).starts_with("mark_");  // anybody may mark; elsewhere it means nothing
        if ((noCore && ofCores) || (ofMarks && judged != "marks")) {
            continue;
        }
        if (const auto value = numberAt(score, key)) {
            rows[key] = result.measures.size();
            result.measures.emplace_back(tr(label), withUnit(*value, decimals, unit));
        }
    }
    addAsked(asked, score, rows, result);
}

// What the points of `core` are for. Figures of older programs do not say it.
std::string judgedBy(const nlohmann::json& score)
{
    return score.value("judged", numberAt(score, "mark_error_mm") ? "marks" : "core");
}

// Where a session left no figures, its record may be there: also of one that was killed.
std::string whyNoScore(const fs::path& figures)
{
    const std::string record = fs::path(figures).replace_extension(".db").string();
    if (std::error_code none; fs::exists(figures, none) || !fs::exists(record, none)) {
        return figures.string() + tr(": has no score: the session did not come to its end");
    }
    return said(tr("The session was cut off. Its record is kept: '{}' shows it, and '{}' gives its score."),
                asTyped("palpate-view", {"--replay", record}), asTyped("palpate", {"score", record}));
}

std::vector<LossOfPoints> lossesIn(const nlohmann::json& score)
{
    const auto losses = score.value("losses", nlohmann::json::array());
    const auto points =
        base::mapped<double>(losses, [](const auto& loss) { return loss.at("points").template get<double>(); });
    return base::mapped<LossOfPoints>(base::toldLosses(points), [&](std::size_t i) {
        return LossOfPoints{points[i], losses[i].at("words").template get<std::string>(), numberAt(losses[i], "at_s")};
    });
}

}  // namespace

Result readResult(const fs::path& figures)
{
    Result result;
    const auto json = parsed(figures);
    try {
        const auto& score = json.at("score");
        result.total = score.at("total").get<double>();
        const std::string judged = judgedBy(score);
        for (const auto& [key, name, most] : {std::tuple{"core", base::nameOfCore(judged), 50.0},
                                              {"vital", marked("Vital structures"), 25.0},
                                              {"technique", marked("Technique"), 25.0}}) {
            result.parts.push_back({tr(name), score.at("points").at(key).get<double>(), most});
        }
        result.losses = lossesIn(score);
        addMeasures(json.value("asked", nlohmann::json::array()), score, judged, result);
        result.fault = json.value("problem", "");
        result.notKept = !json.value("kept", true);
        if (json.value("contacts", 1) == 0) {
            result = {};
            result.untouched = true;
            result.problem = tr("The tool never touched the body: this session does not count.");
        }
    } catch (const nlohmann::json::exception&) {
        result = {};
        result.problem = whyNoScore(figures);
    }
    return result;
}

bool dropErased(const SessionFiles& files, Result& result, bool ran)
{
    std::error_code failed;
    if (!result.problem.empty() || fs::exists(files.record, failed)) {
        return false;
    }
    fs::remove(files.figures, failed);
    result = {};
    result.problem =
        ran ? tr("The profile was erased while this session ran, and its record with it: nothing of it is kept.")
            : tr("The profile was erased, and the record of this session with it: nothing of it is kept.");
    return true;
}

DeviceCheck readDevices(const fs::path& figures)
{
    DeviceCheck check;
    check.done = true;
    const auto json = parsed(figures);
    const auto falcons = json.is_object() ? json.value("falcons", nlohmann::json::array()) : nlohmann::json();
    if (!falcons.is_array()) {
        check.falcon = tr("The look for devices failed");
        check.remedy = tr("Type 'palpate devices' in a terminal to see why. The mouse works.");
        return check;
    }
    if (falcons.empty()) {
        check.falcon = tr("No Novint Falcon is plugged in");
        check.remedy = tr("To use one, plug in its cable and its power supply, and look again.");
        return check;
    }
    const auto& f = falcons.front();
    const bool known = f.contains("firmware_runs") && f.at("firmware_runs").is_boolean();
    if (!f.value("allowed", false)) {
        check.falcon = tr("A Novint Falcon is there, but may not be opened");
        check.remedy = tr("Run 'sudo palpate devices --install-udev' once, and plug it in again.");
    } else if (!known) {
        const std::string why = f.value("problem", "");
        check.falcon = why.empty() ? tr("A Novint Falcon is there") : tr("A Novint Falcon is there, but cannot be asked");
        check.remedy = why.empty() ? tr("Name the firmware file of its maker below: the session loads it.") : why;
        check.falconReady = true;  // the session tries again, and says what is wrong
    } else if (!f.at("firmware_runs").get<bool>()) {
        check.falcon = tr("A Novint Falcon is there; its firmware is not loaded");
        check.remedy = tr("Name the firmware file of its maker below: the session loads it.");
        check.falconReady = true;
    } else {
        check.falcon =
            f.value("homed", false) ? tr("A Novint Falcon is ready") : tr("A Novint Falcon is there, not homed yet");
        check.remedy = f.value("homed", false) ? "" : tr("The session tells how to move the grip, to find its zero.");
        check.falconReady = true;
    }
    return check;
}

void readForceTest(const fs::path& figures, DeviceCheck& check)
{
    const auto json = parsed(figures);
    try {
        const auto& test = json.at("force_test");
        check.pushed = test.at("complete").get<bool>();
        check.push = tr(test.at("words").get<std::string>());
    } catch (const nlohmann::json::exception&) {
        check.pushed = false;
        check.push = tr("The force test could not be made. The mouse works without it.");
    }
}

SessionFolder::SessionFolder(fs::path folder) : folder_(std::move(folder)) {}

SessionFiles SessionFolder::filesFor(const CaseEntry& of)
{
    if (const std::string why = whyNoSessions(folder_); !why.empty()) {
        throw std::runtime_error(why);
    }
    base::makeFolders(folder_);
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

std::string whyNoSessions(const fs::path& folder)
{
    return canBeWritten(folder)
               ? ""
               : said(tr("{}: no session can be kept there. Start palpate-trainer with --sessions and another folder."),
                      folder.string());
}

std::string littleRoom(const fs::path& folder, std::uintmax_t least)
{
    std::error_code none;
    const auto space = fs::space(folder, none);
    constexpr double mega = 1e6;
    return none || space.available >= least || !canBeWritten(folder)
               ? ""
               : said(tr("{}: the disk is nearly full ({:.1Lf} MB free). A session that fills it is not kept: make room."),
                      folder.string(), static_cast<double>(space.available) / mega);
}

std::string whyNoProfiles()
{
    const fs::path folder = base::userFolder(base::UserFolder::data);
    return canBeWritten(folder) ? "" : said(tr("{}: no profiles can be kept there, and so no progress."), folder.string());
}

fs::path profilesFile()
{
    return base::userFolder(base::UserFolder::data) / "profiles.db";
}

fs::path sessionsFolder()
{
    const fs::path data = base::userFolder(base::UserFolder::data);
    return (data.empty() ? fs::temp_directory_path() / "palpate" : data) / "sessions";
}

}  // namespace palpate::trainer
