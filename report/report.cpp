#include <report/report.h>

#include <base/error.h>
#include <base/inputs.h>
#include <base/mapped.h>
#include <base/outputs.h>
#include <base/png.h>
#include <base/split.h>
#include <base/spoken.h>
#include <datasets/scene.h>
#include <report/data.h>
#include <report/html.h>
#include <report/path.h>

#include <fmt/format.h>
#include <openssl/evp.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <exception>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace palpate::report {

namespace {

using nlohmann::json;

constexpr std::size_t shownVitals = 7;  // at first; the legend switches the others on

// Nothing where the scene cannot be read.
std::optional<double> capOf(const haptics::SessionInfo& info)
{
    try {
        return datasets::parseScene(info.sceneText, info.sceneOrigin).forceCap;
    } catch (const std::exception&) {
        return std::nullopt;
    }
}

// The cap, where forces come anywhere near it: on a chart of small ones it would leave them no room.
json capLine(const ReportData& d, std::optional<double> cap)
{
    const bool near = cap && d.score.peakForce > 0.5 * *cap;
    return near ? json::array({{{"at", *cap}, {"label", "cap"}, {"colour", "c4"}}}) : json::array();
}

// The colours of the viewer (render/overlay.h): blue, violet, green.
json forceChart(const ReportData& d, std::optional<double> cap)
{
    return {{"columns", base::mapped<json>(d.forces, numbers)},
            {"x", axis("time", "s")},
            {"y", axis("force", "N")},
            {"sync", "time"},
            {"events", true},
            {"lines", capLine(d, cap)},
            {"series",
             {{{"label", "basic"}, {"colour", "c0"}},
              {{"label", "additional"}, {"colour", "c3"}},
              {{"label", "total"}, {"colour", "c1"}, {"width", 2}}}}};
}

// A fast push leaves bins of the depth out: the values beside them are joined.
void bridgeGaps(json& chart)
{
    for (json& series : chart["series"]) {
        series["gaps"] = false;
    }
}

json depthChart(const ReportData& d, std::optional<double> cap)
{
    json chart = {
        {"columns", base::mapped<json>(std::vector{d.profile.depth, d.profile.in, d.profile.peak, d.profile.out}, numbers)},
        {"x", axis("inserted", "mm")},
        {"y", axis("total force", "N")},
        {"lines", capLine(d, cap)},
        {"series",
         {{{"label", "going in, mean"}, {"colour", "c0"}, {"width", 2}},
          {{"label", "going in, largest"}, {"colour", "c6"}},
          {{"label", "coming out, mean"}, {"colour", "c1"}, {"width", 2}}}}};
    bridgeGaps(chart);
    return chart;
}

json energyChart(const ReportData& d)
{
    return {{"columns", base::mapped<json>(d.energy, numbers)},
            {"x", axis("time", "s")},
            {"y", axis("energy", "mJ")},
            {"sync", "time"},
            {"events", true},
            {"series",
             {{{"label", "given to the hand, net"}, {"colour", "c0"}, {"width", 2}},
              {{"label", "taken by damping"}, {"colour", "c1"}}}}};
}

// The vital structures that came nearest are shown at first.
std::vector<bool> shownAtFirst(const ReportData& d, std::size_t structures)
{
    std::vector<std::pair<double, std::size_t>> nearest;
    for (std::size_t i = 1; i < structures; ++i) {
        double least = std::numeric_limits<double>::infinity();
        for (const double v : d.distances[2 + i]) {
            least = v < least ? v : least;
        }
        nearest.emplace_back(least, i);
    }
    std::ranges::sort(nearest);
    std::vector<bool> shown(structures, false);
    for (std::size_t n = 0; n < nearest.size() && n < shownVitals; ++n) {
        shown[nearest[n].second] = true;
    }
    if (structures > 0) {
        shown[0] = true;
    }
    return shown;
}

// As viewers colour it: of the tissue of its name; a target of another name is a tumour.
std::string colourOf(const std::vector<std::string>& structures, std::size_t i)
{
    std::string colour = tissueColour(structures[i]);
    if (colour.empty() && i == 0) {
        colour = tissueColour("idc_high_grade");
    }
    return colour.empty() ? "c" + std::to_string(i % 7) : colour;
}

json distanceChart(const ReportData& d, const haptics::SessionInfo& info)
{
    const std::size_t structures = std::min(info.structures.size(), haptics::maxStructures);
    const std::vector<bool> shown = shownAtFirst(d, structures);
    json series = {{{"label", "inserted"}, {"colour", "c7"}, {"fill", true}, {"width", 1}}};
    json lines = json::array();
    for (std::size_t i = 0; i < structures; ++i) {
        const std::string name = base::spoken(info.structures[i]);
        const std::string colour = colourOf(info.structures, i);
        json one = {{"label", name}, {"colour", colour}, {"width", i == 0 ? 2.2 : 1.6}, {"show", shown[i] ? true : false}};
        if (i >= 7) {
            one["dash"] = {6, 3};
        }
        series.push_back(std::move(one));
        const double warning = i < info.warnDistances.size() ? info.warnDistances[i] * 1e3 : 0;
        if (i > 0 && warning > 0 && shown[i]) {
            lines.push_back({{"at", warning}, {"label", "warning: " + name}, {"colour", colour}});
        }
    }
    return {{"columns", base::mapped<json>(d.distances, numbers)},
            {"x", axis("time", "s")},
            {"y", axis("distance", "mm")},
            {"sync", "time"},
            {"events", true},
            {"lines", lines},
            {"series", series}};
}

// As distanceChart(), by the length inside.
json nearestChart(const ReportData& d, const haptics::SessionInfo& info)
{
    json chart = distanceChart(d, info);
    chart["columns"] = base::mapped<json>(d.nearest, numbers);
    chart["x"] = axis("inserted", "mm");
    chart["y"] = axis("least distance", "mm");
    chart.erase("sync");
    chart.erase("events");
    chart["series"].erase(0);
    bridgeGaps(chart);
    return chart;
}

constexpr std::size_t fewPictures = 8, leastFrames = 2;
constexpr std::string_view digits = "0123456789";

std::string base64(const std::string& bytes)
{
    std::string out((bytes.size() + 2) / 3 * 4 + 1, '\0');
    EVP_EncodeBlock(reinterpret_cast<unsigned char*>(out.data()), reinterpret_cast<const unsigned char*>(bytes.data()),
                    static_cast<int>(bytes.size()));
    out.pop_back();
    return out;
}

// A file of the viewer: 002_fired.png of an event, frame_00005.png of a time; or somebody's own.
struct SessionPicture {
    std::filesystem::path file;
    bool event = false;
    std::string words;
    std::optional<double> seconds;  // of the session; files of older viewers do not say it
};

// What the viewer has written into the picture. It stands before the pixels, so that the head of the file is enough.
std::optional<double> secondsIn(const std::filesystem::path& file)
{
    std::string head(4096, '\0');
    std::ifstream in(file, std::ios::binary);
    in.read(head.data(), static_cast<std::streamsize>(head.size()));
    head.resize(static_cast<std::size_t>(in.gcount()));
    const std::optional<double> seconds = base::numberIn(base::textInPng(head, base::pngTimeKeyword));
    return seconds && std::isfinite(*seconds) ? seconds : std::nullopt;
}

SessionPicture pictureOf(const std::filesystem::path& file)
{
    SessionPicture one{file, false, file.stem().string(), secondsIn(file)};
    const std::size_t underscore = one.words.find('_');
    const bool viewers = underscore != std::string::npos && underscore > 0 && underscore + 1 < one.words.size();
    one.event = viewers && one.words.find_first_not_of(digits) == underscore;
    if (one.event) {
        one.words.erase(0, underscore + 1);
        std::ranges::replace(one.words, '_', ' ');
    } else if (viewers && one.words.starts_with("frame_") && one.seconds) {
        one.words.clear();
    }
    if (one.seconds) {
        one.words += fmt::format("{}{:.1f} s", one.words.empty() ? "" : ", ", *one.seconds);
    }
    return one;
}

std::vector<std::filesystem::path> pngFilesIn(const std::filesystem::path& folder)
{
    std::vector<std::filesystem::path> all;
    std::error_code failed;
    for (const auto& entry : std::filesystem::directory_iterator(folder, failed)) {
        if (entry.is_regular_file() && entry.path().extension() == ".png") {
            all.push_back(entry.path());
        }
    }
    base::failIf(static_cast<bool>(failed), "{}: pictures cannot be read: {}", folder.native(), failed.message());
    std::ranges::sort(all);
    return all;
}

// By time where every picture has one. Otherwise by name: events in their order, then the others.
std::vector<SessionPicture> chosenPictures(const std::filesystem::path& folder)
{
    std::vector<SessionPicture> some, others;
    for (const std::filesystem::path& file : pngFilesIn(folder)) {
        SessionPicture one = pictureOf(file);
        (one.event ? some : others).push_back(std::move(one));
    }
    const std::size_t room = std::max(leastFrames, fewPictures - std::min(fewPictures, some.size()));
    const std::size_t count = std::min(room, others.size());
    for (std::size_t i = 0; i < count; ++i) {
        some.push_back(others[count < 2 ? 0 : i * (others.size() - 1) / (count - 1)]);
    }
    if (std::ranges::all_of(some, [](const SessionPicture& p) { return p.seconds.has_value(); })) {
        std::ranges::stable_sort(some, {}, [](const SessionPicture& p) { return *p.seconds; });
    }
    return some;
}

// The PNG files of a folder, in the order of their times: all of events, and of the others so many that there are eight, at
// least two. Empty for no folder, and for one without pictures. Throws std::runtime_error where it cannot be read.
std::string picturesCard(const std::filesystem::path& folder)
{
    const auto pictures = folder.empty() ? std::vector<SessionPicture>{} : chosenPictures(folder);
    if (pictures.empty()) {
        return {};
    }
    std::string out = "<section class=\"card\"><h2>Pictures</h2><div class=\"pictures\">";
    for (const SessionPicture& picture : pictures) {
        const std::string bytes = base::contentOf(picture.file).value_or("");
        const std::string words = escape(picture.words);
        out += "<figure><img alt=\"" + words + "\" src=\"data:image/png;base64," + base64(bytes) + "\"><figcaption>" +
               words + "</figcaption></figure>";
    }
    return out + "</div></section>";
}

std::string sessionPage(const haptics::Record& record, const std::filesystem::path& pictures,
                        const std::filesystem::path& file)
{
    const ReportData d = collect(record);
    const haptics::SessionInfo& info = record.info();
    const std::optional<double> cap = capOf(info);
    json events = json::array();
    for (const MarkedEvent& e : d.events) {
        events.push_back(
            {{"seconds", e.seconds}, {"kind", haptics::name(e.event.kind)}, {"label", eventLabel(e.event, info)}});
    }
    const json data = {{"events", events},
                       {"charts",
                        {{"forces", forceChart(d, cap)},
                         {"energy", energyChart(d)},
                         {"depth", depthChart(d, cap)},
                         {"distances", distanceChart(d, info)},
                         {"nearest", nearestChart(d, info)}}}};

    std::string out = header(d, record, file.string()) + scoreCard(d) + coresCard(d, info);
    out += chartCard(
        "forces", "Force against time",
        "Basic force of the tissue, additional force that warns, and the total as sent to the hand. <span "
        "class=\"hint\">Drag to look closer, click twice to see all; a name in the legend hides its line.</span>");
    out +=
        chartCard("distances", "Distances against time",
                  "From the tip to the target and the vital structures, in the deformed tissue. Dashed lines are where a "
                  "warning begins; the shaded area is the length inserted.");
    if (d.profile.depth.size() > 1) {
        out += chartCard("depth", "Force against depth",
                         "Total force by the length of the shaft inside, in bins of half a millimetre.");
        out += chartCard(
            "nearest", "Distances against depth",
            "The least distance from the tip to target and vital structures at each length inside, on the way in.");
    }
    out += pathCard(d, info) + picturesCard(pictures);
    out += chartCard(
        "energy", "Energy",
        "What all forces so far gave to the hand, less what it put in: below zero the tissue has taken energy, as it "
        "should. And what the stabiliser's damping took from it.");
    out += eventsCard(d, info) + timingCard(d, record) + sessionCard(record);
    return page(info.scene + " - Palpate session", out, data);
}

}  // namespace

void checkPictures(const std::filesystem::path& folder)
{
    if (!folder.empty()) {
        static_cast<void>(pngFilesIn(folder));
    }
}

void writeReport(const std::filesystem::path& html, const haptics::Record& record, const std::filesystem::path& pictures,
                 const std::filesystem::path& file)
{
    base::writeWhole(html, sessionPage(record, pictures, file));
}

}  // namespace palpate::report
