#include <trainer/screens.h>

#include <trainer/look.h>

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <array>
#include <cstdint>

namespace palpate::trainer {

namespace {

ImVec4 vec(Rgb c)
{
    return {c.r, c.g, c.b, 1};
}

void words(const std::string& text)
{
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(text.c_str());
    ImGui::PopTextWrapPos();
}

void words(const std::string& text, Rgb colour)
{
    ImGui::PushStyleColor(ImGuiCol_Text, vec(colour));
    words(text);
    ImGui::PopStyleColor();
}

void heading(const std::string& text, float scale = 1.45F)
{
    ImGui::SetWindowFontScale(scale);
    words(text);
    ImGui::SetWindowFontScale(1);
}

void drawPicture(const Texture& texture, float wide, float high)
{
    if (texture.id == 0) {
        ImGui::Dummy({wide, high});
        return;
    }
    const float scale = std::min(wide / static_cast<float>(texture.width), high / static_cast<float>(texture.height));
    ImGui::Image(reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(texture.id)),
                 {scale * static_cast<float>(texture.width), scale * static_cast<float>(texture.height)});
}

// What a case is, beside its picture.
void drawCaseFacts(const CaseEntry& c, Rgb facts = skyBlue)
{
    heading(c.title, 1.15F);
    words(fmt::format("{}, difficulty {} of 5 ({});  {}", c.palpation ? "Palpation" : "Core biopsy", c.difficulty,
                      difficultyInWords(c.difficulty),
                      c.best ? fmt::format("best so far {:.0f} of 100", *c.best) : "not done yet"),
          facts);
    words(c.trains);
}

bool enterPressed()
{
    return ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Enter], false);
}

// Whose session it will be: one of the profiles, a new one, or nobody's.
Errand drawPeople(State& state)
{
    const float em = ImGui::GetFontSize();
    Errand errand = Errand::none;
    ImGui::SetNextItemWidth(14 * em);
    if (ImGui::BeginCombo("Who trains", state.person.empty() ? "nobody: no progress is kept" : state.person.c_str())) {
        if (ImGui::Selectable("nobody: no progress is kept", state.person.empty())) {
            state.person.clear();
        }
        for (const std::string& name : state.people) {
            if (ImGui::Selectable(name.c_str(), state.person == name)) {
                state.person = name;
            }
        }
        ImGui::EndCombo();
    }
    ImGui::SameLine();
    ImGui::SetNextItemWidth(12 * em);
    const bool typed =
        ImGui::InputTextWithHint("##name", "a new name", &state.newPerson, ImGuiInputTextFlags_EnterReturnsTrue);
    ImGui::SameLine();
    ImGui::BeginDisabled(state.newPerson.empty());
    if ((ImGui::Button("Add") || typed) && !state.newPerson.empty()) {
        errand = Errand::addPerson;
    }
    ImGui::EndDisabled();
    return errand;
}

Errand drawCases(State& state, const TextureOf& textureOf, bool entered)
{
    heading("Choose a case");
    const float em = ImGui::GetFontSize(), high = 5.4F * em;
    Errand errand = drawPeople(state);
    ImGui::BeginChild("list", {0, -3.4F * em}, false, ImGuiWindowFlags_NavFlattened);
    for (std::size_t i = 0; i < state.cases.size(); ++i) {
        const CaseEntry& c = state.cases[i];
        ImGui::PushID(c.id.c_str());
        const ImVec2 at = ImGui::GetCursorPos();
        if (ImGui::Selectable("##choose", state.chosen == i, ImGuiSelectableFlags_AllowDoubleClick, {0, high})) {
            state.chosen = i;
            if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left) || enterPressed()) {
                errand = goOn(state);
            }
        }
        if (entered && state.chosen == i) {
            ImGui::SetKeyboardFocusHere(-1);
            ImGui::SetScrollHereY();
        } else if (ImGui::IsItemFocused() && ImGui::GetIO().NavActive && ImGui::GetIO().NavVisible) {
            state.chosen = i;
        }
        const ImVec2 next = ImGui::GetCursorPos();
        ImGui::SetCursorPos({at.x + 0.4F * em, at.y + 0.3F * em});
        drawPicture(textureOf(c.picture), 7 * em, high - 0.6F * em);
        ImGui::SetCursorPos({at.x + 7.2F * em, at.y + 0.3F * em});
        ImGui::BeginGroup();
        drawCaseFacts(c, state.chosen == i ? Rgb{1, 1, 1} : skyBlue);
        ImGui::EndGroup();
        ImGui::SetCursorPos(next);
        ImGui::PopID();
    }
    ImGui::EndChild();
    return errand;
}

