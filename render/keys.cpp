#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <base/words.h>
#include <render/controls.h>

#include <vtkCommand.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::render {
namespace {

using base::marked;

constexpr double turnStep = 2.0 / 180.0 * 3.14159265358979323846;  // of an arrow key [rad]
constexpr double probeStep = 1e-3, keyPressStep = 0.5e-3;          // of the probe [m]
constexpr double opacityStep = 1.25;
constexpr double tick = 1e-3, frame = 1.0 / 30, leap = 1.0;  // steps through a record [s]

// Windows in which a key means something: of a session, of one whose hand is this viewer, of a record, of a session whose
// hand is a haptic device.
constexpr unsigned session = 1, hand = 2, record = 4, device = 8, held = hand | device, watched = session | device,
                   every = session | hand | record | device;

SliceLook following(SliceLook look)
{
    return look == SliceLook::tinted ? SliceLook::image : look == SliceLook::image ? SliceLook::tissue : SliceLook::tinted;
}

}  // namespace

// A new key is a row here, and in docs/viewer.md. A row without keys tells what the mouse does (controls.cpp).
const std::vector<Controls::Key> Controls::keys{
    {hand, marked("hold left"), marked("take the tool and move it in the plane of the picture")},
    {hand, marked("  wheel"), marked("forward: push it in along itself, back: pull it out; 1 mm a notch")},
    {hand, marked("  Ctrl wheel"), marked("forward: move it into the picture, back: out of it; 1 mm a notch")},
    {hand, marked("  Shift"), marked("five times finer, mouse and keys")},
    {hand,
     marked("Enter"),
     marked("take the tool, let it go: then keys move it as the mouse does"),
     {{GLFW_KEY_ENTER, 0, once}, {GLFW_KEY_KP_ENTER, 0, once}},
     here<&Controls::toggleHold>},
    {hand,
     marked("  right left"),
     marked("move it by 1 mm in the picture; with Ctrl turn it by 2 degrees"),
     {{GLFW_KEY_RIGHT}, {GLFW_KEY_LEFT, 0, -1}},
     [](Controls& c, const Press& p) {
         const auto screen = c.screen();
         p.control ? c.hand_.turn(screen.into, p.sign * turnStep) : c.step(screen.right, p.sign, p.shift);
     }},
    {hand,
     marked("  up down"),
     marked("move it by 1 mm in the picture; with Ctrl turn it by 2 degrees"),
     {{GLFW_KEY_UP}, {GLFW_KEY_DOWN, 0, -1}},
     [](Controls& c, const Press& p) {
         const auto screen = c.screen();
         p.control ? c.hand_.turn(screen.right, p.sign * turnStep) : c.step(screen.up, p.sign, p.shift);
     }},
    {hand,
     marked("  Page down, up"),
     marked("push it in by 1 mm along itself, pull it out; with Ctrl into the picture"),
     {{GLFW_KEY_PAGE_DOWN}, {GLFW_KEY_PAGE_UP, 0, -1}},
     [](Controls& c, const Press& p) { c.step(p.control ? c.screen().into : c.hand_.axis(), p.sign, p.shift); }},
    {hand | ofNeedle,
     marked("  Space"),
     marked("fire the biopsy gun; so does the other mouse button"),
     {{GLFW_KEY_SPACE, 0, once}},
     here<&Controls::fire>},
    {hand,
     "M",
     marked("mark the place of the tool; with Shift take the last mark back"),
     {{0, 'm', once}},
     [](Controls& c, const Press& p) { p.shift ? c.hand_.unmark() : c.hand_.mark(); }},
    {held,
     marked("S Pause"),
     marked("pause: the force fades, time stands still; go on"),
     {{0, 's', once}, {GLFW_KEY_PAUSE, 0, once}},
     onHand<&MouseHand::togglePause>},
    {held,
     marked("Backspace"),
     marked("while paused: begin anew, without a record of this attempt"),
     {{GLFW_KEY_BACKSPACE, 0, once}},
     onHand<&MouseHand::beginAnew>},
    {held, "E", marked("end the session"), {{0, 'e', once}}, onHand<&MouseHand::end>},
    {hand, marked("hold right"), marked("turn the camera")},
    {record,
     marked("Space"),
     marked("pause, play"),
     {{GLFW_KEY_SPACE, 0, once}},
     [](Controls& c, const Press&) { c.playback_->paused = !c.playback_->paused; }},
    {record,
     ". ,",
     marked("one tick on, back; with Shift a frame"),
     {{0, '.'}, {0, ',', -1}},
     [](Controls& c, const Press& p) {
         c.playback_->paused = true;
         c.jumpBy(p.sign * (p.shift ? frame : tick));
     }},
    {record,
     marked("right left"),
     marked("a second on, back"),
     {{GLFW_KEY_RIGHT}, {GLFW_KEY_LEFT, 0, -1}},
     [](Controls& c, const Press& p) { c.jumpBy(p.sign * leap); }},
    {record,
     marked("up down"),
     marked("twice as fast, half as fast"),
     {{GLFW_KEY_UP}, {GLFW_KEY_DOWN, 0, -1}},
     [](Controls& c, const Press& p) {
         c.playback_->speed = std::clamp(c.playback_->speed * (p.sign > 0 ? 2.0 : 0.5), 1.0 / 64, 8.0);
     }},
    {record,
     "N",
     marked("to the next event; with Shift to the one before"),
     {{0, 'n'}},
     [](Controls& c, const Press& p) {
         if (const auto to = c.playback_->moments.from(c.shownTime(), !p.shift)) {
             c.playback_->paused = true;
             c.playback_->jump = *to;
         }
     }},
    {record,
     marked("Home End"),
     marked("to the beginning, the end"),
     {{GLFW_KEY_END}, {GLFW_KEY_HOME, 0, -1}},
     [](Controls& c, const Press& p) { c.playback_->jump = p.sign > 0 ? c.playback_->length.load() : 0.0; }},
    {record, marked("hold left"), marked("drag through the time")},
    {record, marked("hold right"), marked("turn the camera")},
    {record, marked("wheel"), marked("nearer, further")},
    {watched, marked("hold left"), marked("turn the camera")},
    {watched, marked("wheel"), marked("nearer, further")},
    {every, marked("hold middle"), marked("shift the camera")},
    {every,
     "+ -",
     marked("nearer, further"),
     {{0, '+'}, {0, '='}, {GLFW_KEY_KP_ADD}, {0, '-', -1}, {GLFW_KEY_KP_SUBTRACT, 0, -1}},
     [](Controls& c, const Press& p) {
         c.camera(p.sign > 0 ? vtkCommand::MouseWheelForwardEvent : vtkCommand::MouseWheelBackwardEvent);
     }},
    {every, "R", marked("camera and opacities as at first"), {{0, 'r'}}, onPicture<&Picture::resetView>},
    {every | ofLayouts,
     "L",
     marked("layout: trainee, instructor"),
     {{0, 'l'}},
     [](Controls& c, const Press&) {
         c.picture_.show(c.picture_.layout() == Layout::trainee ? Layout::instructor : Layout::trainee);
     }},
    {every | ofOpenBody,
     "C",
     marked("cut towards the tool, whole body"),
     {{0, 'c'}},
     [](Controls& c, const Press&) { c.picture_.setCut(!c.picture_.cut()); }},
    {held | ofCt, "P", marked("take a CT scan"), {{0, 'p', once}}, onHand<&MouseHand::storePicture>},
    {every | ofCt, "V", marked("CT window: soft tissue, lung, bone"), {{0, 'v'}}, onPicture<&Picture::nextCtWindow>},
    {every | ofImage,
     "I",
     marked("slices: image and tissues, image, tissues"),
     {{0, 'i'}},
     [](Controls& c, const Press&) { c.picture_.show(following(c.picture_.sliceLook())); }},
    {every | ofImage, "W", marked("the image's grey window"), {{0, 'w'}}, onPicture<&Picture::nextWindow>},
    {every | ofOpenBody,
     marked("Tab"),
     marked("choose a tissue; with Shift the one before"),
     {{GLFW_KEY_TAB}},
     [](Controls& c, const Press& p) { c.picture_.selectTissue(p.shift ? -1 : 1); }},
    {every | ofOpenBody,
     "A",
     marked("the tissue more opaque; with Shift less"),
     {{0, 'a'}},
     [](Controls& c, const Press& p) { c.picture_.changeOpacity(p.shift ? 1 / opacityStep : opacityStep); }},
    {every | withoutCt,
     "U",
     marked("ultrasound picture, body"),
     {{0, 'u'}},
     [](Controls& c, const Press&) { c.picture_.showUltrasound(!c.picture_.ultrasoundShown()); }},
    // ? comes as a character: where it is on a keyboard differs too much for a key's name.
    {every, "? H F1", marked("these keys"), {{0, 'h'}, {GLFW_KEY_F1}}, here<&Controls::showHelp>},
    {every,
     marked("Q Esc"),
     marked("close the window"),
     {{0, 'q', once}, {GLFW_KEY_ESCAPE, 0, once}},
     here<&Controls::close>},
    {every | ofUltrasound, marked("hold left"), marked("on the picture: measure; if the mouse is the hand, while frozen")},
    {every | ofUltrasound | ofProbe, marked("hold right"),
     marked("on the picture: slide and sweep the probe; with Shift rock and turn it")},
    {every | ofUltrasound, marked("wheel"),
     marked("on the picture: depth while no tool is held; with Shift press the probe in")},
    {every | ofUltrasound | ofProbe,
     marked("Alt right left"),
     marked("slide the probe by 1 mm; with Shift rock it by 2 degrees"),
     {{GLFW_KEY_RIGHT, 0, 1, 0, true}, {GLFW_KEY_LEFT, 0, -1, 0, true}},
     [](Controls& c, const Press& p) {
         p.shift ? c.moveProbe({.rock = p.sign * turnStep}) : c.moveProbe({.slide = p.sign * probeStep});
     }},
    {every | ofUltrasound | ofProbe,
     marked("Alt up down"),
     marked("sweep it by 1 mm; with Shift turn it by 2 degrees"),
     {{GLFW_KEY_UP, 0, 1, 0, true}, {GLFW_KEY_DOWN, 0, -1, 0, true}},
     [](Controls& c, const Press& p) {
         p.shift ? c.moveProbe({.turn = p.sign * turnStep}) : c.moveProbe({.sweep = p.sign * probeStep});
     }},
    {every | ofUltrasound | ofProbe,
     marked("Alt Page down, up"),
     marked("press it in by 0.5 mm, take it back; with Shift tilt it by 2 degrees"),
     {{GLFW_KEY_PAGE_DOWN, 0, 1, 0, true}, {GLFW_KEY_PAGE_UP, 0, -1, 0, true}},
     [](Controls& c, const Press& p) {
         p.shift ? c.moveProbe({.tilt = p.sign * turnStep}) : c.moveProbe({.press = p.sign * keyPressStep});
     }},
    {every | ofUltrasound, "D", marked("more depth; with Shift less"), {{0, 'd'}}, turn<Knob::depth>},
    {every | ofUltrasound, "G", marked("more gain; with Shift less"), {{0, 'g'}}, turn<Knob::gain>},
    {every | ofUltrasound, "Z", marked("focus deeper; with Shift less"), {{0, 'z'}}, turn<Knob::focus>},
    {every | ofUltrasound, "Y", marked("higher frequency; with Shift less"), {{0, 'y'}}, turn<Knob::frequency>},
    {every | ofUltrasound, "V", marked("more dynamic range; with Shift less"), {{0, 'v'}}, turn<Knob::dynamicRange>},
    {every | ofUltrasound,
     "1 .. 8",
     marked("gain of a layer (TGC), from the top; with Shift less"),
     {{0, '1', 1, 0},
      {0, '2', 1, 1},
      {0, '3', 1, 2},
      {0, '4', 1, 3},
      {0, '5', 1, 4},
      {0, '6', 1, 5},
      {0, '7', 1, 6},
      {0, '8', 1, 7}},
     turn<Knob::tgc>},
    {every | ofUltrasound, "0", marked("all layers alike"), {{0, '0'}}, onScan<&UltrasoundPicture::levelTgc>},
    {every | ofUltrasound, "F", marked("freeze, go on"), {{0, 'f', once}}, onScan<&UltrasoundPicture::toggleFreeze>},
    {every | ofUltrasound,
     "J K",
     marked("while frozen: a picture back, on"),
     {{0, 'k'}, {0, 'j', -1}},
     [](Controls& c, const Press& p) { c.picture_.ultrasound().stepCine(p.sign); }},
    {every | ofUltrasound, "X", marked("no measures any more"), {{0, 'x'}}, onScan<&UltrasoundPicture::clearCalipers>},
    {every | ofUltrasound,
     "B",
     marked("guide line: where the needle goes"),
     {{0, 'b'}},
     onScan<&UltrasoundPicture::toggleGuide>},
    {every | ofUltrasound, "O", marked("marked side left, right"), {{0, 'o'}}, onScan<&UltrasoundPicture::mirror>},
    {every | ofUltrasound | ofFreeProbe,
     "T",
     marked("linear probe, curved probe"),
     {{0, 't', once}},
     onScan<&UltrasoundPicture::changeProbe>},
    {every | ofUltrasound, "P", marked("store the picture"), {{0, 'p', once}}, here<&Controls::storePicture>},
};

