#include <session/falcon.h>

#include <haptics/falcon/usb.h>

#include <fmt/format.h>

#include <atomic>

namespace palpate::session {

constexpr double gravity = 9.81;  // [m/s^2]

void sayForFalcon(const std::string& what)
{
    fmt::print(stderr, "palpate: {}\n", what);
}

falcon::LinkOptions linkOptions(const FalconOptions& options)
{
    falcon::LinkOptions link;
    if (!options.firmware.empty()) {
        link.firmware = falcon::readFirmware(options.firmware);
    }
    link.weight = 1e-3 * options.grip * gravity;
    return link;
}

std::shared_ptr<falcon::Driver> openFalcon(const FalconOptions& options)
{
    falcon::DriverOptions driver;
    driver.link = linkOptions(options);
    driver.onUnplug = options.onUnplug == "wait" ? falcon::OnUnplug::wait : falcon::OnUnplug::exit;
    // No torque is on before the session has begun: until then Ctrl-C may end the program as it always does.
    static const std::atomic<bool> never{false};
    return std::make_shared<falcon::Driver>(falcon::usbTransport(), std::move(driver), sayForFalcon, never);
}

}  // namespace palpate::session
