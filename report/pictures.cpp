#include <report/pictures.h>

#include <base/error.h>
#include <base/png.h>
#include <base/split.h>
#include <report/html.h>

#include <fmt/format.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace palpate::report {

namespace {

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

}  // namespace

std::string picturesCard(const std::filesystem::path& folder)
{
    const auto pictures = folder.empty() ? std::vector<SessionPicture>{} : chosenPictures(folder);
    if (pictures.empty()) {
        return {};
    }
    std::string out = "<section class=\"card\"><h2>Pictures</h2><div class=\"pictures\">";
    for (const SessionPicture& picture : pictures) {
        std::ifstream in(picture.file, std::ios::binary);
        const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
        const std::string words = escape(picture.words);
        out += "<figure><img alt=\"" + words + "\" src=\"data:image/png;base64," + base64(bytes) + "\"><figcaption>" +
               words + "</figcaption></figure>";
    }
    return out + "</div></section>";
}

}  // namespace palpate::report
