#pragma once

// The page of a report, and its parts that are text and tables.

#include <report/data.h>

#include <haptics/recorder.h>

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace palpate::report {

/// Text as it may stand in HTML, also in an attribute.
std::string escape(std::string_view text);

/// JSON that may stand in a script element: no "</script" and nothing that is not UTF-8.
std::string embedded(const nlohmann::json& data);

/// The numbers of a chart: four decimals are under a tenth of what it can show, and halve the page. What is not finite is
/// null.
nlohmann::json numbers(const std::vector<double>& values);
/// An axis of a chart: "force [N]".
nlohmann::json axis(std::string_view name, std::string_view unit);

/// A whole page that needs no other file: `body` between the style and the scripts that draw data["charts"], each in the
/// place that chartCard() made for its key.
///
/// @param title  plain text
/// @param body   HTML
std::string page(std::string_view title, std::string_view body, const nlohmann::json& data);

/// A few words for a mark in a chart; not escaped.
std::string eventLabel(const haptics::Event& event, const haptics::SessionInfo& info);

/// The colour of a tissue as viewers show it, "#208020": that of the built-in table; empty for a tissue that it does not
/// have.
std::string tissueColour(const std::string& tissue);

/// @param file  of the record: how to play it again is said; empty: it is not
std::string header(const ReportData& data, const haptics::Record& record, const std::string& file);
std::string scoreCard(const ReportData& data);
std::string coresCard(const ReportData& data, const haptics::SessionInfo& info);
/// An empty place for a chart; the page's script fills it. `title` and `note` are HTML.
std::string chartCard(std::string_view id, std::string_view title, std::string_view note);
std::string timingCard(const ReportData& data, const haptics::Record& record);
std::string eventsCard(const ReportData& data, const haptics::SessionInfo& info);
std::string sessionCard(const haptics::Record& record);

}  // namespace palpate::report
