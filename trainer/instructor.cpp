#include <trainer/instructor.h>

#include <base/mapped.h>
#include <base/printable.h>
#include <base/said.h>
#include <trainer/lists.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

namespace palpate::trainer {

namespace {

using base::marked;
using base::said;
using base::tr;
using nlohmann::json;

std::string translated(const std::string& word)
{
    constexpr std::array known{marked("outside"), marked("touching"), marked("inserted"),
                               marked("paused"),  marked("finished"), marked("faulted")};
    return std::ranges::find(known, word) == known.end() ? word : tr(word);
}

std::string warningOf(const json& one)
{
    const auto warning = one.at("warning").get<std::string>();
    if (warning == "none") {
        return {};
    }
    const std::string what = tr(one.at("warned").get<std::string>());
    return warning == "touching" ? said(tr("touches {}"), what) : said(tr("near: {}"), what);
}

LiveSession liveOf(const json& one)
{
    constexpr double silent = 2;  // [s]
    LiveSession s;
    read(one, "session", s.session, "who", s.who, "scene", s.scene, "state", s.doing, "seconds", s.seconds, "inserted_mm",
         s.inserted, "force_n", s.force, "cores", s.cores);
    s.doing = translated(s.doing);
    s.warning = warningOf(one);
    s.touching = one.at("warning") == "touching";
    s.target = numberAt(one, "target_mm");
    s.vital = numberAt(one, "vital_mm");
    s.lastCore = numberAt(one, "last_core_target_pct");
    s.stuck = one.at("age_s").get<double>() > silent && one.at("state") != "paused";
    return s;
}

double orInfinite(const json& values, const std::string& key)
{
    return numberAt(values, key.c_str()).value_or(std::numeric_limits<double>::infinity());
}

Spread spreadOf(const json& group, const std::string& key)
{
    Spread s{orInfinite(group.at("median"), key),
             orInfinite(group.at("lower_quartile"), key),
             orInfinite(group.at("upper_quartile"), key),
             {}};
    for (const json& value : group.at("values").at(key)) {
        if (value.is_number()) {
            s.values.push_back(value.get<double>());
        }
    }
    return s;
}

// The values of all sessions, as the page prints them. A session without one adds none.
std::vector<double> valuesOf(const ComparedMeasure& m)
{
    const double unit = std::pow(10.0, std::max(m.decimals, 1));
    std::vector<double> all;
    for (const Spread& s : m.groups) {
        std::ranges::transform(s.values, std::back_inserter(all), [unit](double v) { return std::round(v * unit) / unit; });
    }
    return all;
}

// Its one value in words, where no session differs from another: also not in having no value. Else nothing.
std::optional<std::string> sameInAll(const ComparedMeasure& m, int sessions)
{
    const std::vector<double> all = valuesOf(m);
    const bool none = all.empty();
    if (!none && (std::ssize(all) != sessions || std::ranges::any_of(all, [&](double v) { return v != all[0]; }))) {
        return {};
    }
    const std::string label = m.unit.empty() ? m.label : m.label + " [" + m.unit + "]";
    return none ? said(tr("{} without a value"), label)
                : said("{} {:.{}Lf}", label, base::printable(all[0], m.decimals), m.decimals);
}

// Medians of counts lie between them: half a pass is not none.
bool liesBetween(const Spread& s)
{
    constexpr double few = 10, near = 0.05;
    return std::ranges::any_of(std::array{s.median, s.lower, s.upper}, [](double v) {
        return std::isfinite(v) && std::abs(v) < few && std::abs(v - std::round(v)) > near;
    });
}

}  // namespace

std::string inWords(const Spread& s, int decimals)
{
    if (!std::isfinite(s.median) && !std::isfinite(s.lower) && !std::isfinite(s.upper)) {
        return tr("no value");
    }
    const auto number = [decimals](double v) {
        return std::isfinite(v) ? said("{:.{}Lf}", base::printable(v, decimals), decimals) : "-";
    };
    return said(tr("{} ({} to {})"), number(s.median), number(s.lower), number(s.upper));
}

std::vector<LiveSession> liveIn(const json& figures)
{
    std::vector<LiveSession> all;
    each(figures, "sessions", [&](const json& one) { all.push_back(liveOf(one)); });
    // A session that somebody sees again (palpate-view --replay) has a segment too; nobody trains in it.
    std::erase_if(all, [](const LiveSession& s) { return s.session.starts_with("replay-"); });
    return all;
}

Comparison comparisonIn(const json& figures)
{
    Comparison out;
    std::vector<json> groups;
    each(figures, "groups", [&](const json& one) {
        const int n = one.at("n").get<int>();
        out.names.push_back(one.at("name").get<std::string>());
        out.sessions.push_back(n);
        groups.push_back(one);
    });
    each(figures, "measures", [&](const json& one) {
        std::string key;
        ComparedMeasure m;
        read(one, "key", key, "label", m.label, "unit", m.unit, "decimals", m.decimals);
        m.label = tr(m.label);
        m.unit = tr(m.unit);
        m.groups = base::mapped<Spread>(groups, [&](const json& group) { return spreadOf(group, key); });
        if (m.decimals == 0 && std::ranges::any_of(m.groups, liesBetween)) {
            m.decimals = 1;
        }
        if (const auto effects = figures.find("effect_size"); effects != figures.end()) {
            m.effect = numberAt(*effects, key.c_str());
        }
        if (auto same = sameInAll(m, std::accumulate(out.sessions.begin(), out.sessions.end(), 0))) {
            out.same.push_back(std::move(*same));
        } else {
            out.measures.push_back(std::move(m));
        }
    });
    return out;
}

}  // namespace palpate::trainer
