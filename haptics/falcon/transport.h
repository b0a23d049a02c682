#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>

namespace palpate::falcon {

inline constexpr std::uint16_t vendorId = 0x0403, productId = 0xCB48;
inline constexpr std::uint8_t endpointIn = 0x81, endpointOut = 0x02;
inline constexpr std::size_t usbPacket = 64;  // bytes at full speed

/// What is wrong with a Falcon, each with a remedy of its own.
enum class Cause : std::uint8_t {
    absent,        // none is plugged in
    permission,    // it may not be opened
    busy,          // another program or driver holds it
    silent,        // it does not answer: power, cable
    garbled,       // what comes back is not what was sent: hub, cable
    firmwareFile,  // no file, or one that cannot be
    firmware,      // the image was taken and does not run
    homing,        // not homed by its user
    frozen,        // the encoders stand still
    unplugged,     // while it was in use
    interrupted,   // by the user
};

class Trouble : public std::runtime_error {
public:
    Trouble(Cause cause, const std::string& what) : std::runtime_error(what), cause_(cause) {}
    Cause cause() const noexcept { return cause_; }

private:
    Cause cause_;
};

/// Tells the user something, one line.
using Say = std::function<void(const std::string&)>;

/// Vendor requests of the serial bridge (FTDI), bmRequestType 0x40.
enum class Request : std::uint8_t { reset = 0, modemControl = 1, flowControl = 2, baud = 3, format = 4, latency = 9 };

namespace bridge {
inline constexpr std::uint16_t purgeIn = 1, purgeOut = 2;                          // of Request::reset
inline constexpr std::uint16_t dtrLow = 0x0100, dtrHigh = 0x0101;                  // of Request::modemControl
inline constexpr std::uint16_t rtsLow = 0x0200;                                    //
inline constexpr std::uint16_t noFlowControl = 0;                                  // of Request::flowControl
inline constexpr std::uint16_t baud9600 = 0x4138, baud140k = 0x15, baud1500k = 2;  // of Request::baud
inline constexpr std::uint16_t eightN1 = 8;                                        // of Request::format
inline constexpr std::size_t statusBytes = 2;  // at the head of every packet that comes in
}  // namespace bridge

/// The wire to one Falcon: a serial bridge with its settings, bytes out, bytes in. Used by one thread at a time.
class Transport {
public:
    virtual ~Transport() = default;

    /// Finds the Falcon and claims it. Throws Trouble: absent, permission, busy.
    virtual void open() = 0;
    virtual void close() noexcept = 0;
    /// Throws Trouble: unplugged, silent.
    virtual void control(Request request, std::uint16_t value) = 0;
    /// Up to 64 bytes on their way. Does not wait for them to arrive; false when they cannot be sent.
    virtual bool send(std::span<const std::uint8_t> bytes) noexcept = 0;
    /// Waits at most so long [s] until bytes are there, without the bridge's status; returns how many. Those that came
    /// first come first.
    virtual std::size_t receive(std::span<std::uint8_t> into, double seconds) noexcept = 0;
    /// True once the Falcon is no longer there; open() tries again.
    virtual bool gone() const noexcept = 0;

    /// Time that only goes forward [s]. Any thread.
    virtual double now() const noexcept = 0;
    virtual void sleep(double seconds) noexcept = 0;
    /// A file descriptor through which a process that is dying can still send (usbfs); -1: there is none.
    virtual int descriptor() const noexcept { return -1; }
};

}  // namespace palpate::falcon
