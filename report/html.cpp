#include <report/html.h>

#include <base/mapped.h>
#include <base/shell_word.h>
#include <base/spoken.h>
#include <datasets/tables.h>
#include <haptics/measures.h>
#include <haptics/record_check.h>
#include <report/assets.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace palpate::report {

using haptics::EventKind;

std::string escape(std::string_view text)
{
    std::string out;
    constexpr std::string_view special = "&<>\"'";
    constexpr std::array<std::string_view, 5> entities{"&amp;", "&lt;", "&gt;", "&quot;", "&#39;"};
    for (const char c : text) {
        const std::size_t at = special.find(c);
        out += at < special.size() ? entities[at] : std::string_view(&c, 1);
    }
    return out;
}

namespace {

std::string nameOf(const std::vector<std::string>& names, std::size_t i)
{
    return i < names.size() ? base::spoken(names[i]) : "row " + std::to_string(i);
}

std::string plural(std::uint32_t n, std::string_view one, std::string_view many)
{
    return n == 0 ? fmt::format("no {}", many) : n == 1 ? fmt::format("one {}", one) : fmt::format("{} {}", n, many);
}

// What came of a session that asks for no core.
std::string withoutCore(const haptics::Score& s)
{
    if (haptics::judgedBy(s) == haptics::Judged::rest) {
        return fmt::format("The needle rested on the skin for {:.1f} s{}.", s.rest,
                           s.deepest > 0.0 ? ", and pierced it" : "");
    }
    if (haptics::judgedBy(s) != haptics::Judged::way) {
        return "The scene asks for no core.";
    }
    return !std::isfinite(s.tipToTarget) ? "The needle never went in."
           : s.tipToTarget > 0.0         ? fmt::format("The tip came to {:.1f} mm from the target.", s.tipToTarget * 1e3)
                                         : "The tip was in the target.";
}

std::string outcome(const ReportData& d, const haptics::Record& record)
{
    const haptics::Score& s = d.score;
    std::string text;
    if (s.skinContacts == 0) {
        text = "The tool never touched the body.";
    } else if (s.marks > 0) {
        text = fmt::format(
            "The trainee made {}; their middle lies {:.1f} mm beside the target's, and the size is {:.1f} mm off.",
            plural(s.marks, "mark", "marks"), s.markError * 1e3, s.markSizeError * 1e3);
    } else if (s.passes == 0 && haptics::judgedBy(s) != haptics::Judged::core) {
        text = withoutCore(s);
    } else if (s.passes == 0) {
        text = "The gun was not fired, so there is no core to judge.";
    } else {
        text = fmt::format("{} taken; the best holds {:.0f} % target over {:.1f} mm",
                           s.passes == 1 ? "One core was" : fmt::format("{} cores were", s.passes),
                           s.bestTargetFraction * 100, s.bestTargetLength * 1e3);
        if (std::isfinite(s.targetingError) && s.targetingError > 0) {
            text += fmt::format(", fired {:.1f} mm beside the target", s.targetingError * 1e3);
        }
        text += '.';
    }
    if (s.skinContacts > 0) {
        text += s.vitalContacts > 0
                    ? fmt::format(" Vital structures were touched {}, for {:.2f} s and up to {:.1f} mm deep.",
                                  s.vitalContacts == 1 ? "once" : fmt::format("{} times", s.vitalContacts), s.vitalSeconds,
                                  s.vitalDepth * 1e3)
                    : fmt::format(" No vital structure was touched, with {}.", plural(s.warnings, "warning", "warnings"));
        text += fmt::format(" It took {:.1f} s with {} and {}.", s.seconds,
                            plural(s.skinContacts, "skin contact", "skin contacts"),
                            plural(s.redirects, "redirect", "redirects"));
    }
    return escape(text) + (record.complete() ? "" : " The record ends early.");
}

// What the servo loop said about its own punctuality, where it did.
std::string lateness(const haptics::Record& record)
{
    const std::string missed = record.result("missed_ticks"), late = record.result("lateness_us_p99");
    return (missed.empty() ? "" : " Missed ticks: " + escape(missed) + ".") +
           (late.empty() ? "" : " Late by at most " + escape(late) + " &micro;s in 99 % of them.");
}

}  // namespace

std::string tissueColour(const std::string& tissue)
{
    static const volume::TissueTable table = datasets::defaultTissues();
    const auto row = std::ranges::find(table.rows, tissue, &volume::TissueRow::name);
    if (row == table.rows.end()) {
        return {};
    }
    const auto byte = [](float v) { return std::lround(255 * std::clamp(v, 0.0F, 1.0F)); };
    return fmt::format("#{:02x}{:02x}{:02x}", byte(row->colour.x), byte(row->colour.y), byte(row->colour.z));
}

