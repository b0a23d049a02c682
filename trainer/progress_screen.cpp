#include <trainer/charts.h>
#include <trainer/widgets.h>

#include <base/said.h>

#include <algorithm>
#include <array>
#include <string>

namespace palpate::trainer {

namespace {

using base::said;
using base::tr;
using Standing = ExerciseEntry::Standing;

Rgb colourOf(Standing standing)
{
    constexpr std::array colours{quiet, quiet, skyBlue, green, orange};  // locked, open, next, reached, refresh
    return colours[static_cast<std::size_t>(standing)];
}

std::string standingOf(const ExerciseEntry& e)
{
    return said(base::trn("{}, {} session", "{}, {} sessions", static_cast<unsigned long>(e.sessions)), inWords(e.standing),
                e.sessions);
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
                errand = advance(state);
            }
        }
        if (entered && state.exerciseShown == i) {
            ImGui::SetKeyboardFocusHere(-1);
            ImGui::SetScrollHereY();
        } else if (ImGui::IsItemFocused() && ImGui::GetIO().NavVisible && state.exerciseShown != i) {
            state.exerciseShown = i;
            state.curveShown = 0;
        }
        drawRow(at, said("{}. {}", ++number, e.title), standingOf(e),
                state.exerciseShown == i ? Rgb{1, 1, 1} : colourOf(e.standing));
        ImGui::PopID();
    }
    return errand;
}

// The same where there is no room for a list: one of them, and the others behind a button.
void chooseExercise(State& state)
{
    const auto& all = state.progress.exercises;
    const auto titleOf = [&](std::size_t i) {
        const std::string& of = all[i].curriculum;
        const auto before = std::count_if(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(i),
                                          [&of](const ExerciseEntry& e) { return e.curriculum == of; });
        return said("{}. {}", before + 1, all[i].title);
    };
    const std::size_t shown = std::min(state.exerciseShown, all.size() - 1);
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x);
    if (!ImGui::BeginCombo("##exercises", preview(titleOf(shown)).c_str(), ImGuiComboFlags_HeightLargest)) {
        return;
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (i == 0 || all[i - 1].curriculum != all[i].curriculum) {
            ImGui::TextColored(vec(skyBlue), "%s", all[i].curriculumTitle.c_str());
        }
        ImGui::PushID(static_cast<int>(i));
        if (ImGui::Selectable((titleOf(i) + ": " + standingOf(all[i])).c_str(), i == shown)) {
            state.exerciseShown = i;
            state.curveShown = 0;
        }
        ImGui::PopID();
    }
    ImGui::EndCombo();
}

// One measure after the other, each with its level; the charts that tell whether somebody has learnt it.
void drawCurvesOf(State& state, const ExerciseEntry& e, float wide, float high)
{
    const std::size_t shown = std::min(state.curveShown, e.curves.size() - 1);
    const auto label = [&](std::size_t i) {
        const Curve& c = e.curves[i];
        return c.unit.empty() ? c.label : c.label + " [" + c.unit + "]";
    };
    ImGui::SetNextItemWidth(std::min(20 * ImGui::GetFontSize(), wide));
    state.curveShown = choice("##measure", label(shown), e.curves.size(), shown, label).value_or(state.curveShown);
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
    roomForTwo() ? heading(e.title, 1.15F) : void();
    words(e.next ? said(tr("Next. {}"), reasonFor(e)) : reasonFor(e), colourOf(e.standing));
    const auto at = std::ranges::find(state.cases, e.caseId, &CaseEntry::id);
    if (at != state.cases.end() && roomForTwo()) {
        words(said(tr("Case: {}"), at->title), quiet);
    }
    if (e.sessions == 0 || e.curves.empty()) {
        words(tr("There is no session of it yet. It asks for:"));
        for (const std::string& level : levelsInWords(e)) {
            words("- " + level);
        }
        return;
    }
    const float wide = ImGui::GetContentRegionAvail().x, em = ImGui::GetFontSize();
    drawCurvesOf(state, e, wide, std::max(roomForTwo() ? 18 * em : 14 * em, ImGui::GetContentRegionAvail().y - 5.2F * em));
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
    if (ImGui::Button(fitted(write).c_str())) {
        errand = Errand::writeProgress;
    }
    if (state.progress.exercises.empty()) {
        words(tr("There is no curriculum."));
        return errand;
    }
    Errand begun = Errand::none;
    if (roomForTwo()) {
        beginPart("exercises", 0.34F * wide, -3.4F * em);
        begun = drawExercises(state, entered);
        endPart();
        ImGui::SameLine();
    } else {
        chooseExercise(state);
    }
    beginPart("exercise", 0, -3.4F * em);
    drawExercise(state);
    endPart();
    return begun != Errand::none ? begun : errand;
}

}  // namespace palpate::trainer
