#include <trainer/charts.h>
#include <trainer/widgets.h>

#include <base/printable.h>
#include <base/said.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

namespace palpate::trainer {

namespace {

using base::said;
using base::tr;

std::string orNone(const std::optional<double>& millimetres)
{
    return millimetres ? said("{:.1Lf} mm", *millimetres) : "-";
}

// The scene of a case is called as the case is.
std::string titleOf(const State& state, const LiveSession& s)
{
    const auto at = std::ranges::find(state.cases, s.scene, &CaseEntry::id);
    return at != state.cases.end() ? at->title : s.scene;
}

Errand drawLive(State& state)
{
    Instructor& i = state.instructor;
    if (i.live.empty()) {
        words(tr("No session of yours runs on this machine. As soon as one does it stands here, with its figures."), quiet);
    }
    Errand errand = Errand::none;
    for (const LiveSession& s : i.live) {
        ImGui::PushID(s.session.c_str());
        ImGui::Separator();
        ImGui::AlignTextToFramePadding();
        heading(said("{}: {}", s.who.empty() ? s.session : s.who, titleOf(state, s)), 1.15F);
        if (buttonBeside(tr("Watch"))) {
            i.watched = s.session;
            i.watchedTitle = titleOf(state, s);
            errand = Errand::watchSession;
        }
        words(said(tr("{}; {:.0f} s, inside {:.1Lf} mm, target {}, vital structure {}, force {:.1Lf} N"), s.doing,
                   s.seconds, s.inserted, orNone(s.target), orNone(s.vital), s.force));
        if (s.cores > 0) {
            words(said(tr("Cores: {}, target in the last one {:.0f} %"), s.cores, s.lastCore.value_or(0)));
        }
        if (!s.warning.empty()) {
            words(said(tr("Warning: {}"), s.warning), s.touching ? vermilion : orange);
        }
        if (s.stuck) {
            words(tr("Nothing was heard of it for two seconds."), orange);
        }
        ImGui::PopID();
    }
    return errand;
}

std::string titleOf(const State& state, const KeptSession& s)
{
    const auto at = std::ranges::find(state.cases, s.caseId, &CaseEntry::id);
    return at != state.cases.end() ? at->title : s.caseId.empty() ? s.scene : s.caseId;
}

// When it was, what it came to.
std::string factsOf(const Instructor& i, const KeptSession& s)
{
    constexpr std::size_t toMinutes = 16;  // of 2026-11-22T09:14:05Z; records of sweeps have no date
    std::string line =
        s.started.size() < toMinutes ? "-" : s.started.substr(0, 10) + " " + s.started.substr(11, 5) + " UTC";
    line += s.total ? said(tr(", {:.0f} points"), *s.total) : "";
    line += s.rating > 0 ? said(tr(", rated {} of 5"), s.rating) : "";
    line += hasDraft(i, s) ? tr(", note not kept yet") : "";
    return line;
}

// One of them, and the others behind a button, where there is no room for a list.
void drawKeptChoice(State& state)
{
    Instructor& i = state.instructor;
    const auto& all = i.everybody.sessions;
    const auto label = [&](std::size_t n) {
        return said("{}: {}, {}", all[n].name, titleOf(state, all[n]), factsOf(i, all[n]));
    };
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    if (const auto now = choice("##kept", label(i.chosen), all.size(), i.chosen, label)) {
        chooseKept(state, *now);
    }
}

void drawKeptList(State& state)
{
    Instructor& i = state.instructor;
    for (std::size_t n = 0; n < i.everybody.sessions.size(); ++n) {
        const KeptSession& s = i.everybody.sessions[n];
        ImGui::PushID(static_cast<int>(n));
        const ImVec2 at = ImGui::GetCursorPos();
        const float high = 2 * ImGui::GetTextLineHeightWithSpacing();
        if (ImGui::Selectable("##kept", i.chosen == n, 0, {0, high}) ||
            (ImGui::IsItemFocused() && ImGui::GetIO().NavVisible && i.chosen != n)) {
            chooseKept(state, n);
        }
        if (!ImGui::IsItemVisible()) {
            ImGui::PopID();
            continue;  // of hundreds a dozen are seen
        }
        drawRow(at, said("{}: {}", s.name, titleOf(state, s)), factsOf(i, s), i.chosen == n ? Rgb{1, 1, 1} : quiet);
        ImGui::PopID();
    }
}

// Esc leaves the field with what was typed: ImGui would put back the text that was there when it was entered.
void drawNote(std::string& note)
{
    const std::string typed = note;
    ImGui::InputTextMultiline("##note", &note, {ImGui::GetContentRegionAvail().x, 6 * ImGui::GetFontSize()});
    note = ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Escape]) ? typed : note;
}