Errand drawDevices(State& state)
{
    heading("What will you hold?");
    const DeviceCheck& check = state.devices;
    if (!check.done) {
        words("Looking for devices ...", quiet);
    } else {
        words(check.falcon, check.falconReady ? green : orange);
        if (!check.remedy.empty()) {
            words(check.remedy);
        }
    }
    ImGui::Spacing();
    if (ImGui::RadioButton("Mouse: no force in the hand, the picture shows it", !state.useFalcon)) {
        state.useFalcon = false;
    }
    ImGui::BeginDisabled(!check.falconReady);
    if (ImGui::RadioButton("Novint Falcon: you feel the tissue", state.useFalcon)) {
        state.useFalcon = true;
    }
    ImGui::EndDisabled();
    if (state.useFalcon) {
        ImGui::InputTextWithHint("Firmware file", "not needed while it runs", &state.firmware);
        words("Begin with the grip in the middle of its reach, and hold it loosely. The first force comes up slowly.");
    } else {
        ImGui::Spacing();
        words(
            "With the mouse: hold the left button to take the tool; moving the mouse moves it in the plane of the picture, "
            "the wheel along itself. Let go, and the force fades. Every key is listed by ? in the session.");
    }
    ImGui::Spacing();
    return ImGui::Button("Look again") ? Errand::checkDevices : Errand::none;
}

void drawBriefing(State& state, const TextureOf& textureOf)
{
    const CaseEntry& c = chosenCase(state);
    heading(c.title);
    words(c.trains, skyBlue);
    const float em = ImGui::GetFontSize(), wide = ImGui::GetContentRegionAvail().x;
    const Texture texture = textureOf(c.picture);
    const bool beside = wide > 40 * em && texture.id != 0;
    ImGui::BeginChild("briefing", {0, -6.6F * em}, false, ImGuiWindowFlags_NavFlattened);
    if (texture.id != 0) {
        ImGui::BeginGroup();
        drawPicture(texture, beside ? 0.42F * wide : wide, 17 * em);
        ImGui::EndGroup();
    }
    if (beside) {
        ImGui::SameLine(0.45F * wide);
    }
    ImGui::BeginGroup();
    for (std::size_t i = 0; i < c.steps.size(); ++i) {
        words(fmt::format("{}.  {}", i + 1, c.steps[i]));
    }
    ImGui::EndGroup();
    ImGui::EndChild();
    int mode = state.test ? 1 : 0;
    ImGui::RadioButton("Practise: steps and faults in words, planned line", &mode, 0);
    ImGui::SameLine();
    ImGui::RadioButton("Test: without hints", &mode, 1);
    state.test = mode == 1;
    words(fmt::format("As a command: {}", asTyped("palpate", trainArguments(state, {"SESSION.db", "SESSION.json"}))),
          quiet);
}

void drawSession(const State& state)
{
    heading("The session runs in a window of its own");
    words(
        "It may take some seconds to open: the tissue is being built. When you are done, press E there, and the result "
        "appears here.");
    ImGui::Spacing();
    words(state.command, quiet);
}

void drawParts(const Result& result)
{
    for (const PartOfScore& part : result.parts) {
        const float share = part.most > 0 ? static_cast<float>(part.points / part.most) : 0.0F;
        ImGui::ProgressBar(share, {12 * ImGui::GetFontSize(), 0},
                           fmt::format("{:.0f} of {:.0f}", part.points, part.most).c_str());
        ImGui::SameLine();
        ImGui::TextUnformatted(part.name.c_str());
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
        ImGui::TextUnformatted(label.c_str());
        ImGui::TableNextColumn();
        ImGui::TextUnformatted(value.c_str());
    }
    ImGui::EndTable();
}

