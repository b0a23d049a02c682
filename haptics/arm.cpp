#include <haptics/arm.h>

#include <base/error.h>
#include <base/mapped.h>
#include <haptics/bounded.h>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::haptics {

namespace {

constexpr double longestStep = 50e-6;  // of the integration [s]
constexpr double noTime = 1e-12;       // what rounding leaves between two moments [s]

// Amplifiers are current loops of about 1 kHz; force steps are those of 12 bits over both signs of the peak. Neither is
// published for these devices, nor is the viscous friction of the lower two.
constexpr std::array devices{
    DeviceParameters{"premium", 0.072, 0.005, 0.038, 0.03e-3, 8.5 / 2048, 8.5, 1000, 0,
                     "PHANToM Premium 1.0: peak and encoder as its maker states, mass and friction as in papers on "
                     "stability; force step, bandwidth and delay assumed"},
    DeviceParameters{"touch", 0.045, 0.005, 0.26, 0.055e-3, 3.3 / 2048, 3.3, 1000, 0,
                     "Touch (Omni): peak, mass, friction and encoder as its maker states; viscous friction as of the "
                     "Premium, force step, bandwidth and delay assumed"},
    DeviceParameters{"falcon", 0.125, 0.005, 0.2, 0.06e-3, 8.9 / 4096, 8.9, 1000, 1e-3,
                     "Novint Falcon: peak, mass (0.10 to 0.15 kg), friction and encoder as measured by users, force step "
                     "of its motor command; viscous friction, bandwidth and a USB frame of delay assumed"}};

double rounded(double value, double step) noexcept
{
    return step > 0.0 ? std::round(value / step) * step : value;
}

Vec3 rounded(Vec3 v, double step) noexcept
{
    return {rounded(v.x, step), rounded(v.y, step), rounded(v.z, step)};
}

}  // namespace

const DeviceParameters& deviceParameters(std::string_view name)
{
    static const DeviceParameters ideal;
    if (name == ideal.name) {
        return ideal;
    }
    const auto* found = std::ranges::find(devices, name, &DeviceParameters::name);
    base::failIf(found == devices.end(), "no device '{}' is known: take one of {}, {}", name,
                 fmt::join(deviceNames(), ", "), ideal.name);
    return *found;
}

std::vector<std::string> deviceNames()
{
    return base::mapped<std::string>(devices, &DeviceParameters::name);
}

Arm::Arm(const DeviceParameters& device, const Grip& grip, Vec3 start, double period)
    : device_(device), grip_(grip), period_(period), goal_(start), position_(start)
{
    base::failIf(!(device.delay >= 0.0), "device '{}': a delay of {:f} s: must be 0 or more", device.name, device.delay);
    base::failIf(!(device.delay / period < static_cast<double>(longestLine - 2)),
                 "device '{}': a delay of {:f} s is over {} samples: shorten it or sample more slowly", device.name,
                 device.delay, longestLine - 2);
}

void Arm::release(Vec3 position, Vec3 velocity) noexcept
{
    position_ = position;
    velocity_ = velocity;
}

Vec3 Arm::read() noexcept
{
    ++samples_;
    live(static_cast<double>(samples_) * period_ - time_);
    return rounded(position_, device_.encoder);
}

void Arm::write(Vec3 force) noexcept
{
    const double size = glm::length(force);
    const Vec3 output = std::isfinite(size) ? rounded(bounded(force, device_.peakForce), device_.forceStep) : Vec3(0.0);
    if (device_.delay <= 0.0) {
        command_ = output;
        return;
    }
    if (waiting_ < longestLine) {
        line_[(first_ + waiting_) % longestLine] = {time_ + device_.delay, output};
        ++waiting_;
    }
}

// From one moment at which the command changes to the next.
void Arm::live(double seconds) noexcept
{
    const double end = time_ + seconds;
    for (;;) {
        while (waiting_ > 0 && line_[first_].due <= time_ + noTime) {
            command_ = line_[first_].force;
            first_ = (first_ + 1) % longestLine;
            --waiting_;
        }
        const double next = waiting_ > 0 ? std::min(line_[first_].due, end) : end;
        const double span = next - time_;
        if (span <= noTime) {
            time_ = std::max(time_, end);
            return;
        }
        const int steps = static_cast<int>(std::ceil(span / longestStep - 1e-6));
        for (int i = 0; i < steps; ++i) {
            step(span / steps);
        }
        time_ = next;
    }
}

void Arm::step(double h) noexcept
{
    Vec3 mean = command_;
    if (device_.bandwidth > 0.0) {
        const double a = 2.0 * std::numbers::pi * device_.bandwidth * h;
        const double left = std::exp(-a);
        mean += (force_ - command_) * ((1.0 - left) / a);
        force_ = command_ + left * (force_ - command_);
    } else {
        force_ = command_;
    }
    const double m = device_.mass + grip_.mass;
    const double b = device_.viscous + grip_.damping;
    const double k = grip_.stiffness;
    // The velocity w in the middle of the step: 2 m (w - v) / h = f + k (goal - x - w h / 2) - b w - c Sgn(w).
    const Vec3 drive = 2.0 * m / h * velocity_ + mean + k * (goal_ - position_);
    const double size = glm::length(drive);
    if (size <= device_.coulomb) {
        velocity_ = Vec3(0.0);
        return;
    }
    const Vec3 middle = (1.0 - device_.coulomb / size) / (2.0 * m / h + b + 0.5 * h * k) * drive;
    velocity_ = 2.0 * middle - velocity_;
    position_ += h * middle;
    const double speed = glm::length(middle);
    work_ += h * glm::dot(mean, middle);
    loss_ += h * (device_.viscous * speed + device_.coulomb) * speed;
}

}  // namespace palpate::haptics
