#include <haptics/falcon/packet.h>

#include <algorithm>
#include <iterator>

namespace palpate::falcon {

namespace {

constexpr std::uint8_t first = '<', last = '>';
constexpr std::uint8_t base = 0x41;  // of every byte in between
constexpr std::uint8_t homeBit = 0x01;
constexpr std::uint8_t lampBits = lampRed | lampGreen | lampBlue;
constexpr std::uint8_t buttonBits = 0x0F;
constexpr std::size_t flagsAt = 13, unknownAt = 14;

Packet framed(const Triple& numbers, std::uint8_t flags) noexcept
{
    Packet bytes{};
    bytes.front() = first;
    bytes.back() = last;
    for (std::size_t leg = 0; leg < 3; ++leg) {
        const auto bits = static_cast<std::uint16_t>(numbers[leg]);
        for (unsigned nibble = 0; nibble < 4; ++nibble) {
            bytes[1 + 4 * leg + nibble] = static_cast<std::uint8_t>(base + ((bits >> (4 * nibble)) & 0xFU));
        }
    }
    bytes[flagsAt] = static_cast<std::uint8_t>(base + flags);
    bytes[unknownAt] = base;
    return bytes;
}

struct Content {
    Triple numbers{};
    std::uint8_t flags = 0;
};

std::optional<Content> contentOf(std::span<const std::uint8_t, packetBytes> bytes, std::uint8_t flagBits) noexcept
{
    if (bytes.front() != first || bytes.back() != last) {
        return std::nullopt;
    }
    Content content;
    for (std::size_t leg = 0; leg < 3; ++leg) {
        unsigned bits = 0;
        for (unsigned nibble = 0; nibble < 4; ++nibble) {
            const unsigned value = static_cast<unsigned>(bytes[1 + 4 * leg + nibble]) - base;
            if (value > 0xFU) {
                return std::nullopt;
            }
            bits |= value << (4 * nibble);
        }
        content.numbers[leg] = static_cast<std::int16_t>(static_cast<std::uint16_t>(bits));
    }
    const unsigned flags = static_cast<unsigned>(bytes[flagsAt]) - base;
    if ((flags & ~static_cast<unsigned>(flagBits)) != 0U) {
        return std::nullopt;
    }
    content.flags = static_cast<std::uint8_t>(flags);
    return content;
}

}  // namespace

Packet encode(const Command& command) noexcept
{
    return framed(command.motor, static_cast<std::uint8_t>((command.lamps & lampBits) | (command.home ? homeBit : 0)));
}

Packet encode(const Reading& reading) noexcept
{
    return framed(reading.count, static_cast<std::uint8_t>((reading.buttons & buttonBits) | (reading.homed & allHomed)));
}

std::optional<Command> decodeCommand(std::span<const std::uint8_t, packetBytes> bytes) noexcept
{
    const auto content = contentOf(bytes, lampBits | homeBit);
    if (!content) {
        return std::nullopt;
    }
    return Command{content->numbers, static_cast<std::uint8_t>(content->flags & lampBits), (content->flags & homeBit) != 0};
}

std::optional<Reading> decodeReading(std::span<const std::uint8_t, packetBytes> bytes) noexcept
{
    const auto content = contentOf(bytes, buttonBits | allHomed);
    if (!content) {
        return std::nullopt;
    }
    return Reading{content->numbers, static_cast<std::uint8_t>(content->flags & buttonBits),
                   static_cast<std::uint8_t>(content->flags & allHomed)};
}

bool PacketStream::take(std::uint8_t byte) noexcept
{
    if (count_ == packetBytes) {
        count_ = 0;
    }
    bytes_[count_++] = byte;
    if (bytes_[0] != first) {
        count_ = 0;
        ++lost_;
        return false;
    }
    if (count_ < packetBytes) {
        return false;
    }
    if (byte == last) {
        return true;
    }
    // One was lost or came in between: a packet may begin further on.
    const auto* const next = std::find(bytes_.begin() + 1, bytes_.end(), first);
    lost_ += static_cast<std::uint64_t>(std::distance(bytes_.cbegin(), next));
    count_ = static_cast<std::size_t>(std::distance(next, bytes_.cend()));
    std::copy(next, bytes_.cend(), bytes_.begin());
    return false;
}

}  // namespace palpate::falcon
