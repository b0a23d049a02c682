#include <trainer/screens.h>

#include <trainer/widgets.h>

#include <base/said.h>

#include <imgui.h>
#include <imgui_internal.h>
#include <imgui_stdlib.h>

#include <algorithm>

namespace palpate::trainer {

namespace {

using base::said;
using base::tr;

constexpr float titleScale = 1.15F;

std::string factsOf(const CaseEntry& c)
{
    const char* const kind = c.palpation ? tr("Palpation") : c.core ? tr("Core biopsy") : tr("Guiding the needle");
    return said(tr("{}, difficulty {} of 5 ({});  {}"), kind, c.difficulty, difficultyInWords(c.difficulty),
                c.best ? said(tr("best so far {:.0f} of 100"), *c.best) : tr("not done yet"));
}

// What a case is, beside its picture.
void drawCaseFacts(const CaseEntry& c, Rgb facts = skyBlue)
{
    heading(c.title, titleScale);
    words(factsOf(c), facts);
    words(c.trains);
}

// Of drawCaseFacts().
float heightOfFacts(const CaseEntry& c, float wide)
{
    const auto high = [&](const std::string& text, float scale) {
        return scale * ImGui::CalcTextSize(text.c_str(), nullptr, false, wide / scale).y + ImGui::GetStyle().ItemSpacing.y;
    };
    return high(c.title, titleScale) + high(factsOf(c), 1) + high(c.trains, 1);
}

// Whose session it will be: one of the profiles, a new one, or nobody's.
Errand drawPeople(State& state)
{
    const float em = ImGui::GetFontSize();
    Errand errand = Errand::none;
    const std::string nobody = tr("nobody: no progress is kept");
    const std::string label = fieldLabel(tr("Who trains"), (roomForTwo() ? 17 : 11) * em);
    const PersonEntry* const before = chosenPerson(state);
    const std::size_t chosen = before == nullptr ? 0 : static_cast<std::size_t>(before - state.people.data()) + 1;
    const auto name = [&](std::size_t n) { return n == 0 ? nobody : state.people[n - 1].name; };
    if (const auto now =
            choice(label, state.person.empty() ? nobody : state.person, state.people.size() + 1, chosen, name)) {
        state.person = *now == 0 ? "" : state.people[*now - 1].name;
        errand = Errand::choosePerson;
    }
    if (PersonEntry* const person = chosenPerson(state)) {
        besideIfRoom(std::string(tr("Left-handed")) + "    ");
        errand = ImGui::Checkbox(tr("Left-handed"), &person->leftHanded) ? Errand::changeHand : errand;
    }
    besideIfRoom(std::string(tr("a new name")) + (roomForTwo() ? "           " : ""));
    ImGui::SetNextItemWidth((roomForTwo() ? 9 : 8) * em);
    // How far the last name had rolled is of no use to the hint.
    if (ImGuiInputTextState* const field = ImGui::GetInputTextState(ImGui::GetID("##name"));
        field != nullptr && state.newPerson.empty()) {
        field->ScrollX = 0;
    }
    const bool typed =
        ImGui::InputTextWithHint("##name", tr("a new name"), &state.newPerson, ImGuiInputTextFlags_EnterReturnsTrue);
    besideIfRoom(tr("Add"));
    ImGui::BeginDisabled(state.newPerson.empty());
    if ((ImGui::Button(tr("Add")) || typed) && !state.newPerson.empty()) {
        errand = Errand::addPerson;
    }
    ImGui::EndDisabled();
    ImGui::BeginDisabled(state.person.empty());
    if (buttonBeside(tr("Progress"))) {
        errand = showProgress(state);
    }
    ImGui::EndDisabled();
    if (buttonBeside(tr("Instructor"))) {
        errand = showInstructor(state);
    }
    besideIfRoom(tr("Settings"));
    const Errand settings = drawSettings(state);
    return errand != Errand::none ? errand : settings;
}

Errand drawCases(State& state, const TextureOf& textureOf, bool entered)
{
    // Large letters need the room for the list, and break its lines.
    roomForTwo() ? heading(tr("Choose a case")) : void();
    const float em = ImGui::GetFontSize(), least = rollsAsOne() ? 0 : (roomForTwo() ? 5.4F : 6.6F) * em;
    const float beside = rollsAsOne() ? 0.4F * em : 7.2F * em;  // a picture, where there is room for one
    Errand errand = drawPeople(state);
    beginPart("list", 0, -3.4F * em);
    const float wide = ImGui::GetContentRegionAvail().x - beside;
    for (std::size_t i = 0; i < state.cases.size(); ++i) {
        const CaseEntry& c = state.cases[i];
        ImGui::PushID(c.id.c_str());
        const ImVec2 at = ImGui::GetCursorPos();
        const float high = std::max(least, heightOfFacts(c, wide) + 0.3F * em);
        if (ImGui::Selectable("##choose", state.chosen == i, ImGuiSelectableFlags_AllowDoubleClick, {0, high})) {
            state.chosen = i;
            if (ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left) || enterPressed()) {
                errand = advance(state);
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
        rollsAsOne() ? void() : drawPicture(textureOf(c.picture), 6.6F * em, high - 0.6F * em);
        ImGui::SetCursorPos({at.x + beside, at.y + 0.3F * em});
        ImGui::BeginGroup();
        drawCaseFacts(c, state.chosen == i ? Rgb{1, 1, 1} : skyBlue);
        ImGui::EndGroup();
        ImGui::SetCursorPos(next);
        ImGui::PopID();
    }
    endPart();
    return errand;
}

// What can be done with the device before a session: look again, feel a force, try the hand.
Errand drawDeviceTests(State& state)
{
    Errand errand = Errand::none;
    if (ImGui::Button(tr("Look again"))) {
        errand = Errand::checkDevices;
    }
    besideIfRoom(tr("Try the hand for 30 s"));
    ImGui::BeginDisabled(state.trying || state.pushing);
    if (ImGui::Button(fitted(tr("Try the hand for 30 s")).c_str())) {
        errand = Errand::tryHand;
    }
    if (state.useFalcon && buttonBeside(tr("Force test: 1 N"))) {
        errand = Errand::testForce;
    }
    ImGui::EndDisabled();
    if (state.trying) {
        words(
            tr("The trial runs in a window of its own: it tells what to do, step by step. Nothing is recorded or scored."),
            skyBlue);
    }
    if (state.pushing) {
        words(
            tr("Hold the grip loosely and press its centre button: it pushes towards you with 1 N, about the weight of an "
               "apple."),
            skyBlue);
    } else if (!state.devices.push.empty()) {
        words(state.devices.push, state.devices.pushed ? green : orange);
    }
    return errand;
}

Errand drawDevices(State& state)
{
    heading(tr("What will you hold?"));
    beginPart("device", 0, -3.4F * ImGui::GetFontSize());
    const DeviceCheck& check = state.devices;
    if (!check.done) {
        words(tr("Looking for devices ..."), quiet);
    } else {
        words(check.falcon, check.falconReady ? green : orange);
        if (!check.remedy.empty()) {
            words(check.remedy);
        }
    }
    ImGui::Spacing();
    if (radio(tr("Mouse or keys: no force in the hand, the picture shows it"), !state.useFalcon)) {
        state.useFalcon = false;
    }
    ImGui::BeginDisabled(!check.falconReady);
    if (radio(tr("Novint Falcon: you feel the tissue"), state.useFalcon)) {
        state.useFalcon = true;
    }
    ImGui::EndDisabled();
    if (state.useFalcon) {
        const std::string label = fieldLabel(tr("Firmware file"), 0.65F * ImGui::GetContentRegionAvail().x);
        ImGui::InputTextWithHint(label.c_str(), tr("not needed while it runs"), &state.firmware);
        words(tr("Begin with the grip in the middle of its reach, and hold it loosely. The first force comes up slowly."));
    } else {
        ImGui::Spacing();
        words(tr(
            "With the mouse: hold the button of your index finger to take the tool; moving the mouse moves it in the plane "
            "of the picture, the wheel along itself: forward pushes it in. By keys: Enter takes it and lets it go, arrows "
            "move it, Page down pushes it in. Let go, and the force fades. Every key is listed by ? in the session."));
    }
    if (check.falconReady && state.gripReady) {
        words(tr("The buttons of the Falcon's grip work this window: forward presses what is marked, right and left mark "
                 "the next and the one before, centre goes back."),
              skyBlue);
    }
    ImGui::Spacing();
    const Errand errand = drawDeviceTests(state);
    endPart();
    return errand;
}

void drawSteps(const std::vector<std::string>& steps)
{
    ImGui::BeginGroup();
    for (std::size_t i = 0; i < steps.size(); ++i) {
        words(said("{}.  {}", i + 1, steps[i]));
    }
    ImGui::EndGroup();
}

void drawBriefing(State& state, const TextureOf& textureOf)
{
    const CaseEntry& c = chosenCase(state);
    heading(c.title);
    const float em = ImGui::GetFontSize(), wide = ImGui::GetContentRegionAvail().x;
    beginPart("briefing", 0, -3.4F * em);
    words(c.trains, skyBlue);
    const Texture texture = state.test ? Texture() : textureOf(c.picture);  // which shows the planned line
    const bool beside = wide > 40 * em && texture.id != 0;
    if (beside) {
        ImGui::BeginGroup();
        drawPicture(texture, 0.42F * wide, 17 * em);
        ImGui::EndGroup();
        ImGui::SameLine(0.45F * wide);
    }
    drawSteps(stepsOf(state));
    if (radio(tr("Practise: steps and faults in words, planned line"), !state.test)) {
        state.test = false;
    }
    besideIfRoom(std::string(tr("Test: without hints")) + "    ");
    if (radio(tr("Test: without hints"), state.test)) {
        state.test = true;
    }
    if (state.test && !c.palpation) {
        words(tr("In a test nothing shows the planned entry and line: choose the way yourself."));
    }
    if (!state.person.empty() && state.exercise.empty()) {
        words(
            said(tr("Free practice: kept for {}, but it counts for no exercise. Those are under Progress."), state.person),
            skyBlue);
    }
    words(said(tr("As a command: {}"), asTyped("palpate", trainArguments(state, {"SESSION.db", "SESSION.json"}))), quiet);
    if (!beside && texture.id != 0) {
        drawPicture(texture, wide, 17 * em);
    }
    endPart();
}

void drawSession(const State& state)
{
    heading(tr("The session runs in a window of its own"));
    words(
        tr("It may take some seconds to open: the tissue is being built. When you are done, press E there, and the result "
           "appears here. S pauses."));
    ImGui::Spacing();
    words(state.command, quiet);
}

// What the buttons for going on and back say: without their keys where there is no room for them, and one below the other
// where there is no room beside each other.
struct Foot {
    std::string back, main;
    bool stacked = false;
};

Foot footOf(const State& state)
{
    const bool first = state.screen == Screen::cases, running = state.screen == Screen::session;
    Foot foot{running ? ""
              : first ? tr("Quit (Esc)")
                      : tr("Back (Esc)"),
              running ? std::string(mainButton(state)) : said(tr("{} (Enter)"), mainButton(state))};
    const ImGuiStyle& style = ImGui::GetStyle();
    const auto fits = [&] {
        const float both = ImGui::CalcTextSize(foot.back.c_str()).x + ImGui::CalcTextSize(foot.main.c_str()).x;
        return both + 4 * style.FramePadding.x + style.ItemSpacing.x <=
               ImGui::GetIO().DisplaySize.x - 2 * style.WindowPadding.x;
    };
    if (!fits()) {
        foot.back = withoutKey(foot.back);
        foot.main = running ? foot.main : withoutKey(foot.main);
    }
    foot.stacked = !running && !fits();
    return foot;
}

float heightOf(const Foot& foot)
{
    return (foot.stacked ? 2.0F : 1.0F) * ImGui::GetFrameHeightWithSpacing();
}

// The buttons for going on and back.
Errand drawFoot(State& state, bool entered)
{
    const ImGuiIO& io = ImGui::GetIO();
    const float em = ImGui::GetFontSize();
    const Foot foot = footOf(state);
    const float high = rollsAsOne() ? heightOf(foot) + ImGui::GetStyle().WindowPadding.y : 3.0F * em;
    ImGui::SetCursorPosY(std::max(ImGui::GetCursorPosY(), ImGui::GetWindowHeight() - high));
    const bool first = state.screen == Screen::cases, running = state.screen == Screen::session;
    // Esc that closes a popup closes it before it is seen here.
    const bool typing = io.WantTextInput || state.popup || ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup);
    Errand errand = Errand::none;
    if (!running) {
        const bool pressed = ImGui::Button(foot.back.c_str());
        if (pressed || (!typing && ImGui::IsKeyPressed(io.KeyMap[ImGuiKey_Escape], false))) {
            return goBack(state);
        }
        foot.stacked ? void() : ImGui::SameLine();
    }
    const std::string label = fitted(foot.main);
    const float wide = ImGui::CalcTextSize(label.c_str()).x + 2 * ImGui::GetStyle().FramePadding.x;
    ImGui::SetCursorPosX(
        std::max(ImGui::GetCursorPosX(), ImGui::GetWindowWidth() - wide - ImGui::GetStyle().WindowPadding.x));
    ImGui::PushStyleColor(ImGuiCol_Button, vec({0.0F, 0.42F, 0.31F}));
    const bool pressed = ImGui::Button(label.c_str());
    ImGui::PopStyleColor();
    // A list beside what is chosen of it has the focus itself.
    if (entered && !first && (state.screen != Screen::progress || !roomForTwo())) {
        ImGui::SetKeyboardFocusHere(-1);
    }
    // Where something has the focus, Enter presses that.
    const bool enter = !running && !typing && !ImGui::IsAnyItemFocused() && enterPressed();
    if (pressed || enter) {
        errand = advance(state);
    }
    return errand;
}

// What is said beside a screen, and where: its lower edge and sides, and how high it is.
struct Notice {
    std::string text;
    float left = 0, wide = 0, bottom = 0, high = 0;
};

// Between the buttons of the foot where there is room, else above them.
Notice placeOfNotice(const State& state)
{
    const std::string between = state.notice.empty() || state.told.empty() ? "" : "\n";
    Notice place{drawable(state.notice + between + state.told)};
    if (place.text.empty()) {
        return place;
    }
    const ImGuiStyle& style = ImGui::GetStyle();
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const float em = ImGui::GetFontSize(), side = style.WindowPadding.x;
    const Foot foot = footOf(state);
    const auto button = [&](const std::string& label) {
        return label.empty() ? 0
                             : ImGui::CalcTextSize(label.c_str()).x + 2 * style.FramePadding.x + 2 * style.ItemSpacing.x;
    };
    const float free = size.x - 2 * side - button(foot.back) - button(foot.main);
    const bool inFoot = !rollsAsOne() && !foot.stacked && free > 24 * em;
    place.left = inFoot ? side + button(foot.back) : side;
    place.wide = inFoot ? free : size.x - 2 * side;
    place.high = ImGui::CalcTextSize(place.text.c_str(), nullptr, false, place.wide - 2 * side).y + 0.6F * em;
    const float beside = size.y - 3 * em + 0.5F * (ImGui::GetFrameHeight() + place.high);  // in the middle of the buttons
    const float above = size.y - (rollsAsOne() ? heightOf(foot) + 2 * style.WindowPadding.y : 3 * em);
    place.bottom = inFoot ? std::min(beside, size.y - 0.3F * em) : above;
    return place;
}

// Over the screen and not in it: nothing moves below the mouse.
void drawNotice(const State& state)
{
    const Notice place = placeOfNotice(state);
    if (place.text.empty()) {
        return;
    }
    ImGui::SetNextWindowPos({place.left, std::max(0.0F, place.bottom - place.high)});
    ImGui::SetNextWindowSize({place.wide, std::min(place.high, place.bottom)});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {ImGui::GetStyle().WindowPadding.x, 0.3F * ImGui::GetFontSize()});
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {0, 0});
    ImGui::Begin("notice", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoInputs | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoFocusOnAppearing);
    state.notice.empty() ? void() : words(state.notice, orange);
    state.told.empty() ? void() : words(state.told);
    ImGui::End();
    ImGui::PopStyleVar(2);
}

