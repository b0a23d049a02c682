#pragma once

#include <haptics/falcon/transport.h>

#include <memory>
#include <string>
#include <vector>

namespace palpate::falcon {

/// A Falcon on the USB, and what stands in the way of using it.
struct UsbFalcon {
    int bus = 0, address = 0;
    std::string node;      // /dev/bus/usb/BBB/DDD
    std::string driver;    // of the kernel's that has bound its interface; empty: none
    bool allowed = false;  // to open it for reading and writing
};

/// What is plugged in, whether it may be opened or not. Throws std::runtime_error without USB.
std::vector<UsbFalcon> listFalcons();

/// The real wire: libusb with asynchronous transfers, several waiting for what comes in, so that nothing is lost between
/// two looks. A kernel driver that has bound the interface (ftdi_sio) is detached, and bound again by close().
std::unique_ptr<Transport> usbTransport();

/// The rule that lets the user who sits at the computer open a Falcon, and where it belongs.
inline constexpr const char* udevRuleFile = "70-palpate-falcon.rules";
std::string udevRule();

}  // namespace palpate::falcon
