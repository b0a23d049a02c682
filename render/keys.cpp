#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <render/controls.h>

#include <vtkCommand.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::render {
namespace {

constexpr double turnStep = 2.0 / 180.0 * 3.14159265358979323846;  // of an arrow key [rad]
constexpr double opacityStep = 1.25;
constexpr double tick = 1e-3, frame = 1.0 / 30, leap = 1.0;  // steps through a record [s]

// Windows in which a key means something: of a session, of one whose hand is the mouse, of a record.
constexpr unsigned session = 1, hand = 2, record = 4, every = session | hand | record;

SliceLook following(SliceLook look)
{
    return look == SliceLook::tinted ? SliceLook::image : look == SliceLook::image ? SliceLook::tissue : SliceLook::tinted;
}

}  // namespace

// A new key is a row here, and in docs/viewer.md. A row without keys tells what the mouse does (controls.cpp).
const std::vector<Controls::Key> Controls::keys{
    {hand, "hold left", "take the tool and move it in the plane of the picture", {}, nullptr},
    {hand, "  wheel", "push it along itself, or pull it back: 1 mm a notch", {}, nullptr},
    {hand, "  Ctrl wheel", "move it into the picture, or out of it: 1 mm a notch", {}, nullptr},
    {hand, "  Shift", "five times finer, mouse and keys", {}, nullptr},
    {hand,
     "Enter",
     "take the tool, let it go: then keys move it as the mouse does",
     {{GLFW_KEY_ENTER, 0, once}, {GLFW_KEY_KP_ENTER, 0, once}},
     [](Controls& c, const Press&) { c.toggleHold(); }},
    {hand,
     "  right left",
     "move it by 1 mm in the picture; with Ctrl turn it by 2 degrees",
     {{GLFW_KEY_RIGHT}, {GLFW_KEY_LEFT, 0, -1}},
     [](Controls& c, const Press& p) {
         const auto screen = c.screen();
         p.control ? c.hand_.turn(screen.into, p.sign * turnStep) : c.step(screen.right, p.sign, p.shift);
     }},
    {hand,
     "  up down",
     "move it by 1 mm in the picture; with Ctrl turn it by 2 degrees",
     {{GLFW_KEY_UP}, {GLFW_KEY_DOWN, 0, -1}},
     [](Controls& c, const Press& p) {
         const auto screen = c.screen();
         p.control ? c.hand_.turn(screen.right, p.sign * turnStep) : c.step(screen.up, p.sign, p.shift);
     }},
    {hand,
     "  Page down, up",
     "push it 1 mm along itself, pull it back; with Ctrl into the picture",
     {{GLFW_KEY_PAGE_DOWN}, {GLFW_KEY_PAGE_UP, 0, -1}},
     [](Controls& c, const Press& p) { c.step(p.control ? c.screen().into : c.hand_.axis(), p.sign, p.shift); }},
    {hand,
     "  Space",
     "fire the biopsy gun; so does the right button",
     {{GLFW_KEY_SPACE, 0, once}},
     [](Controls& c, const Press&) { c.hand_.fire(); }},
    {hand, "M", "mark the place of the tool", {{0, 'm', once}}, [](Controls& c, const Press&) { c.hand_.mark(); }},
    {hand, "E", "end the session", {{0, 'e', once}}, [](Controls& c, const Press&) { c.hand_.end(); }},
    {hand, "hold right", "turn the camera", {}, nullptr},
    {record,
     "Space",
     "pause, play",
     {{GLFW_KEY_SPACE, 0, once}},
     [](Controls& c, const Press&) { c.playback_->paused = !c.playback_->paused; }},
    {record,
     ". ,",
     "one tick on, back; with Shift a frame",
     {{0, '.'}, {0, ',', -1}},
     [](Controls& c, const Press& p) {
         c.playback_->paused = true;
         c.jumpBy(p.sign * (p.shift ? frame : tick));
     }},
    {record,
     "right left",
     "a second on, back",
     {{GLFW_KEY_RIGHT}, {GLFW_KEY_LEFT, 0, -1}},
     [](Controls& c, const Press& p) { c.jumpBy(p.sign * leap); }},
    {record,
     "up down",
     "twice as fast, half as fast",
     {{GLFW_KEY_UP}, {GLFW_KEY_DOWN, 0, -1}},
     [](Controls& c, const Press& p) {
         c.playback_->speed = std::clamp(c.playback_->speed * (p.sign > 0 ? 2.0 : 0.5), 1.0 / 64, 8.0);
     }},
    {record,
     "Home End",
     "to the beginning, the end",
     {{GLFW_KEY_END}, {GLFW_KEY_HOME, 0, -1}},
     [](Controls& c, const Press& p) { c.playback_->jump = p.sign > 0 ? c.playback_->length.load() : 0.0; }},
    {record, "hold left", "drag through the time", {}, nullptr},
    {record, "hold right", "turn the camera", {}, nullptr},
    {record, "wheel", "nearer, further", {}, nullptr},
    {session, "hold left", "turn the camera", {}, nullptr},
    {session, "wheel", "nearer, further", {}, nullptr},
    {every, "hold middle", "shift the camera", {}, nullptr},
    {every,
     "+ -",
     "nearer, further",
     {{0, '+'}, {0, '='}, {GLFW_KEY_KP_ADD}, {0, '-', -1}, {GLFW_KEY_KP_SUBTRACT, 0, -1}},
     [](Controls& c, const Press& p) {
         c.camera(p.sign > 0 ? vtkCommand::MouseWheelForwardEvent : vtkCommand::MouseWheelBackwardEvent);
     }},
    {every, "R", "camera and opacities as at first", {{0, 'r'}}, [](Controls& c, const Press&) { c.picture_.resetView(); }},
    {every,
     "L",
     "layout: trainee, instructor",
     {{0, 'l'}},
     [](Controls& c, const Press&) {
         c.picture_.show(c.picture_.layout() == Layout::trainee ? Layout::instructor : Layout::trainee);
     }},
    {every,
     "C",
     "cut towards the tool, whole body",
     {{0, 'c'}},
     [](Controls& c, const Press&) { c.picture_.setCut(!c.picture_.cut()); }},
    {every,
     "I",
     "slices: image and tissues, image, tissues",
     {{0, 'i'}},
     [](Controls& c, const Press&) { c.picture_.show(following(c.picture_.sliceLook())); },
     true},
    {every, "W", "the image's grey window", {{0, 'w'}}, [](Controls& c, const Press&) { c.picture_.nextWindow(); }, true},
    {every,
     "Tab",
     "choose a tissue; with Shift the one before",
     {{GLFW_KEY_TAB}},
     [](Controls& c, const Press& p) { c.picture_.selectTissue(p.shift ? -1 : 1); }},
    {every,
     "A",
     "the tissue more opaque; with Shift less",
     {{0, 'a'}},
     [](Controls& c, const Press& p) { c.picture_.changeOpacity(p.shift ? 1 / opacityStep : opacityStep); }},
    {every,
     "U",
     "ultrasound picture, body",
     {{0, 'u'}},
     [](Controls& c, const Press&) { c.picture_.showUltrasound(!c.picture_.ultrasoundShown()); }},
    // ? comes as a character: where it is on a keyboard differs too much for a key's name.
    {every, "? H F1", "these keys", {{0, 'h'}, {GLFW_KEY_F1}}, [](Controls& c, const Press&) { c.showHelp(); }},
    {every,
     "Q Esc",
     "close the window",
     {{0, 'q'}, {GLFW_KEY_ESCAPE}},
     [](Controls& c, const Press&) { glfwSetWindowShouldClose(c.window_, GLFW_TRUE); }},
    {every, "hold left", "on the picture: measure from here to there", {}, nullptr, false, true},
    {every,
     "hold right",
     "on the picture: slide and sweep the probe; with Shift rock and turn it",
     {},
     nullptr,
     false,
     true},
    {every, "wheel", "on the picture: depth", {}, nullptr, false, true},
    {every,
     "D",
     "more depth; with Shift less",
     {{0, 'd'}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().turn(Knob::depth, p.shift ? -1 : 1); },
     false,
     true},
    {every,
     "G",
     "more gain; with Shift less",
     {{0, 'g'}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().turn(Knob::gain, p.shift ? -1 : 1); },
     false,
     true},
    {every,
     "Z",
     "focus deeper; with Shift less",
     {{0, 'z'}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().turn(Knob::focus, p.shift ? -1 : 1); },
     false,
     true},
    {every,
     "Y",
     "higher frequency; with Shift less",
     {{0, 'y'}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().turn(Knob::frequency, p.shift ? -1 : 1); },
     false,
     true},
    {every,
     "V",
     "more dynamic range; with Shift less",
     {{0, 'v'}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().turn(Knob::dynamicRange, p.shift ? -1 : 1); },
     false,
     true},
    {every,
     "1 .. 8",
     "gain of a layer (TGC), from the top; with Shift less",
     {{0, '1', 1, 0},
      {0, '2', 1, 1},
      {0, '3', 1, 2},
      {0, '4', 1, 3},
      {0, '5', 1, 4},
      {0, '6', 1, 5},
      {0, '7', 1, 6},
      {0, '8', 1, 7}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().turn(Knob::tgc, p.shift ? -1 : 1, p.value); },
     false,
     true},
    {every,
     "0",
     "all layers alike",
     {{0, '0'}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().levelTgc(); },
     false,
     true},
    {every,
     "F",
     "freeze, go on",
     {{0, 'f', once}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().toggleFreeze(); },
     false,
     true},
    {every,
     "J K",
     "while frozen: a picture back, on",
     {{0, 'k'}, {0, 'j', -1}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().stepCine(p.sign); },
     false,
     true},
    {every,
     "X",
     "no measures any more",
     {{0, 'x'}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().clearCalipers(); },
     false,
     true},
    {every,
     "B",
     "guide line: where the needle goes",
     {{0, 'b'}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().toggleGuide(); },
     false,
     true},
    {every,
     "O",
     "marked side left, right",
     {{0, 'o'}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().mirror(); },
     false,
     true},
    {every,
     "T",
     "linear probe, curved probe",
     {{0, 't', once}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().changeProbe(); },
     false,
     true},
    {every,
     "P",
     "store the picture",
     {{0, 'p', once}},
     [](Controls& c, const Press&) { c.picture_.ultrasound().store(c.images_); },
     false,
     true},
};