// The chosen session: what it came to, and the instructor's word on it.
Errand drawKept(State& state)
{
    Instructor& i = state.instructor;
    const KeptSession& s = i.everybody.sessions[i.chosen];
    Errand errand = Errand::none;
    roomForTwo() ? heading(said("{}: {}", s.name, titleOf(state, s)), 1.15F) : void();
    words(said(tr("Session {}, {}"), s.number, s.test ? tr("test") : tr("practice")), quiet);
    if (s.total) {
        words(said(tr("{:.0f} of 100 points"), *s.total));
    }
    if (!s.record.empty() && ImGui::Button(tr("See it again"))) {
        i.watched = s.record;
        i.watchedTitle = titleOf(state, s);
        errand = Errand::seeKept;
    }
    ImGui::Spacing();
    words(tr("Global rating, 1 (poor) to 5 (excellent)"));
    for (int rating = 0; rating <= 5; ++rating) {
        ImGui::PushID(rating);
        ImGui::RadioButton(rating == 0 ? tr("none") : std::to_string(rating).c_str(), &i.rating, rating);
        ImGui::PopID();
        besideIfRoom("5     ");
    }
    ImGui::NewLine();
    words(tr("Note"));
    drawNote(i.note);
    noteTyped(state);
    const bool changed = hasDraft(i, s);
    ImGui::BeginDisabled(!changed);
    if (ImGui::Button(fitted(tr("Keep note and rating")).c_str())) {
        errand = Errand::keepNote;
    }
    ImGui::EndDisabled();
    if (changed) {
        words(tr("Not kept yet."), orange);
    }
    return errand;
}

Errand drawSessions(State& state)
{
    if (state.instructor.everybody.sessions.empty()) {
        words(tr("No session was kept yet: choose who trains before a session begins."), quiet);
        return Errand::none;
    }
    if (roomForTwo()) {
        beginPart("sessions", 0.45F * ImGui::GetContentRegionAvail().x, 0);
        drawKeptList(state);
        endPart();
        ImGui::SameLine();
    } else {
        drawKeptChoice(state);
    }
    beginPart("kept", 0, 0);
    const Errand errand = drawKept(state);
    endPart();
    return errand;
}

void drawMembers(State& state)
{
    for (std::size_t n = 0; n < state.people.size(); ++n) {
        const std::string& name = state.people[n].name;
        const int now = groupOf(state.instructor, name);
        ImGui::PushID(static_cast<int>(n));
        rollsAsOne() ? words(name) : void();
        for (int group = 0; group <= 2; ++group) {
            const std::string label = group == 0 ? tr("in none") : said(tr("group {}"), group);
            group == 0 ? void() : besideIfRoom(label + "    ");
            const Rgb mark = groupColour(static_cast<std::size_t>(std::max(group, 1) - 1));
            ImGui::PushStyleColor(ImGuiCol_CheckMark,
                                  group == 0 ? ImGui::GetStyle().Colors[ImGuiCol_CheckMark] : vec(mark));
            if (ImGui::RadioButton(label.c_str(), now == group)) {
                putIntoGroup(state, name, group);
            }
            ImGui::PopStyleColor();
        }
        if (!rollsAsOne()) {
            ImGui::SameLine();
            ImGui::TextUnformatted(drawable(name).c_str());
        }
        ImGui::PopID();
    }
}

Errand drawChoiceOfGroups(State& state)
{
    Instructor& i = state.instructor;
    drawMembers(state);
    const auto at = std::ranges::find(state.cases, i.caseId, &CaseEntry::id);
    const std::string label = fieldLabel(tr("Sessions"), 17 * ImGui::GetFontSize());  // sets the width
    const std::size_t chosen =
        at == state.cases.end() ? 0 : static_cast<std::size_t>(at - state.cases.begin()) + 1;  // 0: all cases
    const auto title = [&](std::size_t n) { return n == 0 ? tr("of all cases") : state.cases[n - 1].title; };
    if (const auto now = choice(label, title(chosen), state.cases.size() + 1, chosen, title)) {
        compareCase(state, *now == 0 ? "" : state.cases[*now - 1].id);
    }
    const bool compare = buttonBeside(tr("Compare"));
    i.asPage = buttonBeside(tr("Compare, as a page too"));
    return compare || i.asPage ? Errand::compareGroups : Errand::none;
}

