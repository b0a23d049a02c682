#include <haptics/falcon/device.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <cmath>
#include <utility>

namespace palpate::falcon {

using namespace haptics;

Mat3 facing(Vec3 axis) noexcept
{
    const Vec3 head(0, 0, 1), front(0, -1, 0);
    const Vec3 near = std::abs(glm::dot(axis, head)) < 0.9 ? head : front;
    const Vec3 up = glm::normalize(near - glm::dot(near, axis) * axis);
    return {glm::cross(up, -axis), up, -axis};
}

FalconDevice::FalconDevice(std::shared_ptr<Driver> driver, Vec3 start, Vec3 axis)
    : driver_(std::move(driver)), start_(start), axis_(axis), turn_(facing(axis))
{
}

DeviceSample FalconDevice::read() noexcept
{
    driver_->read(pose_);
    if (!started_ && pose_.time > 0.0) {
        origin_ = pose_.position;
        started_ = true;
    }
    DeviceSample sample;
    sample.position = start_ + turn_ * (pose_.position - origin_);
    sample.axis = axis_;
    sample.fresh = driver_->now() - pose_.time <= fresh;
    const auto down = [this](std::uint8_t button) { return (pose_.buttons & button) != 0U; };
    sample.buttons = down(buttonCentre) ? buttonDeadMan : 0U;
    // A packet has no checksum, and contacts bounce: neither may fire the gun.
    sample.buttons |= fire_.take(down(buttonForward)) ? buttonFire : 0U;
    sample.buttons |= mark_.take(down(buttonRight)) ? buttonMark : 0U;
    leftHeld_ = down(buttonLeft) ? leftHeld_ + tickSeconds : 0.0;
    ending_ = ending_ || leftHeld_ >= endHeld;
    return sample;
}

void FalconDevice::write(Vec3 force) noexcept
{
    driver_->write(glm::transpose(turn_) * force, (pose_.buttons & buttonCentre) != 0U);
}

std::unique_ptr<FalconDevice> falconBefore(const SessionModel& model, std::shared_ptr<Driver> driver, double distance)
{
    const auto& way = model.approach;
    const Vec3 axis = glm::normalize(way.aim - way.entry);
    return std::make_unique<FalconDevice>(std::move(driver), way.entry - distance * axis, axis);
}

}  // namespace palpate::falcon
