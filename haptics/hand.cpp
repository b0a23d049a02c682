#include <haptics/hand.h>

#include <haptics/simulation.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

namespace {

using datasets::TraineeStep;

constexpr double triggerTime = 0.05;  // the fire button stays down [s]

bool moves(const TraineeStep& step) noexcept
{
    return step.kind != TraineeStep::Kind::fire && step.kind != TraineeStep::Kind::wait;
}

}  // namespace

HandDevice::HandDevice(const HandParameters& parameters, std::vector<TraineeStep> script, Vec3 start, Vec3 axis)
    : parameters_(parameters), script_(std::move(script)), from_(start), goal_(start), position_(start), axis_(axis)
{
}

void HandDevice::nextStep() noexcept
{
    ++step_;
    inStep_ = 0.0;
    travelled_ = 0.0;
    peak_ = 0.0;
    from_ = position_;
}

bool HandDevice::feltDrop() const noexcept
{
    return peak_ > parameters_.leastFelt && glm::length(force_) < (1.0 - parameters_.dropFelt) * peak_;
}

// Arrived, or past it: tissue that gives way may let the tip shoot beyond the mark.
bool HandDevice::reached(const TraineeStep& step) const noexcept
{
    const Vec3 way = step.to - from_;
    const double length = glm::length(way);
    return glm::distance(position_, step.to) < step.tolerance ||
           (length > 0.0 && glm::dot(position_ - from_, way) / length >= length);
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
    travelled_ = std::min(travelled_ + step.speed * tickSeconds, length + parameters_.furthestLead);
    goal_ = from_ + travelled_ * direction;
    const bool pierces = step.kind == TraineeStep::Kind::pierce;
    if ((pierces ? feltDrop() : reached(step)) || (step.seconds > 0.0 && inStep_ >= step.seconds)) {
        // The hand stops pushing where the tip is.
        goal_ = position_;
        nextStep();
    }
}

DeviceSample HandDevice::read() noexcept
{
    if (!finished()) {
        advance();
    }
    // Semi-implicit: the hand's damping and grip act on the new velocity, so that a stiff grip cannot ring by itself.
    const double dt = tickSeconds;
    const Vec3 drive = parameters_.mass * velocity_ + dt * (force_ + parameters_.grip * (goal_ - position_));
    velocity_ = drive / (parameters_.mass + dt * parameters_.damping + dt * dt * parameters_.grip);
    position_ += dt * velocity_;

    DeviceSample sample;
    sample.position = glm::round(position_ / parameters_.encoder) * parameters_.encoder;
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
    return {HandParameters{}, datasets::traineeScript(model.scene, way), way.entry - distance * axis, axis};
}

void HandDevice::write(Vec3 force) noexcept
{
    force_ = force;
    peak_ = std::max(peak_, glm::length(force));
}

}  // namespace palpate::haptics
