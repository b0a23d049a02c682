#include <apps/falcon.h>

#include <haptics/falcon/usb.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <atomic>
#include <stdexcept>

namespace palpate::apps {

namespace {

constexpr double gravity = 9.81;  // [m/s^2]

}  // namespace

void addFalconOptions(CLI::App& command, FalconOptions& options)
{
    command.add_option("--falcon-firmware", options.firmware,
                       "Firmware of the Novint Falcon, which it loses with its power supply (a file of its maker's)");
    command.add_option("--falcon-grip-g", options.grip, "Mass of the Falcon's grip, which its motors carry [g]")
        ->check(CLI::Range(0.0, 300.0))
        ->capture_default_str();
    command.add_option("--on-unplug", options.onUnplug, "When the Falcon is unplugged: exit, or wait for it")
        ->check(CLI::IsMember({"exit", "wait"}))
        ->capture_default_str();
}

void checkFalconOptions(const CLI::App& command, bool falcon)
{
    for (const char* name : {"--falcon-firmware", "--falcon-grip-g", "--on-unplug"}) {
        if (!falcon && command.count(name) > 0) {
            throw std::runtime_error(fmt::format("{}: goes with --device falcon", name));
        }
    }
}

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

}  // namespace palpate::apps