bool Controls::applies(const Key& key) const
{
    const unsigned here = playback_ != nullptr ? record : hand_.is() ? hand : hand_.commands() ? device : session;
    const auto holds = [&](unsigned what, bool there) { return (key.windows & what) == 0 || there; };
    const bool needle = follower_.session() == nullptr || follower_.session()->scenery().tool == channel::ToolKind::needle;
    return (key.windows & here) != 0 && holds(ofImage, picture_.hasImage()) &&
           holds(ofUltrasound, picture_.ultrasoundShown()) && holds(ofCt, picture_.hasCt()) &&
           holds(ofOpenBody, !picture_.isClosed()) && holds(ofLayouts, !picture_.isClosed() || (here & held) == 0) &&
           holds(withoutCt, !picture_.hasCt()) && holds(ofNeedle, needle) &&
           holds(ofProbe, !sceneHoldsProbe() || hand_.commands()) && holds(ofFreeProbe, !sceneHoldsProbe());
}

void Controls::key(int key, const std::string& name, bool again, int mods)
{
    used_ = true;
    for (const Key& k : keys) {
        for (const Stroke& s : k.strokes)
            if (applies(k) && s.alt == ((mods & GLFW_MOD_ALT) != 0) &&
                (s.key != 0 ? s.key == key : name == std::string_view(&s.name, 1))) {
                if (!again || s.sign != once)
                    k.act(*this,
                          {s.sign < 0 ? -1 : 1, (mods & GLFW_MOD_SHIFT) != 0, s.value, (mods & GLFW_MOD_CONTROL) != 0});
                return;
            }
    }
}