std::string embedded(const nlohmann::json& data)
{
    const std::string text = data.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    std::string out;
    out.reserve(text.size());
    for (const char c : text) {
        out += c == '<' ? std::string_view("\\u003c") : std::string_view(&c, 1);
    }
    return out;
}

nlohmann::json numbers(const std::vector<double>& values)
{
    return base::mapped<nlohmann::json>(values, [&](const double v) {
        return std::isfinite(v) ? nlohmann::json(std::round(v * 1e4) / 1e4) : nlohmann::json();
    });
}

nlohmann::json axis(std::string_view name, std::string_view unit)
{
    return {
        {"name", name}, {"unit", unit}, {"label", unit.empty() ? std::string(name) : fmt::format("{} [{}]", name, unit)}};
}

std::string page(std::string_view title, std::string_view body, const nlohmann::json& data)
{
    std::string out =
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width, initial-scale=1\"><title>" +
        escape(title) + "</title>\n<style>";
    out.append(asset("assets/uPlot.min.css")).append(asset("assets/report.css"));
    // Without scripts the reader learns at the top that charts are missing, and not behind a dozen empty cards.
    out.append(
        "</style><noscript><style>.chart { display: none; }</style></noscript></head>\n<body><main><noscript><p "
        "class=\"warning\">The charts need JavaScript; everything else is here without it.</p></noscript>");
    out.append(body);
    out +=
        "<footer>Written by Palpate. Charts by uPlot (MIT licence).</footer></main>\n"
        "<script type=\"application/json\" id=\"data\">" +
        embedded(data) + "</script>";
    for (const auto* script : {"assets/uPlot.iife.min.js", "assets/scatter.js", "assets/report.js"}) {
        out.append("\n<script>").append(asset(script)).append("</script>");
    }
    return out + "</body></html>\n";
}

std::string header(const ReportData& d, const haptics::Record& record, const std::string& file)
{
    const haptics::SessionInfo& info = record.info();
    constexpr double round = 2 * 3.14159265 * 52;
    std::string out = fmt::format(
        "<header><div class=\"total\" role=\"img\" aria-label=\"{0:.0f} of 100 points\">"
        "<svg viewBox=\"0 0 116 116\"><circle class=\"track\" cx=\"58\" cy=\"58\" r=\"52\"/>"
        "<circle class=\"value\" cx=\"58\" cy=\"58\" r=\"52\" stroke-dasharray=\"{1:.2f} {2:.2f}\"/></svg>"
        "<div><b>{0:.0f}</b><small>of 100</small></div></div>",
        d.score.total, std::max(d.score.total / 100 * round, 0.01), round);
    out += fmt::format(
        "<div><p class=\"eyebrow\">Palpate session &middot; model {} &middot; device {}</p><h1>{}</h1>"
        "<p class=\"outcome\">{}</p>{}</div></header>",
        escape(info.model), escape(info.device), escape(info.scene), outcome(d, record),
        file.empty() ? ""
                     : "<p class=\"note\">To see it again: <code>palpate-view --replay " + escape(base::shellWord(file)) +
                           "</code></p>");
    if (!record.complete()) {
        out +=
            "<p class=\"warning\">The program that wrote this record was stopped before the session ended. Everything up "
            "to half a second before that is here.</p>";
    }
    if (d.faulted) {
        out +=
            "<p class=\"warning\">A force was not finite: the fault was latched and the output stayed zero from then "
            "on.</p>";
    }
    return out;
}

std::string scoreCard(const ReportData& d)
{
    const haptics::ScoreParts p = haptics::parts(d.score);
    std::string out = "<section class=\"card\"><h2>Score</h2><div class=\"parts\">";
    for (const haptics::PartOfTotal& part : haptics::partsOfTotal) {
        const bool isCore = part.points == &haptics::ScoreParts::core;
        out += fmt::format(
            "<div><span>{} <b>{:.0f} of {:.0f}</b></span><div class=\"meter\"><i style=\"width:{:.1f}%\"></i></div></div>",
            isCore ? haptics::labelOfCore(d.score) : part.label, p.*part.points, part.most,
            100 * p.*part.points / part.most);
    }
    out += "</div>";
    if (!d.losses.empty()) {
        out += "<h3>Where points were lost</h3><table class=\"plain losses\"><tbody>";
        for (const haptics::Loss& loss : d.losses) {
            out += fmt::format("<tr><td class=\"n\">&minus;{:.1f}</td><td>{}.</td><td class=\"n\">{}</td></tr>",
                               loss.points, escape(loss.words), loss.at ? fmt::format("at {:.1f} s", *loss.at) : "");
        }
        out += "</tbody></table>";
    }
    out += "<dl class=\"figures\">";
    for (const auto& [label, value] : haptics::describeMeasures(d.score)) {
        out += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", escape(label), escape(value));
    }
    return out + "</dl></section>";
}

