#pragma once

namespace palpate::base {

/// Whether a byte of UTF-8 begins a character: the second and later ones of a character begin with the bits 10.
constexpr bool beginsCharacter(char byte) noexcept
{
    return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U;
}

}  // namespace palpate::base
