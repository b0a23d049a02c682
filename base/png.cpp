#include <base/png.h>

#include <base/error.h>

#include <zlib.h>

#include <array>

namespace palpate::base {

namespace {

void word(std::string& out, std::uint32_t v)
{
    for (int shift = 24; shift >= 0; shift -= 8) {
        out += static_cast<char>(v >> static_cast<unsigned>(shift) & 0xffU);
    }
}

void chunk(std::string& out, std::string_view type, std::string_view data)
{
    word(out, static_cast<std::uint32_t>(data.size()));
    const std::string body = std::string(type) + std::string(data);
    out += body;
    word(out,
         static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))));
}

std::string deflated(int width, int height, std::span<const std::uint8_t> grey)
{
    std::string raw;
    const auto wide = static_cast<std::size_t>(width);
    for (std::size_t row = 0; row < static_cast<std::size_t>(height); ++row) {
        raw += '\0';  // no filter
        raw.append(reinterpret_cast<const char*>(grey.data()) + row * wide, wide);
    }
    uLongf size = compressBound(static_cast<uLong>(raw.size()));
    std::string out(size, '\0');
    base::failIf(compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
                          static_cast<uLong>(raw.size())) != Z_OK,
                 "a picture cannot be compressed: out of memory");
    out.resize(size);
    return out;
}

}  // namespace

std::string greyPng(int width, int height, std::span<const std::uint8_t> grey, std::string_view keyword,
                    std::string_view text)
{
    std::string head;
    word(head, static_cast<std::uint32_t>(width));
    word(head, static_cast<std::uint32_t>(height));
    constexpr std::array<char, 5> eightBitGrey{8, 0, 0, 0, 0};
    head.append(eightBitGrey.data(), eightBitGrey.size());
    std::string out(pngSignature);
    chunk(out, "IHDR", head);
    chunk(out, "tEXt", std::string(keyword) + '\0' + std::string(text));
    chunk(out, "IDAT", deflated(width, height, grey));
    chunk(out, "IEND", {});
    return out;
}

std::string textInPng(std::string_view png, std::string_view keyword)
{
    if (!png.starts_with(pngSignature)) {
        return {};
    }
    const std::string begin = std::string(keyword) + '\0';
    std::size_t at = pngSignature.size();
    while (at + 12 <= png.size()) {
        std::size_t length = 0;
        for (std::size_t i = 0; i < 4; ++i) {
            length = length << 8U | static_cast<unsigned char>(png[at + i]);
        }
        if (length > png.size() - at - 12) {
            break;
        }
        const std::string_view data = png.substr(at + 8, length);
        if (png.substr(at + 4, 4) == "tEXt" && data.starts_with(begin)) {
            return std::string(data.substr(begin.size()));
        }
        at += 12 + length;
    }
    return {};
}

}  // namespace palpate::base
