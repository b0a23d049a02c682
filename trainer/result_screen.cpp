#include <trainer/widgets.h>

#include <base/said.h>
#include <base/told_losses.h>

#include <algorithm>

namespace palpate::trainer {

namespace {

using base::said;
using base::tr;

void drawParts(const Result& result)
{
    for (const PartOfScore& part : result.parts) {
        const float fraction = part.most > 0 ? static_cast<float>(part.points / part.most) : 0.0F;
        const bool above = rollsAsOne();
        above ? words(part.name) : void();
        ImGui::ProgressBar(fraction, {above ? ImGui::GetContentRegionAvail().x : 12 * ImGui::GetFontSize(), 0},
                           said(tr("{:.0f} of {:.0f}"), part.points, part.most).c_str());
        if (!above) {
            ImGui::SameLine();
            ImGui::TextUnformatted(part.name.c_str());
        }
    }
}

void drawMeasures(const Result& result)
{
    if (!ImGui::BeginTable("measures", 2, ImGuiTableFlags_RowBg | ImGuiTableFlags_SizingStretchProp)) {
        return;
    }
    for (const auto& [label, value] : result.measures) {
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        words(label);
        ImGui::TableNextColumn();
        words(value);
    }
    ImGui::EndTable();
}

// The largest losses, each with its moment to go to: by a click, or its number.
Errand drawLosses(State& state)
{
    const Result& result = state.result;
    heading(base::headingOfLosses(result.total, result.losses.size()), 1.15F);
    constexpr std::size_t most = 3;
    Errand errand = Errand::none;
    for (std::size_t i = 0; i < std::min(most, result.losses.size()); ++i) {
        const LossOfPoints& loss = result.losses[i];
        ImGui::PushID(static_cast<int>(i));
        words(base::lossInWords(loss.points) + "   " + loss.words);
        if (loss.at) {
            ImGui::BeginDisabled(state.replaying);
            const bool clicked = ImGui::Button(fitted(said(tr("See it, at {:.1Lf} s ({})"), *loss.at, i + 1)).c_str());
            if (clicked || (!state.replaying && ImGui::IsKeyPressed('1' + static_cast<int>(i), false))) {
                errand = debrief(state, loss.at);
            }
            ImGui::EndDisabled();
        }
        ImGui::PopID();
    }
    if (result.losses.size() > most) {
        words(said(tr("These are the {} largest of {}."), most, result.losses.size()), quiet);
    }
    return errand;
}

// What can be done with the session.
struct Choices {
    std::string again, debrief, expert, film;
};

Choices choicesOf(const State& state)
{
    return {tr("Same case again (A)"), tr("See it again: debrief (D)"),
            state.ghosting ? tr("An expert does it ...") : tr("Beside an expert (X)"),
            state.filming ? tr("The film is being made ...") : tr("Film (F)")};
}

// Of drawChoices(), beyond its first row.
float heightOfFurtherRows(const Choices& choices)
{
    const ImGuiStyle& style = ImGui::GetStyle();
    const float room = ImGui::GetContentRegionAvail().x;
    float used = 0, high = 0;
    for (const std::string& label : {choices.again, choices.debrief, choices.expert, choices.film}) {
        const float wide = ImGui::CalcTextSize(label.c_str()).x + 2 * style.FramePadding.x;
        const bool below = used > 0 && used + wide + 2 * style.ItemSpacing.x > room;  // as besideIfRoom()
        high += below ? ImGui::GetFrameHeightWithSpacing() : 0;
        used = used > 0 && !below ? used + style.ItemSpacing.x + wide : wide;
    }
    return high;
}

// By a click or a letter.
Errand drawChoices(State& state, const Choices& choices)
{
    const bool free = !state.replaying && !state.ghosting;
    Errand errand = Errand::none;
    bool first = true;
    const auto choice = [&](const std::string& label, char key, bool now) {
        first ? void() : besideIfRoom(label);
        first = false;
        ImGui::BeginDisabled(!now);
        const bool pressed = ImGui::Button(fitted(label).c_str()) || (now && ImGui::IsKeyPressed(key, false));
        ImGui::EndDisabled();
        return pressed && now;
    };
    if (choice(choices.again, 'A', true)) {
        return again(state);
    }
    if (choice(choices.debrief, 'D', free)) {
        errand = debrief(state);
    }
    if (choice(choices.expert, 'X', free)) {
        errand = Errand::seeExpert;
    }
    if (choice(choices.film, 'F', !state.filming)) {
        errand = Errand::makeFilm;
    }
    return errand;
}

}  // namespace

Errand drawResult(State& state)
{
    const Result& result = state.result;
    const float em = ImGui::GetFontSize();
    if (!result.problem.empty()) {
        heading(tr("The session has no result"));
        words(result.problem, orange);
        return ImGui::Button(tr("Try again")) ? again(state) : Errand::none;
    }
    // Where texts are large, all of it rolls, and what can be done comes before the figures.
    const bool two = roomForTwo();
    const Choices choices = choicesOf(state);
    beginPart("result", 0, two ? -6.6F * em - heightOfFurtherRows(choices) : -3.4F * em);
    heading(said(tr("{:.0f} of 100 points"), result.total), two ? 1.9F : 1.45F);
    words(chosenCase(state).title, quiet);
    if (result.notKept && !state.person.empty()) {
        words(said(tr("This session is not kept for {} and does not count: {}"), state.person, result.fault), orange);
    } else if (!result.fault.empty()) {
        words(result.fault, orange);
    }
    ImGui::Columns(two ? 2 : 1, "halves", false);
    drawParts(result);
    ImGui::Spacing();
    const Errand moment = drawLosses(state);
    Errand chosen = two ? Errand::none : drawChoices(state, choices);
    ImGui::NextColumn();
    drawMeasures(result);
    ImGui::Columns(1);
    two ? endPart() : void();
    if (state.replaying) {
        words(tr("The debrief runs in a window of its own. It may take some seconds to open."), skyBlue);
    } else {
        words(said(tr("Record: {}"), state.files.record.string()), quiet);
    }
    chosen = two ? drawChoices(state, choices) : chosen;
    two ? void() : endPart();
    return moment != Errand::none ? moment : chosen;
}

}  // namespace palpate::trainer
