#include <haptics/mouse.h>

#include <channel/deformation.h>
#include <datasets/phantom_random.h>
#include <haptics/bounded.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace palpate::haptics {

namespace {

using channel::vec;

// What another program wrote may be anything.
bool isSound(const channel::Input& input) noexcept
{
    return glm::length(vec(input.target)) < 10.0 && std::abs(glm::length(vec(input.axis)) - 1.0) < 1e-3 &&
           std::ranges::all_of(input.probe, [](double v) { return std::abs(v) <= 1.0; });
}

}  // namespace

MouseDevice::MouseDevice(const DeviceParameters& device, Source source, Vec3 start, Vec3 axis)
    : source_(std::move(source)), arm_(device, grip, start), goal_(start), axis_(axis)
{
}

void MouseDevice::listen() noexcept
{
    silence_ += tickSeconds;
    const auto now = source_();
    if (!now || !isSound(*now) || (heard_ && now->beat == input_.beat)) {
        return;
    }
    const bool press = now->held != 0 && (input_.held == 0 || silence_ > longestSilence);
    if (press) {
        offset_ = arm_.position() - vec(now->target);
    }
    if (!heard_) {
        // What a viewer before this session has counted is none of ours.
        fire_.done = now->fires;
        mark_.done = now->marks;
        unmark_.done = now->unmarks;
        picture_.done = now->pictures;
    }
    input_ = *now;
    heard_ = true;
    silence_ = 0.0;
    ended_ = ended_ || input_.ended != 0;
}

void MouseDevice::follow() noexcept
{
    if (input_.held == 0 || silence_ > longestSilence) {
        goal_ = arm_.position();
        return;
    }
    const Vec3 way = vec(input_.target) + offset_ - goal_;
    goal_ += bounded(way * std::min(1.0, tickSeconds / lag), fastest * tickSeconds);
}

void MouseDevice::turn() noexcept
{
    const Vec3 way = vec(input_.axis) - axis_;
    const Vec3 next = axis_ + bounded(way * std::min(1.0, tickSeconds / lag), fastestTurn * tickSeconds);
    if (const double length = glm::length(next); length > 0.5) {
        axis_ = next / length;
    }
}

DeviceSample MouseDevice::read() noexcept
{
    listen();
    follow();
    if (heard_) {
        turn();
    }
    arm_.pull(goal_);
    DeviceSample sample;
    sample.position = arm_.read();
    sample.axis = axis_;
    sample.probe = probe_.follow(input_.probe);  // needs no dead-man switch: it gives nobody a force
    sample.fresh = silence_ <= longestSilence || !heard_;
    sample.buttons = input_.held != 0 ? buttonDeadMan : 0U;
    sample.buttons |= fire_.down(input_.fires) ? buttonFire : 0U;
    sample.buttons |= mark_.down(input_.marks) ? buttonMark : 0U;
    sample.buttons |= unmark_.down(input_.unmarks) ? buttonUnmark : 0U;
    sample.buttons |= picture_.down(input_.pictures) ? buttonPicture : 0U;
    return sample;
}

Start startOffPlan(const SessionModel& model, double distance, std::uint64_t seed) noexcept
{
    constexpr double degree = std::numbers::pi / 180.0;
    constexpr double clear = 15e-3;  // from the target to the needle's line, if a place has it [m]
    constexpr int tries = 32, rises = 16;
    const auto& [entry, aim, planned] = model.approach;
    const Vec3 out = model.surface.normal(entry);
    const Vec3 right = glm::normalize(glm::cross(out, std::abs(out.x) < 0.7 ? Vec3(1, 0, 0) : Vec3(0, 1, 0)));
    const Vec3 up = glm::cross(out, right);
    const auto towards = [&](double angle) { return std::cos(angle) * right + std::sin(angle) * up; };
    datasets::Random random(seed ^ 0x5374617274U);
    Start best;
    double farthest = -1.0;
    for (int i = 0; i < tries && farthest < clear; ++i) {
        const double side = random.between(0.0, 2.0 * std::numbers::pi), aside = random.between(15e-3, 25e-3);
        const double tilt = random.between(10.0, 20.0) * degree, lean = side + random.between(-90.0, 90.0) * degree;
        Start s{entry + aside * towards(side) + distance * out, -out};
        for (int k = 0; k < rises; ++k) {
            s.tip += std::max(0.0, distance - model.surface.distance(s.tip)) * out;
        }
        if (model.scene.tool.kind == datasets::ToolKind::needle) {
            s.axis = glm::normalize(-std::cos(tilt) * out + std::sin(tilt) * towards(lean));
        }
        const Vec3 way = aim - s.tip;
        const double off = glm::length(way - glm::dot(way, s.axis) * s.axis);
        best = off > farthest ? s : best;
        farthest = std::max(farthest, off);
    }
    return best;
}

MouseDevice mouseOffPlan(const SessionModel& model, MouseDevice::Source source, double distance, std::uint64_t seed)
{
    const Start start = startOffPlan(model, distance, seed);
    return {deviceParameters(model.scene.device), std::move(source), start.tip, start.axis};
}

MouseDevice mouseBefore(const SessionModel& model, MouseDevice::Source source, double distance)
{
    const auto& way = model.approach;
    const Vec3 axis = glm::normalize(way.aim - way.entry);
    return {deviceParameters(model.scene.device), std::move(source), way.entry - distance * axis, axis};
}

}  // namespace palpate::haptics
