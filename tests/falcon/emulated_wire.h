#pragma once

#include <haptics/falcon/bytes.h>
#include <haptics/falcon/transport.h>
#include <tests/falcon/emulator.h>

namespace palpate::falcon {

/// A wire to an emulated Falcon in the same process, in the emulator's time: nothing waits, so that hours pass in seconds.
class EmulatedWire final : public Transport {
public:
    explicit EmulatedWire(Emulator& device) : device_(device) {}

    bool plugged = true;
    bool allowed = true;
    bool busy = false;
    double usbLatency = 0.125e-3;  // of every transfer [s]

    void open() override;
    void close() noexcept override { open_ = false; }
    void control(Request request, std::uint16_t value) override;
    bool send(std::span<const std::uint8_t> bytes) noexcept override;
    std::size_t receive(std::span<std::uint8_t> into, double seconds) noexcept override;
    bool gone() const noexcept override { return gone_; }
    double now() const noexcept override { return device_.now() + 1.0; }
    void sleep(double seconds) noexcept override { device_.advance(seconds); }
    int opened() const noexcept { return opened_; }  // how often

private:
    bool look() noexcept;

    Emulator& device_;
    Bytes bytes_;
    bool open_ = false;
    bool gone_ = false;
    int opened_ = 0;
};

}  // namespace palpate::falcon
