#include <render/palette.h>

#include <render/events.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

namespace palpate::render {
namespace {

struct Look {
    std::string_view tissue;
    std::uint32_t colour;  // 0xRRGGBB
    Pattern pattern = Pattern::none;
};

// Fourteen colours that were placed by search, each near what it stands for, so that any two are 15 apart at least
// (CIEDE2000) for all three kinds of colour blindness and for none; a test (tests/render/palette_test.cpp) measures it on
// the tissues that touch in the built-in scenes.
constexpr std::array<Look, 25> looks{{
    {"skin", 0x976C60},
    {"fat", 0xFFBC95},
    {"gland", 0xB29CAE},
    {"ligament", 0xE4DADC},
    {"duct", 0x757485},
    {"tdlu", 0x757485, Pattern::dots},
    {"nipple", 0x913518},
    {"artery", 0xEB7207, Pattern::rising},
    {"vein", 0x0B36FF, Pattern::falling},
    {"nerve", 0xDFFF1A, Pattern::level},
    {"muscle", 0x4B000C},
    {"bone", 0xC3C1FF},
    {"rib", 0xC3C1FF},
    {"cartilage", 0xE4DADC, Pattern::level},
    {"chest_wall", 0x65207F},
    {"soft_tissue", 0xB29CAE, Pattern::level},
    {"fibroadenoma", 0x36514F, Pattern::checks},
    {"idc_low_grade", 0x36514F, Pattern::checks},
    {"idc_high_grade", 0x36514F, Pattern::checks},
    {"ilc", 0x36514F, Pattern::checks},
    {"dcis", 0x36514F, Pattern::checks},
    {"fibrocystic", 0x36514F, Pattern::checks},
    {"tumour", 0x36514F, Pattern::checks},
    {"cyst", 0x7C87F1, Pattern::level},
    {"calcification", 0xC3C1FF, Pattern::checks},
}};

const Look* lookOf(std::string_view tissue)
{
    const auto* const found = std::find_if(looks.begin(), looks.end(), [&](const Look& l) { return l.tissue == tissue; });
    return found != looks.end() ? found : nullptr;
}

float channelOf(std::uint32_t colour, int shift)
{
    return static_cast<float>((colour >> shift) & 0xFFU) / 255.0F;
}

}  // namespace

void paint(Palette palette, channel::Scenery& scenery)
{
    if (palette == Palette::standard)
        return;
    for (std::size_t row = 1; row < std::min<std::size_t>(scenery.tissues, channel::maxTissues); ++row)
        if (const Look* look = lookOf(text(scenery.tissue[row].name)); look != nullptr)
            scenery.tissue[row].colour = {channelOf(look->colour, 16), channelOf(look->colour, 8),
                                          channelOf(look->colour, 0)};
}

Pattern patternOf(Palette palette, const channel::Name& tissue)
{
    const std::string name = text(tissue);
    if (palette == Palette::standard || name.empty())
        return Pattern::none;
    const Look* look = lookOf(name);
    // Of the rest each has some pattern, always the same.
    constexpr std::array rest{Pattern::dots, Pattern::rising, Pattern::falling, Pattern::level, Pattern::checks};
    std::size_t sum = 0;
    for (const char c : name)
        sum += static_cast<unsigned char>(c);
    return look != nullptr ? look->pattern : rest[sum % rest.size()];
}

bool isMarked(Pattern pattern, int column, int row) noexcept
{
    constexpr int period = 6;  // [pixels]
    const auto in = [](int value) { return ((value % period) + period) % period < 2; };
    switch (pattern) {
        case Pattern::dots:
            return in(column) && in(row);
        case Pattern::rising:
            return in(column - row);
        case Pattern::falling:
            return in(column + row);
        case Pattern::level:
            return in(row);
        case Pattern::checks:
            return in(column) || in(row);
        case Pattern::none:
            break;
    }
    return false;
}

}  // namespace palpate::render
