#pragma once

#include <string>

namespace palpate::trainer {

/// Colours, spacing and font of the window. Call once for each text scale, between pictures.
/// @param scale  of texts and spaces; 1: 18 pixels a line
void setLook(float scale);

/// The text as ImGui can draw it, from left to right: Hebrew and Arabic turned round, and what the font does not have as
/// code points, "[U+5F20 U+4F1F]". Two people never look the same.
/// @pre  the font's atlas is built
std::string drawable(const std::string& text);

/// Colours with a meaning (Okabe and Ito 2008: told apart with any kind of colour blindness).
struct Rgb {
    float r, g, b;
};
inline constexpr Rgb orange{0.90F, 0.62F, 0.00F}, skyBlue{0.34F, 0.71F, 0.91F}, green{0.00F, 0.62F, 0.45F},
    vermilion{0.84F, 0.37F, 0.00F}, quiet{0.66F, 0.70F, 0.76F};

}  // namespace palpate::trainer