void drawWay(const State& state)
{
    if (state.screen > Screen::result) {
        ImGui::TextColored(vec(orange), "%s", nameOf(state.screen));
        ImGui::Separator();
        return;
    }
    constexpr std::size_t last = static_cast<std::size_t>(Screen::result);
    std::string all;
    for (std::size_t i = 0; i <= last; ++i) {
        all += nameOf(static_cast<Screen>(i));
    }
    const float between = ImGui::CalcTextSize(">").x + 2 * ImGui::GetStyle().ItemSpacing.x;
    if (ImGui::CalcTextSize(all.c_str()).x + static_cast<float>(last) * between > ImGui::GetContentRegionAvail().x) {
        const std::string here =
            said("{} / {}  {}", static_cast<std::size_t>(state.screen) + 1, last + 1, nameOf(state.screen));
        ImGui::TextColored(vec(orange), "%s", here.c_str());
        ImGui::Separator();
        return;
    }
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
    // Where letters are large for the window its edges are narrow, and all but the foot rolls.
    const bool one = rollsAsOne();
    const float em = ImGui::GetFontSize(), narrow = 0.4F * em;
    if (one) {
        for (const ImGuiStyleVar which :
             {ImGuiStyleVar_WindowPadding, ImGuiStyleVar_FramePadding, ImGuiStyleVar_ItemSpacing}) {
            ImGui::PushStyleVar(which, {narrow, narrow});
        }
    }
    ImGui::Begin("Palpate", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    ImGui::PushItemFlag(ImGuiItemFlags_Inputable, true);  // Tab goes to all, not to text alone
    drawWay(state);
    if (one) {
        const float foot = heightOf(footOf(state)) + ImGui::GetStyle().ItemSpacing.y;
        ImGui::BeginChild("all", {0, -foot}, false, ImGuiWindowFlags_NavFlattened);
        entered ? ImGui::SetScrollY(0) : void();
    }
    entered = entered && !state.popup;  // which keeps the focus
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
        case Screen::progress:
            errand = drawProgress(state, entered);
            break;
        case Screen::instructor:
            errand = drawInstructor(state);
            break;
    }
    if (one) {
        const float over = placeOfNotice(state).high;  // what it lies over can be rolled up
        over > 0 ? ImGui::Dummy({0, over}) : void();
        ImGui::EndChild();
    }
    if (errand == Errand::none && state.screen == before) {
        errand = drawFoot(state, entered);
    }
    state.popup = ImGui::IsPopupOpen("", ImGuiPopupFlags_AnyPopup);
    ImGui::PopItemFlag();
    ImGui::End();
    drawNotice(state);
    one ? ImGui::PopStyleVar(3) : void();
    return errand;
}

}  // namespace palpate::trainer
