#include <haptics/palpator.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::haptics {

namespace {

constexpr double reachAcross = 24e-3;  // of the first search, to each side [m]
constexpr double lineReach = 16e-3;    // of the two lines, to each side [m]
constexpr double lineStep = 4e-3;      // [m]
constexpr double hover = 4e-3;         // between places, in front of where it was last touched [m]
constexpr double pressDepth = 12e-3;   // of the hand's goal beyond the skin; tissue keeps the finger from all of it [m]
constexpr double travelSpeed = 60e-3;  // mean [m/s]
constexpr double pressSpeed = 30e-3;   // mean [m/s]
constexpr double holdTime = 0.15;      // before the force is judged [s]
constexpr double markTime = 0.10;      // the button stays down for half of it [s]
constexpr double minFelt = 0.05;       // [N]

Vec3 acrossOf(Vec3 axis)
{
    return glm::normalize(glm::cross(axis, std::abs(axis.z) < 0.7 ? Vec3(0, 0, 1) : Vec3(1, 0, 0)));
}

}  // namespace

Palpator::Palpator(const SessionModel& model, const Skill& skill, std::uint64_t seed, double distance)
    : skill_(skill),
      axis_(glm::normalize(model.approach.aim - model.approach.entry)),
      u_(acrossOf(axis_)),
      v_(glm::cross(axis_, u_)),
      random_(seed ^ 0x70616C70U),
      arm_(deviceParameters(model.scene.device), {}, model.approach.entry - distance * axis_),
      tremor_(skill.tremor, random_)
{
    // The device's place is the middle of the fingertip: it touches a radius before it.
    origin_ = model.approach.entry - model.scene.tool.radius * axis_;
    goal_ = arm_.position();
    const int half = static_cast<int>(std::floor(reachAcross / skill_.raster));
    for (int j = -half; j <= half; ++j) {
        for (int i = -half; i <= half; ++i) {
            // There and back again in turn, so that the hand travels little.
            places_.push_back({(j % 2 == 0 ? i : -i) * skill_.raster, j * skill_.raster});
        }
    }
    places_.reserve(std::max<std::size_t>(places_.size(), 64));
    begin(Act::travel);
}

Vec3 Palpator::at(const Place& place, double depth) const noexcept
{
    return origin_ + place.u * u_ + place.v * v_ + depth * axis_;
}

void Palpator::begin(Act act) noexcept
{
    act_ = act;
    inAct_ = 0.0;
    from_ = goal_;
    const Place& place = places_[place_];
    switch (act) {
        case Act::travel:
        case Act::lift:
            to_ = at(place, -hover);
            break;
        case Act::press:
            touched_ = -1.0;
            to_ = at(place, pressDepth);
            break;
        case Act::hold:
            break;
    }
    const double still = stage_ == Stage::mark ? markTime : holdTime;
    const double speed = act == Act::press ? pressSpeed : travelSpeed;
    duration_ = act == Act::hold ? still : std::max(0.1, glm::distance(from_, to_) / speed);
}

// The middle value of what was felt: a lump lies under fewer places than not.
double Palpator::background() const noexcept
{
    std::array<double, 256> felt{};
    const std::size_t count = std::min(places_.size(), felt.size());
    for (std::size_t i = 0; i < count; ++i) {
        felt[i] = places_[i].stiffness;
    }
    const auto middle = felt.begin() + static_cast<std::ptrdiff_t>(count / 2);
    std::nth_element(felt.begin(), middle, felt.begin() + static_cast<std::ptrdiff_t>(count));
    return *middle;
}

void Palpator::layLine(bool alongU, const Place& through) noexcept
{
    places_.clear();
    const int half = static_cast<int>(lineReach / lineStep);
    for (int i = -half; i <= half; ++i) {
        const double s = i * lineStep;
        places_.push_back({through.u + (alongU ? s : 0.0), through.v + (alongU ? 0.0 : s)});
    }
}

