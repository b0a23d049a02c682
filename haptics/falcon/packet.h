#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace palpate::falcon {

// 16 bytes each way, strictly in turn: '<', three signed 16-bit numbers as four nibbles each (the lowest first), lamps and
// homing or buttons and homed flags, a byte that is not known, '>'. Every byte in between is its value + 0x41.
inline constexpr std::size_t packetBytes = 16;
using Packet = std::array<std::uint8_t, packetBytes>;

using Triple = std::array<std::int16_t, 3>;  // by leg

inline constexpr std::uint8_t lampRed = 0x02, lampGreen = 0x04, lampBlue = 0x08;
inline constexpr std::uint8_t buttonRight = 0x01, buttonForward = 0x02, buttonCentre = 0x04, buttonLeft = 0x08;
inline constexpr std::uint8_t allHomed = 0x70;

/// To the device.
struct Command {
    Triple motor{};          // torques as the device counts them, see motorCommand()
    std::uint8_t lamps = 0;  // lampRed | ...
    bool home = false;       // look for the encoders' zero

    bool operator==(const Command&) const = default;
};

/// From the device.
struct Reading {
    Triple count{};            // of the encoders
    std::uint8_t buttons = 0;  // buttonRight | ...
    std::uint8_t homed = 0;    // one bit for each leg: allHomed when all are

    bool operator==(const Reading&) const = default;
};

Packet encode(const Command& command) noexcept;
Packet encode(const Reading& reading) noexcept;

/// What a packet says; nothing where it is none: there is no checksum, so only marks and ranges can tell.
std::optional<Command> decodeCommand(std::span<const std::uint8_t, packetBytes> bytes) noexcept;
std::optional<Reading> decodeReading(std::span<const std::uint8_t, packetBytes> bytes) noexcept;

/// Finds packets in a stream of bytes, whatever is lost or garbled between them.
class PacketStream {
public:
    /// Takes one byte; true when it completes 16 that begin and end as a packet does: they are in packet().
    bool take(std::uint8_t byte) noexcept;
    const Packet& packet() const noexcept { return bytes_; }
    void clear() noexcept { count_ = 0; }
    /// Bytes thrown away so far because they belonged to no packet.
    std::uint64_t lost() const noexcept { return lost_; }

private:
    Packet bytes_{};
    std::size_t count_ = 0;
    std::uint64_t lost_ = 0;
};

}  // namespace palpate::falcon
