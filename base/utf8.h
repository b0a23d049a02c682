#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

namespace palpate::base {

/// Whether a byte of UTF-8 begins a character: the second and later ones of a character begin with the bits 10.
constexpr bool beginsCharacter(char byte) noexcept
{
    return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U;
}

/// Whether a text is UTF-8 (RFC 3629): no character is cut off, written longer than need be, a surrogate or over U+10FFFF.
constexpr bool isUtf8(std::string_view text) noexcept
{
    for (std::size_t i = 0; i < text.size();) {
        const auto first = static_cast<unsigned char>(text[i]);
        const std::size_t length = first < 0x80   ? 1
                                   : first < 0xC2 ? 0
                                   : first < 0xE0 ? 2
                                   : first < 0xF0 ? 3
                                   : first < 0xF5 ? 4
                                                  : 0;
        if (length == 0 || i + length > text.size()) {
            return false;
        }
        for (std::size_t k = 1; k < length; ++k) {
            const auto next = static_cast<unsigned char>(text[i + k]);
            const bool low = k == 1 && ((first == 0xE0 && next < 0xA0) || (first == 0xF0 && next < 0x90));
            const bool high = k == 1 && ((first == 0xED && next > 0x9F) || (first == 0xF4 && next > 0x8F));
            if (beginsCharacter(text[i + k]) || low || high) {
                return false;
            }
        }
        i += length;
    }
    return true;
}

struct Character {
    std::string_view bytes;  // of the text
    char32_t code = 0;
};

/// The characters of a text in UTF-8; a byte that is none is its own code.
inline std::vector<Character> charactersOf(std::string_view text)
{
    std::vector<Character> all;
    for (std::size_t from = 0, end = 0; from < text.size(); from = end) {
        for (end = from + 1; end < text.size() && !beginsCharacter(text[end]); ++end) {
        }
        const std::string_view bytes = text.substr(from, end - from);
        const auto bits = [&](std::size_t i, unsigned mask) { return static_cast<unsigned char>(bytes[i]) & mask; };
        char32_t code = bits(0, bytes.size() > 1 ? 0x7FU >> bytes.size() : 0xFFU);
        for (std::size_t i = 1; i < bytes.size(); ++i) {
            code = code << 6U | bits(i, 0x3FU);
        }
        all.push_back({bytes, code});
    }
    return all;
}

}  // namespace palpate::base
