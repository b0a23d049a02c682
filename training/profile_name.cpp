#include <training/profile_name.h>

#include <base/error.h>
#include <base/mapped.h>
#include <base/utf8.h>

#include <locale.h>
#include <wctype.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

namespace palpate::training {

namespace {

struct Range {
    char32_t first, last;
};

// Source: UnicodeData.txt and DerivedCoreProperties.txt (Default_Ignorable_Code_Point) of Unicode 15, format characters
// (Cf) among them, but for those that are drawn, such as the Arabic number sign.
constexpr std::array unseen{
    Range{0x0080, 0x009F}, Range{0x00AD, 0x00AD},   Range{0x034F, 0x034F},   Range{0x061C, 0x061C},
    Range{0x115F, 0x1160}, Range{0x17B4, 0x17B5},   Range{0x180B, 0x180F},   Range{0x200B, 0x200F},
    Range{0x2028, 0x202E}, Range{0x2060, 0x206F},   Range{0x3164, 0x3164},   Range{0xFE00, 0xFE0F},
    Range{0xFEFF, 0xFEFF}, Range{0xFFA0, 0xFFA0},   Range{0xFFF0, 0xFFFB},   Range{0xFFFE, 0xFFFF},
    Range{0x2800, 0x2800}, Range{0x1BCA0, 0x1BCA3}, Range{0x1D173, 0x1D17A}, Range{0xE0000, 0xE0FFF}};

// Category Zs, but for the plain blank.
constexpr std::array blanks{Range{0x00A0, 0x00A0}, Range{0x1680, 0x1680}, Range{0x2000, 0x200A},
                            Range{0x202F, 0x202F}, Range{0x205F, 0x205F}, Range{0x3000, 0x3000}};

// The blocks of combining diacritical marks, the hamza of Arabic, the voice marks of kana, and the vowels and ends of
// Korean syllables: a normalised name (NFC) has them in one character with their letter. Vowel signs of other scripts have
// no such character.
constexpr std::array apart{Range{0x0300, 0x036F}, Range{0x0653, 0x0655}, Range{0x1161, 0x11FF},
                           Range{0x1AB0, 0x1AFF}, Range{0x1DC0, 0x1DFF}, Range{0x20D0, 0x20FF},
                           Range{0x3099, 0x309A}, Range{0xD7B0, 0xD7FF}, Range{0xFE20, 0xFE2F}};

bool isIn(std::span<const Range> ranges, char32_t c)
{
    return std::ranges::any_of(ranges, [c](const Range& r) { return c >= r.first && c <= r.last; });
}

// The small letter in any script; what C.UTF-8 calls so does not depend on the user's locale.
char32_t small(char32_t c)
{
    static const locale_t unicode = ::newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr);
    constexpr char32_t sigmaAtEnd = 0x03C2, sigma = 0x03C3;
    return c == sigmaAtEnd ? sigma : unicode != nullptr ? ::towlower_l(static_cast<wint_t>(c), unicode) : c;
}

}  // namespace

void checkProfileName(const std::string& name)
{
    const bool control =
        std::ranges::any_of(name, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; });
    base::failIf(name.empty() || name.size() > 100 || control || !base::isUtf8(name),
                 "profile '{}': must be 1 to 100 bytes of text (UTF-8) in one line", name);
    const auto characters = base::charactersOf(name);
    for (std::size_t i = 0; i < characters.size(); ++i) {
        const char32_t c = characters[i].code;
        const char* const wrong = isIn(unseen, c)   ? "cannot be seen: leave it out"
                                  : isIn(blanks, c) ? "is no plain blank: type one"
                                  : isIn(apart, c)
                                      ? "is an accent or a sign apart from its letter: type both as one character, "
                                        "or leave it out"
                                      : nullptr;
        // Without the name itself, which such characters turn round on a terminal.
        base::failIf(wrong != nullptr, "name of a profile: character {}, U+{:04X}, {}", i + 1,
                     static_cast<std::uint32_t>(c), wrong == nullptr ? "" : wrong);
    }
    base::failIf(name.front() == ' ' || name.back() == ' ', "profile '{}': must not begin or end with a blank", name);
    base::failIf(name.front() == '-', "profile '{}': must not begin with '-', which commands take for an option", name);
}

bool isSameButForCase(const std::string& a, const std::string& b)
{
    const auto folded = [](const std::string& name) {
        return base::mapped<char32_t>(base::charactersOf(name), [](const auto& c) { return small(c.code); });
    };
    return folded(a) == folded(b);
}

}  // namespace palpate::training
