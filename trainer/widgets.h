#pragma once

#include <trainer/look.h>
#include <trainer/screens.h>

#include <imgui.h>

#include <functional>
#include <optional>
#include <string>

/// What the screens are put together of. Not part of the interface.
namespace palpate::trainer {

inline ImVec4 vec(Rgb c)
{
    return {c.r, c.g, c.b, 1};
}

/// Text that is broken at the window's side.
void words(const std::string& text);
void words(const std::string& text, Rgb colour);
void heading(const std::string& text, float scale = 1.45F);
/// As large as fits, in its own proportions; without a picture a gap.
void drawPicture(const Texture& texture, float wide, float high);
bool enterPressed();
/// Puts the next widget beside the one before, or below it where a row has no room for `label`.
void besideIfRoom(const std::string& label);

/// Such a button. Returns whether it was pressed.
bool buttonBeside(const std::string& label);

/// The text, with its end left out where it is wider than so many pixels.
std::string shortened(const std::string& text, float wide);
/// Whether a list and what is chosen of it have room side by side in the window.
bool roomForTwo();
/// Whether letters are so large for the window that its parts do not roll by themselves: all between the way and the foot
/// rolls as one.
bool rollsAsOne();
/// A part of the window: a child that rolls, or where rollsAsOne() a group.
void beginPart(const char* name, float wide, float high);
void endPart();
/// "Back" of "Back (Esc)".
std::string withoutKey(const std::string& label);
/// The label of a button as it has room in this row: without its key, or with its end left out.
std::string fitted(const std::string& label);
/// A radio button whose label is broken into lines where it is too long for one.
bool radio(const std::string& label, bool active);
/// What a combo box shows of its choice, as it has room in the next field.
std::string preview(const std::string& chosen);
/// A combo box that shows `shown`, with so many choices. Returns the one that was just chosen; nothing: none was.
std::optional<std::size_t> choice(const std::string& name, const std::string& shown, std::size_t count, std::size_t chosen,
                                  const std::function<std::string(std::size_t)>& label);
/// Two lines over a row that can be chosen and begins `at`: what it is, and facts in a colour.
void drawRow(ImVec2 at, const std::string& title, const std::string& facts, Rgb colour);
/// Sets the width of the next field. Returns its label; where rollsAsOne() that is above it instead.
std::string fieldLabel(const std::string& label, float wide);

/// Where somebody stands: exercises, learning curves, CUSUM.
Errand drawProgress(State& state, bool entered);
/// Sessions that run, those that were kept, groups.
Errand drawInstructor(State& state);
/// Result and debrief.
Errand drawResult(State& state);
/// Language, palette, sounds, size of texts, behind a button.
Errand drawSettings(State& state);

}  // namespace palpate::trainer
