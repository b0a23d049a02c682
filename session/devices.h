#pragma once

#include <haptics/broadcast.h>
#include <haptics/device.h>
#include <haptics/falcon/driver.h>
#include <haptics/session_model.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace palpate::session {

/// What a device is opened for.
struct DeviceRequest {
    std::string name = "hand";               // one of deviceKinds(), or the file of a record whose poses are played
    std::string trainee;                     // whose hand it is, see haptics/trainee.h; empty: the scene's script
    std::uint64_t seed = 1;                  // of the trainee's errors
    std::shared_ptr<falcon::Driver> falcon;  // of "falcon": ready
    std::optional<std::uint64_t> offPlan{};  // of "mouse": it begins beside the plan, where this seed says
};

/// A kind of device that a session can have. The one list of them: commands, their help and sessions go by it.
struct DeviceKind {
    std::string_view name;  // on the command line; empty: every other name
    std::string_view what;  // in the help of --device
    std::string_view arm;   // simulated arm that the stabiliser reckons with, see haptics/arm.h; empty: the scene's
    bool somebodyHolds;     // real time only, and no trainee
    bool needsViewer;       // its poses come from a viewer
    /// Opens it; throws std::runtime_error.
    std::unique_ptr<haptics::Device> (*open)(const haptics::SessionModel& model, const DeviceRequest& request,
                                             const haptics::Broadcast* broadcast);
};

std::span<const DeviceKind> deviceKinds() noexcept;

/// "hand (a scripted trainee), mouse (in the viewer's window), ... or a record (.db) to play back"
std::string devicesInWords();

/// The kind called `name`; that of records for any other name.
const DeviceKind& deviceKind(std::string_view name) noexcept;

/// Opens the device that is asked for, some centimetres outside of the body.
/// @param model      that it works on
/// @param request    which, and whose hand it is
/// @param broadcast  the session's channel to viewers; null where there is none
/// Throws std::runtime_error where tool, task and trainee do not go together, and for a record that cannot be read.
std::unique_ptr<haptics::Device> openDevice(const haptics::SessionModel& model, const DeviceRequest& request,
                                            const haptics::Broadcast* broadcast);

}  // namespace palpate::session
