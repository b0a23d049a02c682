#include <haptics/falcon/bytes.h>
#include <haptics/falcon/packet.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

namespace palpate::falcon {
namespace {

Triple anyTriple(std::mt19937& random)
{
    std::uniform_int_distribution<int> number(-32768, 32767);
    return {static_cast<std::int16_t>(number(random)), static_cast<std::int16_t>(number(random)),
            static_cast<std::int16_t>(number(random))};
}

// -2 is 0xFFFE: nibbles E F F F, lowest first; the rest by the protocol's description.
TEST(Packet, BytesAreThoseOfTheProtocol)
{
    const Packet bytes = encode(Command{{-2, 0x1234, 0}, lampRed | lampBlue, true});
    const Packet expected{'<',  0x4F, 0x50, 0x50, 0x50, 0x45,        0x44, 0x43,
                          0x42, 0x41, 0x41, 0x41, 0x41, 0x41 + 0x0B, 0x41, '>'};
    EXPECT_EQ(bytes, expected);
}

TEST(Packet, EveryMessageComesBackAsItWas)
{
    std::mt19937 random(1);
    for (int i = 0; i < 20000; ++i) {
        const Command command{anyTriple(random), static_cast<std::uint8_t>(random() & 0x0EU), random() % 2 == 0};
        EXPECT_EQ(decodeCommand(encode(command)), command);
        const Reading reading{anyTriple(random), static_cast<std::uint8_t>(random() & 0x0FU),
                              static_cast<std::uint8_t>(random() & 0x70U)};
        EXPECT_EQ(decodeReading(encode(reading)), reading);
    }
}

// A flipped bit either leaves a packet that says something else in one place, or none; never one that says more.
TEST(Packet, BytesOutOfRangeAreRefused)
{
    const Packet sound = encode(Reading{{1, -1, 1000}, buttonCentre, allHomed});
    for (std::size_t at = 0; at < packetBytes; ++at) {
        for (int value = 0; value < 256; ++value) {
            Packet bytes = sound;
            bytes[at] = static_cast<std::uint8_t>(value);
            const bool mark = at == 0 || at == packetBytes - 1;
            const bool nibble = at >= 1 && at <= 12;
            const bool sayable = mark       ? value == sound[at]
                                 : nibble   ? value >= 0x41 && value < 0x51
                                 : at == 13 ? value >= 0x41 && value < 0x41 + 0x80
                                            : true;
            EXPECT_EQ(decodeReading(bytes).has_value(), sayable) << "byte " << at << " value " << value;
        }
    }
}

// Whatever is between them: every packet that follows a whole one is found, and none that was not sent.
TEST(PacketStream, FindsPacketsAmongRubbish)
{
    std::mt19937 random(2);
    PacketStream stream;
    std::vector<std::int16_t> sent, found;
    for (int i = 0; i < 5000; ++i) {
        const auto number = static_cast<std::int16_t>(i);
        auto packet = encode(Reading{{number, number, number}, 0, 0});
        std::vector<std::uint8_t> bytes(packet.begin(), packet.end());
        const auto cut = static_cast<std::ptrdiff_t>(random() % 15U);
        const bool damaged = random() % 3 == 0;
        if (damaged) {
            bytes.erase(bytes.begin() + cut);
        } else {
            sent.push_back(number);
        }
        bytes.insert(bytes.begin(), random() % 4U, static_cast<std::uint8_t>(random() % 0x3CU));
        for (const std::uint8_t byte : bytes) {
            const auto reading = stream.take(byte) ? decodeReading(stream.packet()) : std::nullopt;
            if (reading) {
                found.push_back(reading->count[0]);
            }
        }
    }
    EXPECT_EQ(found, sent);
    EXPECT_GT(stream.lost(), 1000U);
}

// Of each 64 bytes the first two are the bridge's own; a packet may hold these alone.
TEST(Bytes, StatusIsStrippedFromEveryPacket)
{
    Bytes bytes;
    std::vector<std::uint8_t> transfer(2 + 62 + 2 + 5);
    std::iota(transfer.begin(), transfer.end(), std::uint8_t{0});
    bytes.takeTransfer(transfer);
    bytes.takeTransfer(std::vector<std::uint8_t>{1, 0x60});
    std::vector<std::uint8_t> data(200);
    ASSERT_EQ(bytes.give(data), 67U);
    for (std::size_t i = 0; i < 62; ++i) {
        EXPECT_EQ(data[i], i + 2);
    }
    EXPECT_EQ(data[62], 66);
    EXPECT_TRUE(bytes.empty());
}

TEST(Bytes, NewestAreKeptWhenNobodyFetches)
{
    Bytes bytes;
    for (int i = 0; i < 1000; ++i) {
        const auto value = static_cast<std::uint8_t>(i % 251);
        bytes.takeTransfer(std::vector<std::uint8_t>{1, 0x60, value, value, value, value, value, value, value, value});
    }
    std::vector<std::uint8_t> data(8000);
    const std::size_t n = bytes.give(data);
    EXPECT_EQ(n, 4096U);
    EXPECT_EQ(data[n - 1], 999 % 251);
    EXPECT_EQ(data[0], (1000 - 4096 / 8) % 251);
}

}  // namespace
}  // namespace palpate::falcon