std::string coresCard(const ReportData& d, const haptics::SessionInfo& info)
{
    if (d.cores.empty() && haptics::judgedBy(d.score) != haptics::Judged::core) {
        return {};
    }
    std::string out = "<section class=\"card\"><h2>Cores</h2>";
    if (d.cores.empty()) {
        return out + "<p class=\"note\">The gun was not fired.</p></section>";
    }
    out += "<p class=\"note\">Tissue in the notch at each firing, by volume, in the viewer's colours.</p>";
    std::map<std::size_t, std::size_t> met;
    for (const auto& core : d.cores) {
        for (std::size_t t = 0; t < core.sample.fraction.size(); ++t) {
            if (core.sample.fraction[t] > 0) {
                met.emplace(t, met.size());
            }
        }
    }
    for (std::size_t n = 0; n < d.cores.size(); ++n) {
        const haptics::CoreSample& core = d.cores[n].sample;
        out += fmt::format(
            "<div class=\"core\"><b>Core {}</b> at {:.1f} s: {:.0f} % target, {:.1f} mm in the target, {:.0f} mm&sup3;",
            n + 1, d.cores[n].seconds, core.targetFraction * 100, core.targetLength * 1e3, core.volume * 1e9);
        std::string bar, key;
        for (std::size_t t = 0; t < core.fraction.size(); ++t) {
            const double percent = core.fraction[t] * 100;
            if (!(percent > 0)) {
                continue;
            }
            const std::string name = escape(nameOf(info.tissues, t));
            std::string colour = t < info.tissues.size() ? tissueColour(info.tissues[t]) : "";
            colour = colour.empty() ? fmt::format("var(--c{})", met.at(t) % 8) : colour;
            bar += fmt::format("<i style=\"width:{:.2f}%;background:{}\" title=\"{}: {:.1f} %\"></i>", percent, colour,
                               name, percent);
            key += fmt::format("<span><i style=\"background:{}\"></i>{} {:.1f} %</span>", colour, name, percent);
        }
        out += "<div class=\"core-bar\">" + bar + "</div><div class=\"key\">" +
               (key.empty() ? "nothing in the notch" : key) + "</div></div>";
    }
    return out + "</section>";
}

std::string chartCard(std::string_view id, std::string_view title, std::string_view note)
{
    return fmt::format(
        "<section class=\"card\"><h2>{}</h2><p class=\"note\">{}</p><div class=\"chart\" id=\"{}\"></div></section>", title,
        note, id);
}

std::string timingCard(const ReportData& d, const haptics::Record& record)
{
    const double rate = record.info().rate;
    constexpr std::array<std::pair<const char*, const char*>, haptics::taskCount> tasks{{{"H2", "read the device"},
                                                                                         {"H3", "collide"},
                                                                                         {"H4", "basic force"},
                                                                                         {"deform", "deform the tissue"},
                                                                                         {"H6", "distances and look-ahead"},
                                                                                         {"H7", "additional force"},
                                                                                         {"H5", "send the force"}}};
    const double period = 1e6 / rate;
    std::string out = fmt::format(
        "<section class=\"card\"><h2>Time of a tick</h2><p class=\"note\">{} ticks at {:.0f} Hz, {:.0f} &micro;s each; "
        "{:.2f} % of them without a fresh pose of the device.{}</p><div class=\"scroll\"><table "
        "class=\"plain\"><thead><tr><th>Task</th><th></th><th class=\"n\">p50 &micro;s</th><th class=\"n\">p99 "
        "&micro;s</th><th class=\"n\">largest &micro;s</th><th class=\"bar\">p99 as a share of the "
        "tick</th></tr></thead><tbody>",
        d.ticks, rate, period, d.missing * 100, lateness(record));
    const auto row = [&](std::string_view style, std::string_view code, std::string_view what, const TaskTime& t) {
        out += fmt::format(
            "<tr{}><th>{}</th><td>{}</td><td class=\"n\">{:.1f}</td><td class=\"n\">{:.1f}</td><td "
            "class=\"n\">{:.1f}</td><td class=\"bar\"><div class=\"meter\"><i style=\"width:{:.1f}%\"></i></div></td></tr>",
            style, code, what, t.p50, t.p99, t.largest, std::clamp(100 * t.p99 / period, 0.0, 100.0));
    };
    for (std::size_t i = 0; i < haptics::taskCount; ++i) {
        row("", tasks[i].first, tasks[i].second, d.tasks[i]);
    }
    row(" class=\"all\"", "all", "of one tick", d.tick);
    return out + "</tbody></table></div></section>";
}

