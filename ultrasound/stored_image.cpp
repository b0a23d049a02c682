#include <ultrasound/stored_image.h>

#include <base/error.h>
#include <base/inputs.h>
#include <base/png.h>
#include <base/vec_json.h>
#include <base/window_size.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <optional>

namespace palpate::ultrasound {

namespace {

using nlohmann::json;

constexpr std::string_view keyword = "palpate";

json describe(const BeamImage& image, int width, int height)
{
    const Settings& s = image.settings;
    json j{{"tick", image.tick},
           {"shape_tick", image.shapeTick},
           {"probe", image.transducer.shape == ProbeShape::curved ? "curved" : "linear"},
           {"face_m", image.pose.face},
           {"lateral", image.pose.lateral},
           {"elevation", image.pose.elevation},
           {"axial", image.pose.axial},
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
    if (image.body != 0)
        j["body"] = fmt::format("{:016x}", image.body);
    return j;
}

StoredHow understood(const json& j)
{
    StoredHow how;
    BeamImage& image = how.image;
    image.tick = j.at("tick").get<std::uint64_t>();
    image.shapeTick = j.at("shape_tick").get<std::uint64_t>();
    image.transducer = j.at("probe").get<std::string>() == "curved" ? curvedProbe() : linearProbe();
    image.pose = {j.at("face_m").get<glm::dvec3>(), j.at("lateral").get<glm::dvec3>(), j.at("elevation").get<glm::dvec3>(),
                  j.at("axial").get<glm::dvec3>()};
    // Pictures of before had no such word.
    image.body = std::stoull(j.value("body", "0"), nullptr, 16);
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
    base::failIf(std::min(how.width, how.height) < 1 || std::max(how.width, how.height) > base::mostSide,
                 "its size is none");
    return how;
}

}  // namespace

std::string storedImage(const BeamImage& image, int width, int height)
{
    Pixels pixels;
    ScanConverter().convert(image, width, height, pixels);
    drawMarks(image, pixels);
    return base::greyPng(width, height, pixels.grey, keyword, describe(image, width, height).dump());
}

StoredHow readStored(const std::filesystem::path& file)
{
    const std::string why = base::whyNoFile(file);
    base::failIf(!why.empty(), "{}: {}", file.native(), why);
    const std::optional<std::string> png = base::contentOf(file);
    base::failIf(!png, "{}: cannot be read", file.native());
    const std::string text = base::textInPng(*png, keyword);
    base::failIf(text.empty(), "{}: is no ultrasound image that palpate has stored", file.native());
    try {
        return understood(json::parse(text));
    } catch (const std::exception& e) {
        throw base::error("{}: what it says of how it was made is damaged: {}", file.native(), e.what());
    }
}

}  // namespace palpate::ultrasound
