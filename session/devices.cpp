#include <session/devices.h>

#include <base/error.h>
#include <base/mapped.h>
#include <haptics/falcon/device.h>
#include <haptics/hand.h>
#include <haptics/mouse.h>
#include <haptics/palpator.h>
#include <haptics/probe_follower.h>
#include <haptics/replay.h>
#include <haptics/trainee.h>
#include <haptics/trigger.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cassert>

namespace palpate::session {

namespace {

using haptics::Broadcast;
using haptics::Device;
using haptics::SessionModel;

constexpr double startDistance = 30e-3;  // a device begins this far outside the body [m]

std::unique_ptr<Device> openHand(const SessionModel& model, const DeviceRequest& request, const Broadcast*)
{
    if (model.scene.task == datasets::SessionTask::find) {
        const std::string& who = request.trainee.empty() ? "expert" : request.trainee;
        return std::make_unique<haptics::Palpator>(model, haptics::skillCalled(who), request.seed, startDistance);
    }
    if (!request.trainee.empty()) {
        return std::make_unique<haptics::Trainee>(model, haptics::skillCalled(request.trainee), request.seed,
                                                  startDistance);
    }
    return std::make_unique<haptics::HandDevice>(haptics::handBefore(model, startDistance));
}

std::unique_ptr<Device> openMouse(const SessionModel& model, const DeviceRequest& request, const Broadcast* broadcast)
{
    assert(broadcast != nullptr);
    const auto source = [broadcast] { return broadcast->input(); };
    return std::make_unique<haptics::MouseDevice>(
        request.offPlan ? haptics::mouseOffPlan(model, source, startDistance, *request.offPlan)
                        : haptics::mouseBefore(model, source, startDistance));
}

// A haptic device in the one hand, what guides it in the other, at a viewer: ultrasound probe, stored pictures, CT scans.
class WithViewer final : public Device {
public:
    WithViewer(std::unique_ptr<Device> device, const Broadcast& broadcast)
        : device_(std::move(device)), broadcast_(broadcast)
    {
    }

    haptics::DeviceSample read() noexcept override
    {
        if (const auto input = broadcast_.input()) {
            asked_ = input->probe;
            pictures_.done = heard_ ? pictures_.done : input->pictures;  // what one before has counted is none of ours
            presses_ = input->pictures;
            heard_ = true;
        }
        haptics::DeviceSample sample = device_->read();
        sample.probe = probe_.follow(asked_);
        sample.buttons |= pictures_.down(presses_) ? haptics::buttonPicture : 0U;
        return sample;
    }
    void write(Vec3 force) noexcept override { device_->write(force); }
    void observe(const haptics::TickRecord& record) noexcept override { device_->observe(record); }
    bool finished() const noexcept override { return device_->finished(); }
    std::string problem() const override { return device_->problem(); }

private:
    std::unique_ptr<Device> device_;
    const Broadcast& broadcast_;
    std::array<double, 6> asked_{};
    haptics::ProbeFollower probe_;
    haptics::Trigger pictures_;
    std::uint32_t presses_ = 0;
    bool heard_ = false;
};

std::unique_ptr<Device> openFalcon(const SessionModel& model, const DeviceRequest& request, const Broadcast* broadcast)
{
    base::failIf(!request.falcon, "device 'falcon': there is nothing that opens it (DeviceRequest::falcon)");
    auto device = falcon::falconBefore(model, request.falcon, startDistance);
    const bool guided = model.scene.probe.kind != datasets::ProbeKind::none || model.scene.ct.given();
    if (broadcast == nullptr || !guided) {
        return device;
    }
    return std::make_unique<WithViewer>(std::move(device), *broadcast);
}

// A new device is a line here. The last stands for all other names.
constexpr std::array kinds{
    DeviceKind{"hand", "hand (a scripted trainee)", "", false, false, openHand},
    DeviceKind{"mouse", "mouse (in the viewer's window)", "", true, true, openMouse},
    DeviceKind{"falcon", "falcon (Novint Falcon)", "falcon", true, false, openFalcon},
    DeviceKind{"", "a record (.db) to play back", "", false, false,
               [](const SessionModel&, const DeviceRequest& request, const Broadcast*) -> std::unique_ptr<Device> {
                   const haptics::Record record(request.name);
                   base::failIf(record.info().rate != 1.0 / haptics::tickSeconds,
                                "{}: was recorded at {:g} Hz, and a session runs at {:g}: palpate replay computes it again",
                                request.name, record.info().rate, 1.0 / haptics::tickSeconds);
                   return std::make_unique<haptics::ReplayDevice>(record);
               }},
};

void checkTool(const DeviceRequest& request, const datasets::Scene& scene)
{
    if (!request.trainee.empty()) {
        haptics::skillCalled(request.trainee);  // that there is such a one
    }
    const bool needle = scene.tool.kind == datasets::ToolKind::needle;
    base::failIf(needle && scene.task == datasets::SessionTask::find,
                 "{}: task \"find\" with a needle: give [tool] kind = \"capsule\" or \"sphere\"", scene.name);
    base::failIf(!needle && scene.task == datasets::SessionTask::advance,
                 "{}: task \"advance\" without a needle: give [tool] kind = \"needle\"", scene.name);
    base::failIf(!needle && scene.task == datasets::SessionTask::touch && !request.trainee.empty(),
                 "{}: --trainee {} holds a needle and the tool is none: leave --trainee away", scene.name, request.trainee);
    base::failIf(!needle && scene.task == datasets::SessionTask::biopsy && !request.trainee.empty(),
                 "{}: --trainee {} takes a biopsy and the tool is no needle: choose another scene, or add --palpate",
                 scene.name, request.trainee);
}

}  // namespace

std::string devicesInWords()
{
    const auto words = base::mapped<std::string>(deviceKinds(), [](const DeviceKind& kind) {
        return fmt::format("{}{}", kind.name.empty() ? "or " : "", kind.what);
    });
    return fmt::format("{}", fmt::join(words, ", "));
}

std::span<const DeviceKind> deviceKinds() noexcept
{
    return kinds;
}

const DeviceKind& deviceKind(std::string_view name) noexcept
{
    const auto* const found = std::ranges::find(kinds, name, &DeviceKind::name);
    return found != kinds.end() ? *found : kinds.back();
}

std::unique_ptr<Device> openDevice(const SessionModel& model, const DeviceRequest& request, const Broadcast* broadcast)
{
    checkTool(request, model.scene);
    return deviceKind(request.name).open(model, request, broadcast);
}

}  // namespace palpate::session
