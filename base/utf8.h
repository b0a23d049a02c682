#pragma once

#include <cstddef>
#include <string_view>

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

}  // namespace palpate::base