std::string eventLabel(const haptics::Event& e, const haptics::SessionInfo& info)
{
    const std::string structure = e.structure == 0xFF ? "" : nameOf(info.structures, e.structure);
    switch (e.kind) {
        case EventKind::contact:
            return "contact";
        case EventKind::release:
            return "release";
        case EventKind::puncture:
            return fmt::format("{} at {:.2f} N", nameOf(info.tissues, e.tissue), e.value);
        case EventKind::warning:
        case EventKind::veryNear:
            return fmt::format("{} {:.1f} mm", structure, e.value * 1e3);
        case EventKind::vitalTouch:
            return fmt::format("{} touched", structure);
        case EventKind::fire:
            return "fired";
        case EventKind::fault:
            return "fault";
        case EventKind::stepDown:
            return "simpler model: ticks came late";
        case EventKind::fireRefused:
            return e.tissue == 0 ? "fired outside the body: no core"
                                 : fmt::format("fired against {}: no core", nameOf(info.tissues, e.tissue));
        case EventKind::throwStopped:
            return fmt::format("throw stopped by {} after {:.1f} mm", nameOf(info.tissues, e.tissue), e.value * 1e3);
    }
    return {};
}

std::string eventsCard(const ReportData& d, const haptics::SessionInfo& info)
{
    std::string out = fmt::format(
        "<section class=\"card\"><h2>Events</h2><details><summary>{} events{}</summary><div "
        "class=\"scroll\"><table class=\"plain\"><thead><tr><th class=\"n\">s</th><th>Event</th><th>"
        "</th></tr></thead><tbody>",
        d.eventCount, d.eventCount > d.events.size() ? ", of which the first are here" : "");
    for (const MarkedEvent& e : d.events) {
        out += fmt::format("<tr><td class=\"n\">{:.3f}</td><th>{}</th><td>{}</td></tr>", e.seconds,
                           haptics::name(e.event.kind), escape(eventLabel(e.event, info)));
    }
    return out + "</tbody></table></div></details></section>";
}

std::string sealInWords(const haptics::Seal& seal)
{
    switch (seal.state) {
        case haptics::Seal::State::open:
            return "none: the record is open, its session was cut off";
        case haptics::Seal::State::absent:
            return "none: the record's format has none";
        case haptics::Seal::State::broken:
            return "BROKEN: was changed after it was closed: " + haptics::someOf(seal.changed);
        case haptics::Seal::State::whole:
            break;
    }
    return seal.sha256;
}

std::string sessionCard(const haptics::Record& record)
{
    const haptics::SessionInfo& info = record.info();
    std::string out =
        "<section class=\"card\"><h2>Scene and build</h2><div class=\"scroll\"><table class=\"plain facts\"><tbody>";
    const auto row = [&](std::string_view name, std::string_view value) {
        out += fmt::format("<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(value));
    };
    row("Scene", info.scene);
    row("From", info.sceneOrigin);
    row("Volume", info.volumeHash);
    row("Model", info.model);
    row("Device", info.device);
    row("Operator", info.operatorName.empty() ? "not said" : info.operatorName);
    row("Started", info.started);
    row("Machine", info.host);
    row("Session", info.name);
    row("Seal (SHA-256)", sealInWords(record.seal()));
    row("Rate", fmt::format("{:.0f} Hz", info.rate));
    row("Seed", std::to_string(info.seed));
    row("Build", info.build);
    for (const auto& [key, value] : info.extra) {
        if (key == haptics::targetShapeKey) {
            continue;  // drawn with the path
        }
        row(key, value);
    }
    out += "</tbody></table></div>";
    const auto results = record.results();
    if (!results.empty()) {
        out +=
            "<details><summary>What the session reported at its end</summary><div class=\"scroll\"><table "
            "class=\"plain facts\"><tbody>";
        for (const auto& [key, value] : results) {
            row(key, value);
        }
        out += "</tbody></table></div></details>";
    }
    return out + "<details><summary>The scene as it was</summary><pre>" + escape(info.sceneText) +
           "</pre></details></section>";
}

}  // namespace palpate::report
