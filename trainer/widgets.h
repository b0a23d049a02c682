#pragma once

#include <trainer/look.h>
#include <trainer/screens.h>

#include <imgui.h>

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

/// The text, with its end left out where it is wider than so many pixels.
std::string shortened(const std::string& text, float wide);
/// Whether a list and what is chosen of it have room side by side in the window.
bool roomForTwo();

/// Where somebody stands: exercises, learning curves, CUSUM.
Errand drawProgress(State& state, bool entered);
/// Sessions that run, those that were kept, groups.
Errand drawInstructor(State& state);
/// Result and debrief.
Errand drawResult(State& state);
/// Language, palette, sounds, size of texts, behind a button.
Errand drawSettings(State& state);

}  // namespace palpate::trainer