bool Controls::applies(const Key& key) const
{
    const unsigned here = playback_ != nullptr ? record : hand_.is() ? hand : session;
    return (key.windows & here) != 0 && (!key.ofImage || picture_.hasImage()) &&
           (!key.ofUltrasound || picture_.ultrasoundShown());
}

void Controls::key(int key, const std::string& name, bool again, int mods)
{
    used_ = true;
    for (const Key& k : keys) {
        for (const Stroke& s : k.strokes)
            if (applies(k) && (s.key != 0 ? s.key == key : name == std::string_view(&s.name, 1))) {
                if (!again || s.sign != once)
                    k.act(*this, {s.sign < 0 ? -1 : 1, (mods & GLFW_MOD_SHIFT) != 0, s.value, (mods & GLFW_MOD_CONTROL) != 0});
                return;
            }
    }
}

void Controls::jumpBy(double seconds)
{
    Playback& p = *playback_;
    // A second step may come before the player has taken the first.
    const double asked = p.jump, now = std::isnan(asked) ? p.time.load() : asked;
    p.jump = std::clamp<double>(now + seconds, 0, p.length);
}

std::vector<KeyHelp> Controls::help() const
{
    std::vector<KeyHelp> rows;
    for (const Key& k : keys)
        if (applies(k))
            rows.push_back({k.shown, k.what});
    return rows;
}

std::string keysInWords()
{
    std::string text;
    for (const auto& [windows, title] : {std::pair{hand, "Where the mouse is the hand (palpate train --device mouse)"},
                                         {record, "In a record (--replay)"},
                                         {session, "In any other session"},
                                         {every, "In every window"}}) {
        text += fmt::format("{}{}:\n", text.empty() ? "" : "\n", title);
        for (const Controls::Key& k : Controls::keys)
            if (k.windows == windows && !k.ofUltrasound)
                text += fmt::format("  {:<15}{}{}\n", k.shown, k.what, k.ofImage ? " (of a body with a CT or MR)" : "");
    }
    text += "\nWhile the ultrasound picture is shown:\n";
    for (const Controls::Key& k : Controls::keys)
        if (k.ofUltrasound)
            text += fmt::format("  {:<15}{}\n", k.shown, k.what);
    return text;
}

}  // namespace palpate::render
