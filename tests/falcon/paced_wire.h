#pragma once

#include <haptics/falcon/bytes.h>
#include <haptics/falcon/transport.h>
#include <tests/falcon/emulator.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

namespace palpate::falcon {

/// An emulated Falcon that lives in real time, for what runs in threads. It outlives the wires to it.
struct PacedFalcon {
    explicit PacedFalcon(std::vector<std::uint8_t> firmware) : device(std::move(firmware)) {}

    double now() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() + 1.0; }
    /// Looks at the Falcon, or does something to it, as it is now.
    template <typename Look>
    auto with(const Look& look)
    {
        const std::lock_guard lock(guard);
        device.advance(now() - 1.0 - device.now());
        return look(device);
    }

    std::atomic<bool> plugged{true};

private:
    std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
    std::mutex guard;
    Emulator device;
};

class PacedWire final : public Transport {
public:
    explicit PacedWire(PacedFalcon& falcon) : falcon_(falcon) {}

    void open() override
    {
        if (!falcon_.plugged) {
            throw Trouble(Cause::absent, "no Falcon is plugged in");
        }
        gone_ = false;
        bytes_.clear();
    }
    void close() noexcept override {}
    void control(Request request, std::uint16_t value) override
    {
        falcon_.with([&](Emulator& d) { return d.control(static_cast<std::uint8_t>(request), value); });
    }
    bool send(std::span<const std::uint8_t> bytes) noexcept override
    {
        if (lost()) {
            return false;
        }
        falcon_.with([&](Emulator& d) { d.put(bytes); });
        return true;
    }
    std::size_t receive(std::span<std::uint8_t> into, double seconds) noexcept override
    {
        const double end = now() + seconds;
        while (!lost()) {
            bytes_.takeTransfer(falcon_.with([](Emulator& d) { return d.take(); }));
            if (!bytes_.empty() || now() >= end) {
                break;
            }
            sleep(50e-6);
        }
        return bytes_.give(into);
    }
    bool gone() const noexcept override { return gone_; }
    double now() const noexcept override { return falcon_.now(); }
    void sleep(double seconds) noexcept override { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

private:
    bool lost() noexcept { return gone_ = gone_ || !falcon_.plugged; }

    PacedFalcon& falcon_;
    Bytes bytes_;
    bool gone_ = false;
};

}  // namespace palpate::falcon
