#include <trainer/charts.h>
#include <trainer/widgets.h>

#include <base/said.h>

#include <algorithm>
#include <string>

namespace palpate::trainer {

namespace {

using base::said;
using base::tr;
using Standing = ExerciseEntry::Standing;

Rgb colourOf(Standing standing)
{
    switch (standing) {
        case Standing::reached:
            return green;
        case Standing::refresh:
            return orange;
        case Standing::next:
            return skyBlue;
        default:
            return quiet;
    }
}

// The exercises of all curricula, with where one stands in each.
Errand drawExercises(State& state, bool entered)
{
    const auto& all = state.progress.exercises;
    Errand errand = Errand::none;
    int number = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
        const ExerciseEntry& e = all[i];
        if (i == 0 || all[i - 1].curriculum != e.curriculum) {
            words(e.curriculumTitle, skyBlue);
            number = 0;
        }
        ImGui::PushID(static_cast<int>(i));
        const float high = 2 * ImGui::GetTextLineHeightWithSpacing();
        const ImVec2 at = ImGui::GetCursorPos();
        if (ImGui::Selectable("##exercise", state.exerciseShown == i, ImGuiSelectableFlags_AllowDoubleClick, {0, high})) {
            state.curveShown = state.exerciseShown == i ? state.curveShown : 0;
            state.exerciseShown = i;
            if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left) || enterPressed()) {
                errand = goOn(state);
            }
        }
        if (entered && state.exerciseShown == i) {
            ImGui::SetKeyboardFocusHere(-1);
            ImGui::SetScrollHereY();
        } else if (ImGui::IsItemFocused() && ImGui::GetIO().NavVisible && state.exerciseShown != i) {
            state.exerciseShown = i;
            state.curveShown = 0;
        }
        const ImVec2 next = ImGui::GetCursorPos();
        ImGui::SetCursorPos({at.x + 0.4F * ImGui::GetFontSize(), at.y});
        ImGui::BeginGroup();
        ImGui::TextUnformatted(said("{}. {}", ++number, e.title).c_str());
        ImGui::TextColored(vec(state.exerciseShown == i ? Rgb{1, 1, 1} : colourOf(e.standing)), "%s",
                           said(base::trn("{}, {} session", "{}, {} sessions", static_cast<unsigned long>(e.sessions)),
                                inWords(e.standing), e.sessions)
                               .c_str());
        ImGui::EndGroup();
        ImGui::SetCursorPos(next);
        ImGui::PopID();
    }
    return errand;
}

// One measure after the other, each with its level; the charts that tell whether somebody has learnt it.
void drawCurvesOf(State& state, const ExerciseEntry& e, float wide, float high)
{
    const std::size_t shown = std::min(state.curveShown, e.curves.size() - 1);
    const auto labelOf = [](const Curve& c) { return c.unit.empty() ? c.label : c.label + " [" + c.unit + "]"; };
    ImGui::SetNextItemWidth(std::min(20 * ImGui::GetFontSize(), wide));
    if (ImGui::BeginCombo("##measure", labelOf(e.curves[shown]).c_str())) {
        for (std::size_t i = 0; i < e.curves.size(); ++i) {
            if (ImGui::Selectable(labelOf(e.curves[i]).c_str(), i == shown)) {
                state.curveShown = i;
            }
        }
        ImGui::EndCombo();
    }
    drawCurves({{&e.curves[shown], skyBlue}}, wide, 0.55F * high);
    words(said(tr("CUSUM: tells who fails {:.0f} % of the time from who fails {:.0f} %"), 100 * e.p0, 100 * e.p1));
    drawCurves({{&e.alarm, orange}, {&e.learning, green}}, wide, 0.45F * high);
}

void drawExercise(State& state)
{
    if (state.exerciseShown >= state.progress.exercises.size()) {
        return;
    }
    const ExerciseEntry& e = state.progress.exercises[state.exerciseShown];
    heading(e.title, 1.15F);
    words(e.next ? said(tr("Next. {}"), reasonFor(e)) : reasonFor(e), colourOf(e.standing));
    const auto at = std::ranges::find(state.cases, e.caseId, &CaseEntry::id);
    if (at != state.cases.end()) {
        words(said(tr("Case: {}"), at->title), quiet);
    }
    if (e.sessions == 0 || e.curves.empty()) {
        words(tr("There is no session of it yet."));
        return;
    }
    const float wide = ImGui::GetContentRegionAvail().x, em = ImGui::GetFontSize();
    drawCurvesOf(state, e, wide, std::max(18 * em, ImGui::GetContentRegionAvail().y - 5.2F * em));
}

}  // namespace

Errand drawProgress(State& state, bool entered)
{
    const float em = ImGui::GetFontSize(), wide = ImGui::GetContentRegionAvail().x;
    heading(state.person);
    ImGui::SameLine();
    Errand errand = Errand::none;
    const char* const write = tr("Page, table and xAPI");
    besideIfRoom(write);
    if (ImGui::Button(write)) {
        errand = Errand::writeProgress;
    }
    if (state.progress.exercises.empty()) {
        words(tr("There is no curriculum."));
        return errand;
    }
    const bool beside = wide > 44 * em;
    ImGui::BeginChild("exercises", {beside ? 0.34F * wide : 0, beside ? -3.4F * em : 7 * em}, false,
                      ImGuiWindowFlags_NavFlattened);
    const Errand begun = drawExercises(state, entered);
    ImGui::EndChild();
    beside ? ImGui::SameLine() : void();
    ImGui::BeginChild("exercise", {0, -3.4F * em}, false, ImGuiWindowFlags_NavFlattened);
    drawExercise(state);
    ImGui::EndChild();
    return begun != Errand::none ? begun : errand;
}

}  // namespace palpate::trainer
