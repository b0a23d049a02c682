#include <training/progress_page.h>

#include <base/counted.h>
#include <base/folds.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/shell_word.h>
#include <base/split.h>
#include <haptics/measures.h>
#include <report/html.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

namespace palpate::training {

using nlohmann::json;
using report::axis, report::escape, report::numbers;

namespace {

const haptics::Measure& measureCalled(std::string_view key)
{
    const auto all = haptics::measures();
    const auto at = std::ranges::find(all, key, &haptics::Measure::key);
    return at == all.end() ? all.front() : *at;
}

json trialNumbers(std::size_t count)
{
    std::vector<std::size_t> x(count);
    std::iota(x.begin(), x.end(), 1);
    return x;
}

// "at least 50 %": what a level asks of a measure, with its unit.
std::string limitInWords(std::string_view side, double value, const haptics::Measure& m)
{
    const std::string words = fmt::format("{} {:.{}f}", side, value, m.decimals);
    // A limit between two printed values keeps its own digits.
    const double printed = base::numberIn(words.substr(side.size() + 1)).value_or(value);
    const bool whole = std::abs(printed - value) < 1e-9 * std::max(1.0, std::abs(value));
    return (whole ? words : fmt::format("{} {:g}", side, value)) + (*m.unit == 0 ? "" : " ") + m.unit;
}

// What a measure has to be, as lines across its chart.
json levelLines(const Exercise& exercise, const haptics::Measure& m)
{
    json lines = json::array();
    const auto add = [&](const char* side, std::optional<double> at) {
        if (at) {
            lines.push_back({{"at", *at}, {"label", side}, {"words", limitInWords(side, *at, m)}, {"colour", "good"}});
        }
    };
    for (const Level& level : exercise.gate.levels) {
        if (level.measure == m.key) {
            add("at least", level.atLeast);
            add("at most", level.atMost);
        }
    }
    return lines;
}

// Why no session has a value of this measure, and what its level asks for.
std::string whyNoValue(const Exercise& exercise, const haptics::Measure& m)
{
    using Listed = haptics::Measure::Listed;
    std::string words = "-: ";
    words += m.listed == Listed::ifFired    ? "the gun was not fired in any session"
             : m.listed == Listed::ifMarked ? "nothing was marked in any session"
             : m.listed == Listed::ifProbe  ? "no session had an ultrasound probe"
             : m.listed == Listed::ifCt     ? "no session had a CT scanner"
                                            : "no session has a value of it";
    for (const json& line : levelLines(exercise, m)) {
        words += "; level: " + line["words"].get<std::string>();
    }
    return words;
}

json measureChart(const ExerciseProgress& p, const haptics::Measure& m)
{
    const json y = numbers(
        base::mapped<double>(p.sessions, [&](const StoredSession& session) { return valueIn(session.values, m.key); }));
    return {{"columns", json::array({trialNumbers(p.sessions.size()), y})},
            {"x", axis("session", "")},
            {"y", {{"name", m.label}, {"unit", m.unit}, {"label", *m.unit == 0 ? "number" : m.unit}}},
            {"lines", levelLines(*p.exercise, m)},
            {"points", true},
            {"height", 210},
            {"series", json::array({{{"label", m.label}, {"colour", "c0"}, {"width", 2}}})}};
}

json cusumChart(const ExerciseProgress& p, const CusumPlan& plan)
{
    const json alarm = numbers(base::mapped<double>(p.chart, &CusumPoint::alarm)),
               learning = numbers(base::mapped<double>(p.chart, &CusumPoint::learning));
    return {{"columns", json::array({trialNumbers(p.chart.size()), alarm, learning})},
            {"x", axis("session", "")},
            {"y", axis("CUSUM", "")},
            {"lines", json::array({{{"at", plan.alarmLimit()}, {"label", "alarm"}, {"colour", "bad"}},
                                   {{"at", plan.learningLimit()}, {"label", "has learnt it"}, {"colour", "good"}}})},
            {"points", true},
            {"height", 210},
            {"series", json::array({{{"label", "alarm: fails too often"}, {"colour", "bad"}, {"width", 2}},
                                    {{"label", "learning: fails seldom"}, {"colour", "good"}, {"width", 2}}})}};
}

std::string days(double count)
{
    return count < 1 ? "today" : fmt::format("{:.0f} {} ago", std::floor(count), count < 2 ? "day" : "days");
}

// Colour and words, so that neither is needed alone.
std::pair<const char*, const char*> stateOf(const ExerciseProgress& e, const ExerciseProgress* next)
{
    if (e.refresh) {
        return {"bad", "to be refreshed"};
    }
    if (e.gate.open) {
        return {"good", "reached"};
    }
    return &e == next                           ? std::pair{"accent", "next"}
           : e.available && !e.sessions.empty() ? std::pair{"accent", "in training"}
           : e.available                        ? std::pair{"muted", "open"}
                                                : std::pair{"muted", "locked"};
}

std::string signals(const ExerciseProgress& e)
{
    const auto alarms = std::ranges::count_if(e.chart, &CusumPoint::alarmed);
    const auto learnt = std::ranges::find_if(e.chart, &CusumPoint::proficient);
    std::string words = alarms == 0 ? "" : fmt::format("{} {}", alarms, alarms == 1 ? "alarm" : "alarms");
    if (learnt != e.chart.end()) {
        words += fmt::format("{}learnt by session {}", words.empty() ? "" : ", ", learnt - e.chart.begin() + 1);
    }
    return words.empty() ? "none yet" : words;
}

std::string overview(const CurriculumProgress& c)
{
    const ExerciseProgress* const next = c.next();
    std::string out =
        "<div class=\"scroll\"><table class=\"plain progress\"><thead><tr><th>Exercise</th><th>State</th><th "
        "class=\"n\">Sessions</th>"
        "<th class=\"n\">At its level</th><th>CUSUM</th><th>Last practised</th></tr></thead><tbody>";
    int number = 0;
    for (const ExerciseProgress& e : c.exercises) {
        const auto [colour, words] = stateOf(e, next);
        const std::string recent =
            e.gate.recentTried == 0 ? "-" : fmt::format("{} of last {}", e.gate.recentMet, e.gate.recentTried);
        const std::string asked = fmt::format("{} of {}{}", e.exercise->gate.pass, e.exercise->gate.of,
                                              e.exercise->gate.testOnly ? " tests" : "");
        out += fmt::format(
            "<tr><th>{}. {}</th><td><b class=\"state\" style=\"color:var(--{})\">{}</b></td><td class=\"n\">{}</td><td "
            "class=\"n\">{} ({})</td><td class=\"signals\">{}</td><td>{}</td></tr>",
            ++number, escape(e.exercise->title), colour, words, e.sessions.size(), recent, asked,
            e.sessions.empty() ? "-" : signals(e), e.daysSince ? days(*e.daysSince) : "never");
    }
    return out + "</tbody></table></div><p class=\"note\">In brackets: what opens the gate.</p>";
}

std::string whatNext(const CurriculumProgress& c, const Person& person)
{
    const ExerciseProgress* const next = c.next();
    if (next == nullptr) {
        return "<p class=\"outcome\">All exercises are reached.</p>";
    }
    const bool test = next->exercise->gate.testOnly && !next->gate.open;
    return fmt::format(
        "<p class=\"outcome\"><b>Next: {}</b>. It {}.</p><pre class=\"command\">palpate train --profile {} --exercise "
        "{}{}</pre>",
        escape(next->exercise->title), escape(reasonFor(*next)), escape(base::shellWord(person.name)),
        escape(base::shellWord(nameToFind(*c.curriculum) + "/" + next->exercise->id)), test ? " --test" : "");
}

std::string assumptionsOf(const CusumPlan& plan)
{
    const auto length = [&](CusumChart chart, double p) {
        const double n = averageRunLength(plan, chart, p);
        return std::isfinite(n) ? fmt::format("{:.0f}", n) : "never";
    };
    return fmt::format(
        "A session fails when it misses a level of its exercise. CUSUM with p0 = {:g}, p1 = {:g}, alpha = {:g}, beta = "
        "{:g}: who fails {:.0f} % of the time gets an alarm by chance every {} sessions in the mean, who fails {:.0f} % "
        "after {}; \"has learnt it\" comes after {} and, by chance, {} sessions.",
        plan.p0, plan.p1, plan.alpha, plan.beta, 100 * plan.p0, length(CusumChart::alarm, plan.p0), 100 * plan.p1,
        length(CusumChart::alarm, plan.p1), length(CusumChart::learning, plan.p0), length(CusumChart::learning, plan.p1));
}

// The charts of an exercise: its levels' measures, the total, the CUSUM.
std::string exerciseCard(const ExerciseProgress& e, const CusumPlan& plan, json& charts)
{
    std::string out = fmt::format(
        "<section class=\"card\"><h2>{}</h2><p class=\"note\">{}, {} at the level.</p>"
        "<div class=\"charts\">",
        escape(e.exercise->title), base::counted(e.sessions.size(), "session"), std::ranges::count(e.met, true));
    const auto place = [&](json chart, std::string_view title) {
        const std::string id = fmt::format("chart{}", charts.size());
        charts[id] = std::move(chart);
        out += fmt::format("<div><h3>{}</h3><div class=\"chart small\" id=\"{}\"></div></div>", escape(title), id);
    };
    place(cusumChart(e, plan), "CUSUM");
    for (const std::string& key : measuresOf(*e.exercise)) {
        const haptics::Measure& m = measureCalled(key);
        const bool any = std::ranges::any_of(
            e.sessions, [&](const StoredSession& session) { return std::isfinite(valueIn(session.values, m.key)); });
        if (any) {
            place(measureChart(e, m), m.label);
        } else {
            out += fmt::format("<div><h3>{}</h3><p class=\"note\">{}</p></div>", m.label, whyNoValue(*e.exercise, m));
        }
    }
    out += "</div>";
    std::string notes;
    for (const StoredSession& s : e.sessions) {
        if (!s.note.empty() || s.rating > 0) {
            notes += fmt::format("<li>{}: {}{}</li>", escape(s.started.substr(0, 10)),
                                 s.rating > 0 ? fmt::format("rated {} of 5. ", s.rating) : "", escape(s.note));
        }
    }
    return out + (notes.empty() ? "" : "<ul>" + notes + "</ul>") + "</section>";
}

// Sessions outside a curriculum, by case.
std::string freeCard(const PersonProgress& p)
{
    std::map<std::string, std::vector<double>> totals;
    for (const StoredSession& s : p.sessions) {
        if (const double total = valueIn(s.values, "total"); s.exercise.empty() && !std::isnan(total)) {
            totals[s.caseId.empty() ? s.scene : s.caseId].push_back(total);
        }
    }
    if (totals.empty()) {
        return {};
    }
    std::string out =
        "<section class=\"card\"><h2>Free practice</h2><div class=\"scroll\"><table "
        "class=\"plain\"><thead><tr><th>Case</th><th class=\"n\">Sessions</th><th class=\"n\">Last total</th><th "
        "class=\"n\">Best total</th></tr></thead><tbody>";
    for (const auto& [name, values] : totals) {
        out +=
            fmt::format("<tr><th>{}</th><td class=\"n\">{}</td><td class=\"n\">{:.0f}</td><td class=\"n\">{:.0f}</td></tr>",
                        escape(name), values.size(), values.back(), *std::ranges::max_element(values));
    }
    return out + "</tbody></table></div></section>";
}

// What goes into the page beside its text, and what people have in common.
struct Gathered {
    json charts = json::object();
    std::map<std::array<double, 4>, std::string> assumptions;  // by the parameters of the chart: run lengths take long

