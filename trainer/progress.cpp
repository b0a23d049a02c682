#include <trainer/progress.h>

#include <base/mapped.h>
#include <base/said.h>
#include <trainer/lists.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

namespace palpate::trainer {

namespace {

using base::marked;
using base::said;
using base::tr;
using nlohmann::json;
using Standing = ExerciseEntry::Standing;

struct Labelled {
    std::string label, unit;
};
using Labels = std::map<std::string, Labelled>;

std::vector<double> numbersOf(const json& list)
{
    return base::mapped<double>(list, [](const json& one) {
        return one.is_number() ? one.get<double>() : std::numeric_limits<double>::quiet_NaN();
    });
}

Standing standingOf(const std::string& word)
{
    constexpr std::array words{"locked", "open", "next", "reached", "refresh"};
    const auto at = std::ranges::find(words, word);
    return at == words.end() ? Standing::locked : static_cast<Standing>(at - words.begin());
}

// In the order of the levels; then the total, unless a level is of it.
std::vector<Curve> curvesOf(const json& one, const Labels& labels)
{
    std::vector<std::string> keys;
    for (const json& level : one.at("levels")) {
        const auto key = level.at("measure").get<std::string>();
        if (std::ranges::find(keys, key) == keys.end()) {
            keys.push_back(key);
        }
    }
    if (std::ranges::find(keys, "total") == keys.end()) {
        keys.emplace_back("total");
    }
    std::vector<Curve> curves;
    for (const std::string& key : keys) {
        const auto named = labels.find(key);
        Curve curve{named == labels.end() ? key : named->second.label, named == labels.end() ? "" : named->second.unit,
                    numbersOf(one.at("curves").at(key)), std::nullopt, std::nullopt};
        for (const json& level : one.at("levels")) {
            if (level.at("measure") == key) {
                curve.atLeast = numberAt(level, "at_least");
                curve.atMost = numberAt(level, "at_most");
            }
        }
        curves.push_back(std::move(curve));
    }
    return curves;
}

ExerciseEntry exerciseOf(const json& one, const Labels& labels)
{
    ExerciseEntry e;
    read(one, "curriculum", e.curriculum, "curriculum_title", e.curriculumTitle, "exercise", e.id, "title", e.title, "case",
         e.caseId, "next", e.next, "test", e.test, "sessions", e.sessions, "recent_met", e.recentMet, "recent_tried",
         e.recentTried, "pass", e.pass, "of", e.of);
    e.curriculumTitle = tr(e.curriculumTitle);
    e.title = tr(e.title);
    e.standing = standingOf(one.at("state").get<std::string>());
    e.daysSince = numberAt(one, "days_since");
    e.curves = curvesOf(one, labels);
    const json& cusum = one.at("cusum");
    read(cusum, "p0", e.p0, "p1", e.p1);
    e.alarm = {tr("alarm: fails too often"), "", numbersOf(cusum.at("alarm")), std::nullopt,
               cusum.at("alarm_limit").get<double>()};
    e.learning = {tr("learning: fails seldom"), "", numbersOf(cusum.at("learning")), std::nullopt,
                  cusum.at("learning_limit").get<double>()};
    return e;
}

KeptSession sessionOf(const json& one)
{
    KeptSession s;
    read(one, "name", s.name, "session", s.number, "started", s.started, "case", s.caseId, "scene", s.scene, "record",
         s.record, "note", s.note, "rating", s.rating);
    s.test = one.at("mode") == "test";
    s.total = numberAt(one.at("measures"), "total");
    return s;
}

}  // namespace

std::optional<std::size_t> Progress::next() const noexcept
{
    const auto at = std::ranges::find(exercises, true, &ExerciseEntry::next);
    return at == exercises.end() ? std::nullopt : std::optional(static_cast<std::size_t>(at - exercises.begin()));
}

std::optional<double> Progress::best(const std::string& caseId) const noexcept
{
    std::optional<double> best;
    for (const KeptSession& s : sessions) {
        if (s.caseId == caseId && s.total) {
            best = std::max(best.value_or(0), *s.total);
        }
    }
    return best;
}

Progress progressIn(const json& figures)
{
    Labels labels;
    each(figures, "measures", [&](const json& one) {
        labels[one.at("key").get<std::string>()] = {tr(one.at("label").get<std::string>()),
                                                    tr(one.at("unit").get<std::string>())};
    });
    Progress progress;
    each(figures, "exercises", [&](const json& one) { progress.exercises.push_back(exerciseOf(one, labels)); });
    each(figures, "sessions", [&](const json& one) { progress.sessions.push_back(sessionOf(one)); });
    return progress;
}

const char* inWords(Standing standing) noexcept
{
    constexpr std::array words{marked("locked"), marked("open"), marked("next"), marked("reached"),
                               marked("to be refreshed")};
    return tr(words[static_cast<std::size_t>(standing)]);
}

std::vector<std::string> levelsInWords(const ExerciseEntry& e)
{
    std::vector<std::string> lines;
    for (const Curve& c : e.curves) {
        const std::string least = c.atLeast ? said(tr("at least {:Lg}"), *c.atLeast) : "";
        const std::string most = c.atMost ? said(tr("at most {:Lg}"), *c.atMost) : "";
        if (!least.empty() || !most.empty()) {
            lines.push_back(c.label + ": " + least + (least.empty() || most.empty() ? "" : ", ") + most +
                            (c.unit.empty() ? "" : " " + c.unit));
        }
    }
    return lines;
}

std::string reasonFor(const ExerciseEntry& e)
{
    if (e.standing == Standing::refresh) {
        return said(tr("It was reached, and not practised for {:.0f} days."), std::floor(e.daysSince.value_or(0)));
    }
    if (e.standing == Standing::reached) {
        return tr("Its level was reached. It can be practised again at any time.");
    }
    if (e.standing == Standing::locked) {
        return tr("Its gate is shut: the exercises before it come first.");
    }
    const std::string asked = e.test ? said(tr("{} of {} tests at its level open the gate."), e.pass, e.of)
                                     : said(tr("{} of {} sessions at its level open the gate."), e.pass, e.of);
    if (e.recentTried == 1) {
        return asked + " " + (e.recentMet == 1 ? tr("The last one was at it.") : tr("The last one was not at it."));
    }
    return e.recentTried == 0 ? asked
                              : asked + " " + said(tr("So far it is {} of the last {}."), e.recentMet, e.recentTried);
}

}  // namespace palpate::trainer