Errand drawResult(State& state)
{
    const Result& result = state.result;
    const float em = ImGui::GetFontSize(), wide = ImGui::GetContentRegionAvail().x;
    if (!result.problem.empty()) {
        heading("The session has no result");
        words(result.problem, orange);
        return ImGui::Button("Try again") ? again(state) : Errand::none;
    }
    ImGui::BeginChild("result", {0, -6.2F * em}, false, ImGuiWindowFlags_NavFlattened);
    heading(fmt::format("{:.0f} of 100 points", result.total), 1.9F);
    words(chosenCase(state).title, quiet);
    ImGui::Columns(wide > 44 * em ? 2 : 1, "halves", false);
    drawParts(result);
    ImGui::Spacing();
    heading(result.losses.empty() ? "Nothing was lost" : "Where the points went", 1.15F);
    constexpr std::size_t most = 3;
    for (std::size_t i = 0; i < std::min(most, result.losses.size()); ++i) {
        words(fmt::format("-{:.0f}   {}", result.losses[i].points, result.losses[i].words));
    }
    ImGui::NextColumn();
    drawMeasures(result);
    ImGui::Columns(1);
    ImGui::EndChild();
    words("Record: " + state.files.record.string(), quiet);
    Errand errand = Errand::none;
    if (ImGui::Button("Same case again")) {
        errand = again(state);
    }
    ImGui::SameLine();
    ImGui::BeginDisabled(state.replaying);
    if (ImGui::Button("See it again: debrief (D)") || (!state.replaying && ImGui::IsKeyPressed('D', false))) {
        errand = debrief(state);
    }
    ImGui::EndDisabled();
    return errand;
}

// The way through the screens, and the buttons for going on and back.
Errand drawFoot(State& state, bool entered)
{
    const ImGuiIO& io = ImGui::GetIO();
    const float em = ImGui::GetFontSize();
    ImGui::SetCursorPosY(ImGui::GetWindowHeight() - 3.0F * em);
    const bool first = state.screen == Screen::cases, running = state.screen == Screen::session;
    const bool typing = io.WantTextInput;
    Errand errand = Errand::none;
    if (!running) {
        const bool pressed = ImGui::Button(first ? "Quit (Esc)" : "Back (Esc)");
        if (pressed || (!typing && ImGui::IsKeyPressed(io.KeyMap[ImGuiKey_Escape], false))) {
            return goBack(state);
        }
        ImGui::SameLine();
    }
    const std::string label = fmt::format("{}{}", mainButton(state), running ? "" : " (Enter)");
    const float wide = ImGui::CalcTextSize(label.c_str()).x + 2 * ImGui::GetStyle().FramePadding.x;
    ImGui::SetCursorPosX(
        std::max(ImGui::GetCursorPosX(), ImGui::GetWindowWidth() - wide - ImGui::GetStyle().WindowPadding.x));
    ImGui::PushStyleColor(ImGuiCol_Button, vec({0.0F, 0.42F, 0.31F}));
    const bool pressed = ImGui::Button(label.c_str());
    ImGui::PopStyleColor();
    if (entered && !first) {
        ImGui::SetKeyboardFocusHere(-1);
    }
    // Where something has the focus, Enter presses that.
    const bool enter = !running && !ImGui::IsAnyItemFocused() && enterPressed();
    if (pressed || enter) {
        errand = goOn(state);
    }
    return errand;
}

void drawWay(const State& state)
{
    for (std::size_t i = 0; i <= static_cast<std::size_t>(Screen::result); ++i) {
        if (i > 0) {
            ImGui::SameLine();
            ImGui::TextColored(vec(quiet), ">");
            ImGui::SameLine();
        }
        const bool here = i == static_cast<std::size_t>(state.screen);
        ImGui::TextColored(here ? vec(orange) : vec(quiet), "%s", nameOf(static_cast<Screen>(i)));
    }
    ImGui::Separator();
}

}  // namespace

Errand drawScreen(State& state, const TextureOf& textureOf, float width, float height, bool entered)
{
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize({width, height});
    ImGui::Begin("Palpate", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    drawWay(state);
    if (!state.notice.empty()) {
        words(state.notice, orange);
    }
    Errand errand = Errand::none;
    const Screen before = state.screen;
    switch (state.screen) {
        case Screen::cases:
            errand = drawCases(state, textureOf, entered);
            break;
        case Screen::devices:
            errand = drawDevices(state);
            break;
        case Screen::briefing:
            drawBriefing(state, textureOf);
            break;
        case Screen::session:
            drawSession(state);
            break;
        case Screen::result:
            errand = drawResult(state);
            break;
    }
    if (errand == Errand::none && state.screen == before) {
        errand = drawFoot(state, entered);
    }
    ImGui::End();
    return errand;
}

}  // namespace palpate::trainer
