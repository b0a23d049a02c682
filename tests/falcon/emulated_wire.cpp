#include <tests/falcon/emulated_wire.h>

#include <algorithm>

namespace palpate::falcon {

void EmulatedWire::open()
{
    if (!plugged) {
        throw Trouble(Cause::absent, "no Falcon is plugged in");
    }
    if (!allowed) {
        throw Trouble(Cause::permission, "the Falcon may not be opened");
    }
    if (busy) {
        throw Trouble(Cause::busy, "another program uses the Falcon");
    }
    open_ = true;
    gone_ = false;
    bytes_.clear();
    ++opened_;
}

// Whether there is anything to talk to.
bool EmulatedWire::look() noexcept
{
    gone_ = gone_ || (open_ && !plugged);
    return open_ && !gone_;
}

void EmulatedWire::control(Request request, std::uint16_t value)
{
    device_.advance(usbLatency);
    if (!look()) {
        throw Trouble(Cause::unplugged, "the Falcon was unplugged");
    }
    device_.control(static_cast<std::uint8_t>(request), value);
    if (request == Request::reset && value == bridge::purgeIn) {
        bytes_.clear();
    }
}

bool EmulatedWire::send(std::span<const std::uint8_t> bytes) noexcept
{
    if (!look()) {
        return false;
    }
    device_.advance(usbLatency);
    device_.put(bytes);
    return true;
}

std::size_t EmulatedWire::receive(std::span<std::uint8_t> into, double seconds) noexcept
{
    const double end = now() + seconds;
    while (look()) {
        const auto packet = device_.take();
        bytes_.takeTransfer(packet);
        const double left = end - now();
        if (!bytes_.empty() || left <= 0.0) {
            break;
        }
        device_.advance(std::min(usbLatency, left));
    }
    return bytes_.give(into);
}

}  // namespace palpate::falcon
