#pragma once

#include <haptics/falcon/link.h>
#include <tests/falcon/emulated_wire.h>
#include <tests/falcon/emulator.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

namespace palpate::falcon {

/// Bytes that no Falcon would run, but an emulated one.
inline Firmware syntheticFirmware(std::size_t bytes = 3000)
{
    std::mt19937 random(42);
    Firmware firmware{"firmware.bin", std::vector<std::uint8_t>(bytes)};
    for (auto& byte : firmware.image) {
        byte = static_cast<std::uint8_t>(random());
    }
    return firmware;
}

inline int largestOf(const Triple& motor)
{
    return std::max({std::abs(motor[0]), std::abs(motor[1]), std::abs(motor[2])});
}

/// A link to an emulated Falcon in the emulator's time.
struct Rig {
    explicit Rig(LinkOptions options = {syntheticFirmware()})
        : device(syntheticFirmware().image), wire(device), link(wire, std::move(options), [this](const std::string& what) {
              said.push_back(what);
              if (onSay) {
                  onSay(what);
              }
          })
    {
        device.hand.goal = {0.005, -0.003, 0.145};
    }

    /// Whether something was said that holds these words.
    bool heard(const std::string& words) const
    {
        return std::ranges::any_of(said, [&](const auto& line) { return line.find(words) != std::string::npos; });
    }

    /// Orders a force in every exchange for so long.
    void push(Vec3 force, double seconds)
    {
        for (const double end = wire.now() + seconds; wire.now() < end;) {
            link.exchange({force, wire.now(), 1});
            watch();
        }
    }

    /// Notes what the motors were told.
    void watch()
    {
        const Triple& now = link.command().motor;
        largest = std::max(largest, largestOf(now));
        for (std::size_t i = 0; i < 3; ++i) {
            // Growth alone: off is always allowed.
            jump = std::max(jump, std::abs(now[i]) - std::abs(before[i]));
        }
        before = now;
    }

    std::atomic<bool> stop{false};
    std::vector<std::string> said;
    std::function<void(const std::string&)> onSay;
    Emulator device;
    EmulatedWire wire;
    Link link;
    int largest = 0, jump = 0;
    Triple before{};
};

}  // namespace palpate::falcon
