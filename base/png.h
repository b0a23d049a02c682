#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace palpate::base {

/// The first eight bytes of every PNG file.
inline constexpr std::string_view pngSignature{"\x89PNG\r\n\x1a\n", 8};

/// Of the text in a viewer's picture that says when in the session it was [s]: "2.8".
inline constexpr const char* pngTimeKeyword = "palpate-seconds";

/// A picture of greys as a PNG file, 8 bits a pixel. The same input gives the same bytes.
/// @param width    of the picture [pixels]
/// @param height   of the picture [pixels]
/// @param grey     width x height bytes, rows from the top down, 0 black
/// @param keyword  of a chunk tEXt, 1 to 79 letters
/// @param text     that it holds
/// Throws std::runtime_error when memory runs out.
std::string greyPng(int width, int height, std::span<const std::uint8_t> grey, std::string_view keyword,
                    std::string_view text);
/// The text that a PNG file has under a keyword; empty where it has none, or is none.
std::string textInPng(std::string_view png, std::string_view keyword);

}  // namespace palpate::base
