#pragma once

#include <trainer/state.h>

#include <functional>
#include <string>

namespace palpate::trainer {

/// A picture that ImGui can draw.
struct Texture {
    unsigned id = 0;  // of OpenGL; 0: there is none
    int width = 0, height = 0;
};
using TextureOf = std::function<Texture(const std::string& picture)>;

/// Draws the screen that `state` is at into the whole of a window of `width` x `height` pixels. Between ImGui::NewFrame()
/// and Render().
///
/// @param entered  the screen is new: the keyboard's focus goes to its main button
/// @returns        what the user asks for
Errand drawScreen(State& state, const TextureOf& textureOf, float width, float height, bool entered);

}  // namespace palpate::trainer
