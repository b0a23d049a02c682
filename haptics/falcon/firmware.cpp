#include <haptics/falcon/firmware.h>

#include <haptics/falcon/trouble_if.h>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>

namespace palpate::falcon {

namespace {

constexpr std::size_t smallest = 512, largest = std::size_t{1} << 20U;  // that an image can be [bytes]
constexpr std::size_t chunk = 62;                                       // of the upload: a packet less the status [bytes]
constexpr int greetings = 5;
constexpr double answerTime = 0.3;  // [s]
constexpr double echoTime = 1.0;    // of a chunk [s]
constexpr double breath = 0.02;     // between settings that the device's processor has to see [s]

// Reads until `want` bytes are there or the time is over.
std::vector<std::uint8_t> collect(Transport& wire, std::size_t want, double seconds)
{
    std::vector<std::uint8_t> bytes;
    std::array<std::uint8_t, usbPacket> part{};
    const double end = wire.now() + seconds;
    while (bytes.size() < want && !wire.gone()) {
        const double left = end - wire.now();
        if (left <= 0.0) {
            break;
        }
        const std::size_t n = wire.receive(part, left);
        bytes.insert(bytes.end(), part.begin(), part.begin() + static_cast<std::ptrdiff_t>(n));
    }
    troubleIf(wire.gone(), Cause::unplugged,
              "the Falcon was unplugged while its firmware was loaded: plug it in and start again");
    return bytes;
}

void put(Transport& wire, std::span<const std::uint8_t> bytes)
{
    const bool sent = wire.send(bytes);
    troubleIf(!sent, wire.gone() ? Cause::unplugged : Cause::silent,
              "the Falcon takes no bytes: check its cable and power supply, then plug it in again");
}

// The loader's answer, with or without a zero before it.
bool isWelcome(std::span<const std::uint8_t> answer)
{
    constexpr std::array<std::uint8_t, 4> welcome{0x0A, 0x44, 0x2C, 0x0D};
    const auto rest = !answer.empty() && answer[0] == 0 ? answer.subspan(1) : answer;
    return std::ranges::equal(rest.first(std::min(rest.size(), welcome.size())), welcome);
}

void greet(Transport& wire)
{
    constexpr std::array<std::uint8_t, 3> greeting{0x0A, 0x43, 0x0D};
    bool heard = false;
    for (int i = 0; i < greetings; ++i) {
        put(wire, greeting);
        auto answer = collect(wire, 4, answerTime);
        if (answer.size() == 4 && answer[0] == 0) {
            const auto rest = collect(wire, 1, answerTime);
            answer.insert(answer.end(), rest.begin(), rest.end());
        }
        if (isWelcome(answer)) {
            return;
        }
        heard = heard || !answer.empty();
    }
    troubleIf(heard, Cause::garbled,
              "the Falcon's loader answers with something else: plug it straight into the computer instead of a hub, or "
              "take another cable");
    throw Trouble(
        Cause::silent,
        "the Falcon is there but does not answer: plug in its power supply (the lamps light up), then check the cable");
}

void compareEcho(std::span<const std::uint8_t> sent, std::span<const std::uint8_t> echo, std::size_t offset,
                 std::size_t total)
{
    const auto [there, back] = std::ranges::mismatch(sent, echo);
    if (there == sent.end()) {
        return;
    }
    const auto at = offset + static_cast<std::size_t>(there - sent.begin());
    const std::string what =
        back == echo.end() ? std::string("did not come back") : fmt::format("came back as 0x{:02x}", *back);
    throw Trouble(Cause::garbled,
                  fmt::format("firmware byte {} of {} (0x{:02x}) {}: plug the Falcon straight into the computer instead "
                              "of a hub, or take another cable",
                              at + 1, total, *there, what));
}

// What the bytes are where they cannot be a program for a processor; empty where they may be.
std::string otherThanFirmware(std::span<const std::uint8_t> image)
{
    const auto begins = [&](std::string_view with) {
        return std::equal(with.begin(), with.end(), image.begin(),
                          [](char a, std::uint8_t b) { return static_cast<std::uint8_t>(a) == b; });
    };
    constexpr std::array<std::pair<std::string_view, const char*>, 6> kinds{{{"PK\x03\x04", "a ZIP archive"},
                                                                             {"\x1f\x8b", "a gzip archive"},
                                                                             {"MZ", "a Windows program"},
                                                                             {"\x7f"
                                                                              "ELF",
                                                                              "a Linux program"},
                                                                             {"%PDF", "a PDF document"},
                                                                             {"Rar!", "a RAR archive"}}};
    for (const auto& [start, what] : kinds) {
        if (begins(start)) {
            return what;
        }
    }
    if (std::ranges::all_of(image, [&](std::uint8_t b) { return b == image[0]; })) {
        return fmt::format("the byte 0x{:02x} and no other", image[0]);
    }
    const bool text = std::ranges::all_of(
        image, [](std::uint8_t b) { return (b >= 0x20 && b < 0x7F) || b == '\n' || b == '\r' || b == '\t'; });
    return text ? "text" : "";
}

}  // namespace

Firmware readFirmware(const std::filesystem::path& file)
{
    Firmware firmware{file.string(), {}};
    const auto refuseIf = [&](bool wrong, const std::string& what) {
        troubleIf(wrong, Cause::firmwareFile, "{}: {}: give the file with the Falcon's firmware", file.string(), what);
    };
    // By its size before a byte is read: a device such as /dev/zero has no end.
    std::error_code none;
    refuseIf(!std::filesystem::is_regular_file(file, none),
             std::filesystem::exists(file, none) ? "is no regular file" : "cannot be read");
    const std::uintmax_t size = std::filesystem::file_size(file, none);
    refuseIf(none || size < smallest || size > largest,
             fmt::format("has {} bytes, a Falcon's firmware has {} to {}", none ? 0 : size, smallest, largest));
    std::ifstream stream(file, std::ios::binary);
    firmware.image.resize(size);
    refuseIf(!stream.read(reinterpret_cast<char*>(firmware.image.data()), static_cast<std::streamsize>(size)),
             "cannot be read");
    const std::string other = otherThanFirmware(firmware.image);
    refuseIf(!other.empty(), "holds " + other);
    return firmware;
}

void loadFirmware(Transport& wire, const Firmware& firmware, const std::atomic<bool>& stop)
{
    wire.control(Request::reset, bridge::purgeIn);
    wire.control(Request::reset, bridge::purgeOut);
    wire.control(Request::latency, 16);
    wire.control(Request::baud, bridge::baud9600);
    wire.control(Request::format, bridge::eightN1);
    wire.control(Request::flowControl, bridge::noFlowControl);
    wire.control(Request::modemControl, bridge::rtsLow);
    wire.control(Request::modemControl, bridge::dtrLow);
    wire.sleep(breath);
    wire.control(Request::modemControl, bridge::dtrHigh);
    wire.sleep(breath);
    greet(wire);

    wire.control(Request::modemControl, bridge::dtrLow);
    wire.control(Request::baud, bridge::baud140k);
    wire.sleep(breath);
    constexpr std::array<std::uint8_t, 1> begin{0x41};
    put(wire, begin);
    compareEcho(begin, collect(wire, 1, echoTime), 0, 1);

    const std::span<const std::uint8_t> image(firmware.image);
    for (std::size_t at = 0; at < image.size(); at += chunk) {
        troubleIf(stop, Cause::interrupted, "interrupted while the Falcon's firmware was loaded");
        const auto part = image.subspan(at, std::min(chunk, image.size() - at));
        put(wire, part);
        compareEcho(part, collect(wire, part.size(), echoTime), at, image.size());
    }
}

void enterRunMode(Transport& wire)
{
    wire.control(Request::latency, 1);
    wire.control(Request::baud, bridge::baud1500k);
    wire.control(Request::reset, bridge::purgeIn);
    wire.control(Request::reset, bridge::purgeOut);
}

}  // namespace palpate::falcon
