#include <ultrasound/stored_image.h>

#include <zlib.h>
#include <nlohmann/json.hpp>

#include <array>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace palpate::ultrasound {

namespace {

using nlohmann::json;

constexpr std::string_view signature{"\x89PNG\r\n\x1a\n", 8};
constexpr std::string_view keyword{"palpate\0", 8};

void word(std::string& out, std::uint32_t v)
{
    for (int shift = 24; shift >= 0; shift -= 8)
        out += static_cast<char>(v >> static_cast<unsigned>(shift) & 0xffU);
}

void chunk(std::string& out, std::string_view type, std::string_view data)
{
    word(out, static_cast<std::uint32_t>(data.size()));
    const std::string body = std::string(type) + std::string(data);
    out += body;
    word(out,
         static_cast<std::uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))));
}

std::string deflated(const Pixels& pixels)
{
    std::string raw;
    for (int row = 0; row < pixels.height; ++row) {
        raw += '\0';  // no filter
        const auto* begin =
            reinterpret_cast<const char*>(pixels.grey.data()) + static_cast<std::ptrdiff_t>(row) * pixels.width;
        raw.append(begin, static_cast<std::size_t>(pixels.width));
    }
    uLongf size = compressBound(static_cast<uLong>(raw.size()));
    std::string out(size, '\0');
    if (compress(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(raw.data()),
                 static_cast<uLong>(raw.size())) != Z_OK)
        throw std::runtime_error("a picture cannot be compressed: out of memory");
    out.resize(size);
    return out;
}

json triple(glm::dvec3 v)
{
    return {v.x, v.y, v.z};
}

glm::dvec3 triple(const json& j)
{
    return {j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()};
}

json describe(const BeamImage& image, int width, int height)
{
    const Settings& s = image.settings;
    return {{"tick", image.tick},
            {"shape_tick", image.shapeTick},
            {"probe", image.transducer.shape == ProbeShape::curved ? "curved" : "linear"},
            {"face_m", triple(image.pose.face)},
            {"lateral", triple(image.pose.lateral)},
            {"elevation", triple(image.pose.elevation)},
            {"axial", triple(image.pose.axial)},
            {"mirrored", image.mirrored},
            {"depth_m", s.depth},
            {"frequency_hz", s.frequency},
            {"focus_m", s.focus},
            {"gain_db", s.gain},
            {"dynamic_range_db", s.dynamicRange},
            {"tgc_db", s.tgc},
            {"lines", s.lines},
            {"samples", s.samples},
            {"planes", s.planes},
            {"width", width},
            {"height", height}};
}

StoredHow understood(const json& j)
{
    StoredHow how;
    BeamImage& image = how.image;
    image.tick = j.at("tick").get<std::uint64_t>();
    image.shapeTick = j.at("shape_tick").get<std::uint64_t>();
    image.transducer = j.at("probe").get<std::string>() == "curved" ? curvedProbe() : linearProbe();
    image.pose = {triple(j.at("face_m")), triple(j.at("lateral")), triple(j.at("elevation")), triple(j.at("axial"))};
    image.mirrored = j.at("mirrored").get<bool>();
    Settings s;
    s.depth = j.at("depth_m").get<float>();
    s.frequency = j.at("frequency_hz").get<float>();
    s.focus = j.at("focus_m").get<float>();
    s.gain = j.at("gain_db").get<float>();
    s.dynamicRange = j.at("dynamic_range_db").get<float>();
    s.tgc = j.at("tgc_db").get<std::array<float, tgcSliders>>();
    s.lines = j.at("lines").get<int>();
    s.samples = j.at("samples").get<int>();
    s.planes = j.at("planes").get<int>();
    image.settings = within(s, image.transducer);
    how.width = j.at("width").get<int>();
    how.height = j.at("height").get<int>();
    constexpr int most = 8192;
    if (how.width < 1 || how.height < 1 || how.width > most || how.height > most)
        throw std::runtime_error("its size is none");
    return how;
}

// The text of the chunk tEXt "palpate"; empty when there is none.
std::string textIn(const std::string& png)
{
    std::size_t at = signature.size();
    while (at + 12 <= png.size()) {
        std::size_t length = 0;
        for (std::size_t i = 0; i < 4; ++i)
            length = length << 8U | static_cast<unsigned char>(png[at + i]);
        if (length > png.size() - at - 12)
            break;
        const std::string_view data(png.data() + at + 8, length);
        if (png.compare(at + 4, 4, "tEXt") == 0 && data.starts_with(keyword))
            return std::string(data.substr(keyword.size()));
        at += 12 + length;
    }
    return {};
}

}  // namespace

std::string storedImage(const BeamImage& image, int width, int height)
{
    Pixels pixels;
    ScanConverter().convert(image, width, height, pixels);
    drawMarks(image, pixels);
    std::string head;
    word(head, static_cast<std::uint32_t>(width));
    word(head, static_cast<std::uint32_t>(height));
    constexpr std::array<char, 5> eightBitGrey{8, 0, 0, 0, 0};
    head.append(eightBitGrey.data(), eightBitGrey.size());
    std::string out(signature);
    chunk(out, "IHDR", head);
    chunk(out, "tEXt", std::string(keyword) + describe(image, width, height).dump());
    chunk(out, "IDAT", deflated(pixels));
    chunk(out, "IEND", {});
    return out;
}

StoredHow readStored(const std::filesystem::path& file)
{
    std::ifstream in(file, std::ios::binary);
    const std::string png((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    if (!in)
        throw std::runtime_error(file.string() + ": cannot be read");
    const std::string text = png.starts_with(signature) ? textIn(png) : std::string();
    if (text.empty())
        throw std::runtime_error(file.string() + ": is no ultrasound image that palpate has stored");
    try {
        return understood(json::parse(text));
    } catch (const std::exception& e) {
        throw std::runtime_error(file.string() + ": what it says of how it was made is damaged: " + e.what());
    }
}

}  // namespace palpate::ultrasound