void drawDifferences(const Comparison& c)
{
    const float em = ImGui::GetFontSize();
    // In a narrow window the table rolls by itself.
    const bool one = rollsAsOne() || !roomForTwo();
    const ImGuiTableFlags flags = ImGuiTableFlags_RowBg | ImGuiTableFlags_SizingStretchProp |
                                  (one ? ImGuiTableFlags_ScrollX | ImGuiTableFlags_ScrollY : 0);
    if (!ImGui::BeginTable("compared", 5, flags, {0, one ? 9 * em : 0}, one ? 40 * em : 0)) {
        return;
    }
    ImGui::TableSetupColumn(tr("Measure"));
    for (std::size_t g = 0; g < 2; ++g) {
        ImGui::TableSetupColumn(said("{} (n = {})", c.names[g], c.sessions[g]).c_str());
    }
    ImGui::TableSetupColumn(tr("Cliff's delta"));
    ImGui::TableSetupColumn(tr("each session"), ImGuiTableColumnFlags_WidthFixed, 12 * em);
    ImGui::TableHeadersRow();
    for (const ComparedMeasure& m : c.measures) {
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        words(m.unit.empty() ? m.label : m.label + " [" + m.unit + "]");
        for (std::size_t g = 0; g < 2; ++g) {
            ImGui::TableNextColumn();
            words(inWords(m.groups[g], m.decimals), groupColour(g));
        }
        ImGui::TableNextColumn();
        words(m.effect ? said("{:+.2Lf}", base::printable(*m.effect, 2)) : "-");
        ImGui::TableNextColumn();
        drawSpreads(m, 12 * em, 1.8F * em);
    }
    ImGui::EndTable();
    words(
        tr("Medians with quartiles; dots are sessions. Cliff's delta: how much more often a value of the first group lies "
           "above one of the second than below it, -1 to 1."),
        quiet);
}

void drawComparison(const Comparison& c)
{
    if (!c.measures.empty()) {
        drawDifferences(c);
    }
    if (!c.same.empty()) {
        words(said(tr("The same in all sessions: {}."), fmt::format("{}", fmt::join(c.same, ", "))));
    }
}

Errand drawGroups(State& state)
{
    if (state.people.size() < 2) {
        words(tr("There are fewer than two profiles: choose who trains before a session begins."), quiet);
        return Errand::none;
    }
    const Errand errand = drawChoiceOfGroups(state);
    if (state.instructor.comparison.names.size() == 2) {
        drawComparison(state.instructor.comparison);
    }
    return errand;
}

}  // namespace

Errand drawInstructor(State& state)
{
    const char* const headings[]{tr("What are they doing?"), tr("What have they done?"), tr("How do groups differ?")};
    roomForTwo() ? heading(headings[static_cast<std::size_t>(state.instructor.page)]) : void();
    int page = static_cast<int>(state.instructor.page);
    const std::pair<const char*, InstructorPage> pages[]{{tr("Sessions that run"), InstructorPage::live},
                                                         {tr("Sessions that were kept"), InstructorPage::sessions},
                                                         {tr("Compare groups"), InstructorPage::groups}};
    bool first = true;
    for (const auto& [label, which] : pages) {
        first ? void() : besideIfRoom(std::string(label) + "    ");
        first = false;
        if (radio(label, page == static_cast<int>(which))) {
            page = static_cast<int>(which);
        }
    }
    const bool turned = page != static_cast<int>(state.instructor.page);
    state.instructor.page = static_cast<InstructorPage>(page);
    turned ? (state.notice.clear(), state.told.clear()) : void();
    beginPart("page", 0, -3.4F * ImGui::GetFontSize());
    Errand errand = Errand::none;
    switch (state.instructor.page) {
        case InstructorPage::live:
            errand = drawLive(state);
            break;
        case InstructorPage::sessions:
            errand = drawSessions(state);
            break;
        case InstructorPage::groups:
            errand = drawGroups(state);
            break;
    }
    endPart();
    return errand == Errand::none && turned ? Errand::loadEverybody : errand;
}

}  // namespace palpate::trainer