// From the stiffest place of the line outwards, where it falls to the level half way down; between two places by a line.
void Palpator::findEdges(bool alongU) noexcept
{
    const auto stiffer = [](const Place& a, const Place& b) { return a.stiffness < b.stiffness; };
    const auto peak = std::max_element(places_.begin(), places_.end(), stiffer) - places_.begin();
    const double level = 0.5 * (places_[static_cast<std::size_t>(peak)].stiffness + around_);
    for (const int side : {-1, 1}) {
        auto i = peak;
        const auto last = side < 0 ? std::ptrdiff_t{0} : static_cast<std::ptrdiff_t>(places_.size()) - 1;
        while (i != last && places_[static_cast<std::size_t>(i + side)].stiffness > level) {
            i += side;
        }
        const Place& in = places_[static_cast<std::size_t>(i)];
        const Place& out = places_[static_cast<std::size_t>(i == last ? i : i + side)];
        const double fall = in.stiffness - out.stiffness;
        const double fraction = fall > 0.0 ? std::clamp((in.stiffness - level) / fall, 0.0, 1.0) : 0.0;
        edges_[(alongU ? 0U : 2U) + (side > 0 ? 1U : 0U)] = {in.u + fraction * (out.u - in.u),
                                                             in.v + fraction * (out.v - in.v)};
    }
}

void Palpator::nextStage() noexcept
{
    switch (stage_) {
        case Stage::search:
            best_ = *std::max_element(places_.begin(), places_.end(),
                                      [](const Place& a, const Place& b) { return a.stiffness < b.stiffness; });
            around_ = background();
            stage_ = Stage::alongU;
            layLine(true, best_);
            break;
        case Stage::alongU:
            findEdges(true);
            best_.u = 0.5 * (edges_[0].u + edges_[1].u);
            stage_ = Stage::alongV;
            layLine(false, best_);
            break;
        case Stage::alongV:
            findEdges(false);
            best_.v = 0.5 * (edges_[2].v + edges_[3].v);
            edges_[0].v = edges_[1].v = best_.v;
            stage_ = Stage::mark;
            places_.assign(edges_.begin(), edges_.end());
            break;
        default:
            stage_ = Stage::done;
            return;
    }
    place_ = 0;
    begin(Act::travel);
}

void Palpator::nextPlace() noexcept
{
    if (++place_ < places_.size()) {
        begin(Act::travel);
    } else {
        nextStage();
    }
}

void Palpator::step() noexcept
{
    if (inAct_ < duration_) {
        return;
    }
    switch (act_) {
        case Act::travel:
            begin(stage_ == Stage::mark ? Act::hold : Act::press);
            return;
        case Act::press:
            begin(Act::hold);
            return;
        case Act::hold:
            if (stage_ == Stage::mark) {
                nextPlace();
                return;
            }
            if (const double depth = glm::dot(arm_.position() - origin_, axis_) - touched_;
                touched_ >= 0.0 && depth > 0.0) {
                places_[place_].stiffness = force_ / depth * (1.0 + skill_.touch * normalOf(random_));
            }
            begin(Act::lift);
            return;
        case Act::lift:
            nextPlace();
            return;
    }
}

DeviceSample Palpator::read() noexcept
{
    inAct_ += tickSeconds;
    if (stage_ != Stage::done) {
        step();
        goal_ = from_ + minimumJerk(inAct_ / duration_) * (to_ - from_);
    }
    arm_.pull(goal_ + tremor_.at(static_cast<double>(ticks_++) * tickSeconds));
    DeviceSample sample;
    sample.position = arm_.read();
    sample.axis = axis_;
    sample.buttons = buttonDeadMan;
    if (stage_ == Stage::mark && act_ == Act::hold && inAct_ < 0.5 * markTime) {
        sample.buttons |= buttonMark;
    }
    return sample;
}

void Palpator::write(Vec3 force) noexcept
{
    arm_.write(force);
    force_ = -glm::dot(force, axis_);
    if (touched_ < 0.0 && force_ > minFelt) {
        touched_ = std::max(0.0, glm::dot(arm_.position() - origin_, axis_));
    }
}

}  // namespace palpate::haptics
