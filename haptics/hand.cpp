#include <haptics/hand.h>

#include <haptics/motor.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::haptics {

namespace {

using datasets::TraineeStep;

constexpr double triggerTime = 0.05;  // the fire button stays down [s]
constexpr double dropFelt = 0.4;      // fraction of the force that must go for the hand to feel that tissue gave way
constexpr double minNoticed = 0.3;    // forces below are not noticed [N]

bool moves(const TraineeStep& step) noexcept
{
    return step.kind != TraineeStep::Kind::fire && step.kind != TraineeStep::Kind::wait;
}

}  // namespace

HandDevice::HandDevice(const HandParameters& parameters, std::vector<TraineeStep> script, Vec3 start, Vec3 axis)
    : script_(std::move(script)), from_(start), goal_(start), arm_(parameters.device, parameters.grip, start), axis_(axis)
{
}

void HandDevice::nextStep() noexcept
{
    ++step_;
    inStep_ = 0.0;
    travelled_ = 0.0;
    peak_ = 0.0;
    from_ = arm_.position();
}

bool HandDevice::feltDrop() const noexcept
{
    return peak_ > minNoticed && glm::length(force_) < (1.0 - dropFelt) * peak_;
}

// Arrived, or past it: tissue that gives way may let the tip shoot beyond the mark. Inside the body also as soon as the
// hand, braking, would arrive, and when the needle is in as far as it is to be, wherever the tissue has gone with it.
bool HandDevice::reached(const TraineeStep& step) const noexcept
{
    const Vec3 way = step.to - from_;
    const double length = glm::length(way);
    const bool onward = inside_ && glm::dot(way, axis_) > 0.0;
    const Vec3 soon = arm_.position() + (onward ? braking : 0.0) * arm_.velocity();
    return glm::distance(arm_.position(), step.to) < step.tolerance ||
           (length > 0.0 && glm::dot(soon - from_, way) / length >= length) ||
           (onward && step.depth > 0.0 && inserted_ >= step.depth);
}

void HandDevice::advance() noexcept
{
    const TraineeStep& step = script_[step_];
    inStep_ += tickSeconds;
    if (!moves(step)) {
        const double seconds = step.kind == TraineeStep::Kind::fire ? 2.0 * triggerTime : step.seconds;
        if (inStep_ >= seconds) {
            nextStep();
        }
        return;
    }
    const Vec3 way = step.to - from_;
    const double length = glm::length(way);
    const Vec3 direction = length > 0.0 ? way / length : Vec3(0.0);
    travelled_ = std::min(travelled_ + step.speed * tickSeconds, length + furthestLead);
    goal_ = from_ + travelled_ * direction;
    const bool pierces = step.kind == TraineeStep::Kind::pierce;
    if ((pierces ? gaveWay() : reached(step)) || (step.seconds > 0.0 && inStep_ >= step.seconds)) {
        // The hand stops pushing where the tip is.
        goal_ = arm_.position();
        nextStep();
    }
}

DeviceSample HandDevice::read() noexcept
{
    if (!finished()) {
        advance();
    }
    arm_.pull(goal_);
    DeviceSample sample;
    sample.position = arm_.read();
    sample.axis = axis_;
    sample.buttons = buttonDeadMan;
    if (!finished() && script_[step_].kind == TraineeStep::Kind::fire && inStep_ < triggerTime) {
        sample.buttons |= buttonFire;
    }
    return sample;
}

HandDevice handBefore(const SessionModel& model, double distance)
{
    const auto& way = model.approach;
    const Vec3 axis = glm::normalize(way.aim - way.entry);
    HandParameters parameters;
    parameters.device = deviceParameters(model.scene.device);
    return {parameters, datasets::traineeScript(model.scene, way), way.entry - distance * axis, axis};
}

void HandDevice::observe(const TickRecord& record) noexcept
{
    sees_ = true;
    inside_ = record.phase == Phase::inserted;
    inserted_ = record.inserted;
}

void HandDevice::write(Vec3 force) noexcept
{
    force_ = force;
    arm_.write(force);
    peak_ = std::max(peak_, glm::length(force));
}

}  // namespace palpate::haptics
