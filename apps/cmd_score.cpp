#include <apps/command.h>
#include <apps/progress_figures.h>
#include <base/build.h>
#include <base/outputs.h>
#include <command/json.h>
#include <report/groups.h>
#include <report/measure_table.h>
#include <report/report.h>
#include <session/figures.h>

#include <base/error.h>
#include <base/mapped.h>
#include <haptics/record_check.h>
#include <haptics/score.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace palpate::apps {

namespace {

constexpr std::size_t maxColumns = 12;  // sessions beside one another in a table
constexpr std::size_t shownLosses = 3;

using haptics::Score;
using nlohmann::json;

struct ScoreArguments {
    std::vector<std::filesystem::path> files;
    std::vector<std::string> groups;
    std::filesystem::path json, report, pictures;
};

struct Session {
    std::filesystem::path file;
    haptics::SessionInfo info;
    std::string sha256;
    bool complete = true;
    Score score;
    std::vector<haptics::Loss> losses;
    std::vector<std::string> warnings;
};

std::size_t open(const std::filesystem::path& file, std::vector<Session>& sessions)
{
    const auto known = std::ranges::find(sessions, file, &Session::file);
    if (known != sessions.end()) {
        return static_cast<std::size_t>(known - sessions.begin());
    }
    const haptics::Record record(file);
    const haptics::SessionInfo& info = record.info();
    haptics::LossWatch watch(info);
    record.each([&](const haptics::TickRecord& tick) { watch.add(tick); });
    haptics::RecordCheck check = haptics::checkRecord(record, base::build());
    sessions.push_back(
        {file, info, check.seal.sha256, record.complete(), watch.score(), watch.losses(info), std::move(check.warnings)});
    return sessions.size() - 1;
}

// The same file, or a copy of it.
bool isSame(const Session& a, const Session& b)
{
    std::error_code none;
    return std::filesystem::equivalent(a.file, b.file, none) || (!a.sha256.empty() && a.sha256 == b.sha256);
}

report::ScoredGroup parseGroup(const std::string& text, std::vector<Session>& sessions)
{
    const std::size_t equals = text.find('=');
    base::failIf(equals == 0 || equals == std::string::npos || equals + 1 == text.size(),
                 "--group {}: give a name and files, as in --group experts=a.db,b.db", text);
    report::ScoredGroup group{text.substr(0, equals), {}};
    std::vector<std::size_t> members;
    for (const std::string& file : CLI::detail::split(text.substr(equals + 1), ',')) {
        base::failIf(file.empty(), "--group {}: a file between two commas is missing", text);
        const std::size_t opened = open(file, sessions);
        const auto same =
            std::ranges::find_if(members, [&](std::size_t m) { return isSame(sessions[m], sessions[opened]); });
        if (same != members.end()) {
            throw base::error("--group {}: {} is the record {}, which is in this group already: name each record once",
                              text, file, sessions[*same].file.string());
        }
        members.push_back(opened);
        group.sessions.push_back(report::rowOf(sessions[opened].score));
    }
    return group;
}

json effectSize(const report::ScoredGroup& a, const report::ScoredGroup& b)
{
    json out = effectFigures(a, b);
    out.update({{"kind", "cliffs_delta"}, {"of", a.name}, {"over", b.name}});
    return out;
}

json figures(const std::vector<Session>& sessions, const std::vector<report::ScoredGroup>& groups)
{
    json out = {{"sessions", json::array()}};
    for (const Session& s : sessions) {
        json one = session::scoreFigures(s.score, s.losses);
        one.update({{"file", s.file.string()},
                    {"scene", s.info.scene},
                    {"model", s.info.model},
                    {"device", s.info.device},
                    {"operator", s.info.operatorName},
                    {"host", s.info.host},
                    {"started", s.info.started},
                    {"complete", s.complete},
                    {"record_sha256", s.sha256},
                    {"doubts", s.warnings}});
        out["sessions"].push_back(std::move(one));
    }
    out["groups"] = base::mapped<json>(groups, groupFigures);
    if (groups.size() >= 2) {
        out["effect_size"] = effectSize(groups[0], groups[1]);
    }
    if (groups.size() > 2) {
        out["effect_sizes"] = json::array();
        for (std::size_t a = 0; a < groups.size(); ++a) {
            for (std::size_t b = a + 1; b < groups.size(); ++b) {
                out["effect_sizes"].push_back(effectSize(groups[a], groups[b]));
            }
        }
    }
    return out;
}

void printSessions(const std::vector<Session>& sessions)
{
    if (sessions.size() > maxColumns) {
        std::printf("%zu sessions, each in --json\n", sessions.size());
    } else if (sessions.size() == 1) {
        for (const auto& [label, value] : haptics::describe(sessions[0].score)) {
            std::printf("%-26s %s\n", label.c_str(), value.c_str());
        }
        for (std::size_t i = 0; i < std::min<std::size_t>(sessions[0].losses.size(), shownLosses); ++i) {
            std::printf("%s\n", haptics::inWords(sessions[0].losses[i]).c_str());
        }
    } else {
        std::vector<std::string> heads;
        std::vector<std::vector<std::string>> columns;
        for (const Session& s : sessions) {
            heads.push_back(s.file.filename().string());
            columns.emplace_back();
            for (const haptics::Measure& m : haptics::measures()) {
                columns.back().push_back(report::cell(m.value(s.score), m.decimals));
            }
        }
        fmt::print("{}\n", report::measureTable(heads, columns));
    }
}

// Beside the figures and never among them: what makes them doubtful.
void warn(const std::vector<Session>& sessions)
{
    for (const Session& s : sessions) {
        for (const std::string& warning : s.warnings) {
            fmt::print(stderr, "palpate: warning: {}: {}\n", s.file.string(), warning);
        }
    }
}

void scoreRecord(const ScoreArguments& options)
{
    std::vector<Session> sessions;
    for (const std::filesystem::path& file : options.files) {
        open(file, sessions);
    }
    const auto groups = base::mapped<report::ScoredGroup>(
        options.groups, [&](const std::string& text) { return parseGroup(text, sessions); });
    base::failIf(sessions.empty(), "score: give at least one record, or --group NAME=FILE,FILE");
    const auto read = base::mapped<std::filesystem::path>(sessions, &Session::file);
    base::checkNames({options.report});
    base::checkOutputs({options.json, options.report}, read);
    base::failIf(!options.report.empty() && groups.empty() && sessions.size() > 1,
                 "{}: a report is of one record or of groups: give one file, or --group NAME=FILE,FILE",
                 options.report.native());
    base::failIf(!options.pictures.empty() && (options.report.empty() || !groups.empty()),
                 "--pictures {}: needs --report of one record", options.pictures.native());
    report::checkPictures(options.pictures);
    warn(sessions);
    // First what a file that cannot be written takes from nobody.
    if (options.json != "-") {
        printSessions(sessions);
        if (!groups.empty()) {
            fmt::print("\n{}\n", report::groupTable(groups));
        }
    }
    if (!options.report.empty() && !groups.empty()) {
        report::writeGroupReport(options.report, groups);
    } else if (!options.report.empty()) {
        report::writeReport(options.report, haptics::Record(sessions[0].file), options.pictures, sessions[0].file);
    }
    command::writeJson(options.json, figures(sessions, groups));
}

}  // namespace

void addScore(CLI::App& app)
{
    auto options = std::make_shared<ScoreArguments>();
    CLI::App* score = app.add_subcommand("score", "Score one or more records, and compare groups");
    score->add_option("FILE", options->files, "Records of sessions (.db)");
    score->add_option("--group", options->groups, "Group to compare, as NAME=FILE,FILE; repeat the option for each group")
        ->allow_extra_args(false);
    score->add_option("--json", options->json, "Write figures to this file (- = standard output)");
    score->add_option("--report", options->report, "Write a report (HTML) of the record, or of the groups, to this file");
    score->add_option("--pictures", options->pictures, "Include the PNG files of this folder in the report");
    score->callback([options] { scoreRecord(*options); });
}

}  // namespace palpate::apps