    const std::string& assumed(const CusumPlan& plan)
    {
        std::string& words = assumptions[{plan.p0, plan.p1, plan.alpha, plan.beta}];
        words = words.empty() ? training::assumptionsOf(plan) : words;
        return words;
    }
};

std::string personPart(const PersonProgress& p, Gathered& page)
{
    std::string out =
        fmt::format("<header><div><p class=\"eyebrow\">{} hand &middot; {} since {}</p><h1>{}</h1></div></header>",
                    nameOf(p.person.hand), base::counted(p.sessions.size(), "session"), p.person.created.substr(0, 10),
                    escape(p.person.name));
    if (p.sessions.empty()) {
        out += "<section class=\"card\"><p>No sessions yet.</p></section>";
    }
    for (const CurriculumProgress& c : p.curricula) {
        out += "<section class=\"card\"><h2>" + escape(c.curriculum->title) + "</h2>" + whatNext(c, p.person) +
               overview(c) + "<p class=\"note\">" + page.assumed(c.curriculum->cusum) + "</p></section>";
        for (const ExerciseProgress& e : c.exercises) {
            out += e.sessions.empty() ? "" : exerciseCard(e, c.curriculum->cusum, page.charts);
        }
    }
    return out + freeCard(p);
}

}  // namespace

std::vector<double> rowOf(const StoredSession& session)
{
    return base::mapped<double>(haptics::measures(),
                                [&](const haptics::Measure& m) { return valueIn(session.values, m.key); });
}

void writeProgressPage(const std::filesystem::path& html, const std::vector<PersonProgress>& people,
                       const std::vector<report::ScoredGroup>& groups)
{
    Gathered page;
    std::string body = base::sumOf(
        people, [&](const PersonProgress& p) { return personPart(p, page); }, std::string());
    body += groups.empty() ? "" : report::groupsPart(groups);
    base::writeWhole(html, report::page("Progress - Palpate", body, {{"events", json::array()}, {"charts", page.charts}}));
}

}  // namespace palpate::training