void Controls::jumpBy(double seconds)
{
    Playback& p = *playback_;
    p.jump = std::clamp<double>(shownTime() + seconds, 0, p.length);
}

// A second step may come before the player has taken the first.
double Controls::shownTime() const
{
    const double asked = playback_->jump;
    return std::isnan(asked) ? playback_->time.load() : asked;
}

std::vector<KeyHelp> Controls::help() const
{
    std::vector<KeyHelp> rows;
    const auto shown = [this](std::string_view what) {
        constexpr const char *left = marked("hold left"), *right = marked("hold right");
        return leftHanded_ && what == left ? right : leftHanded_ && what == right ? left : what.data();
    };
    for (const Key& k : keys)
        if (applies(k))
            rows.push_back({base::tr(shown(k.shown)), base::tr(k.what)});
    return rows;
}

std::string keysInWords()
{
    constexpr unsigned closedTo = Controls::ofOpenBody | Controls::ofLayouts;
    constexpr unsigned extras = Controls::ofImage | Controls::ofNeedle | Controls::withoutCt | closedTo;
    std::string text;
    for (const auto& [windows, title] : {std::pair{hand, "Where the mouse is the hand (palpate train --device mouse)"},
                                         {held, "Where somebody holds the tool: with mouse, keys or a haptic device"},
                                         {record, "In a record (--replay)"},
                                         {watched, "In any other session"},
                                         {every, "In every window"}}) {
        text += fmt::format("{}{}:\n", text.empty() ? "" : "\n", title);
        for (const Controls::Key& k : Controls::keys)
            if ((k.windows & ~extras) == windows)
                text += fmt::format("  {:<18}{}{}\n", k.shown, k.what,
                                    (k.windows & Controls::ofImage) != 0     ? " (of a body with a CT or MR)"
                                    : (k.windows & Controls::withoutCt) != 0 ? " (not of a scene with CT)"
                                    : (k.windows & closedTo) != 0            ? " (not to a trainee under CT)"
                                                                             : "");
    }
    text += "\nWhile the ultrasound picture is shown:\n";
    for (const Controls::Key& k : Controls::keys)
        if ((k.windows & Controls::ofUltrasound) != 0)
            text += fmt::format("  {:<18}{}{}\n", k.shown, k.what,
                                (k.windows & Controls::ofFreeProbe) != 0 ? " (where the scene has no probe)" : "");
    text += "\nIn a scene with CT:\n";
    for (const Controls::Key& k : Controls::keys)
        if ((k.windows & Controls::ofCt) != 0)
            text += fmt::format("  {:<18}{}\n", k.shown, k.what);
    return text;
}

}  // namespace palpate::render
