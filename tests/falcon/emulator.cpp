#include <tests/falcon/emulator.h>

#include <haptics/bounded.h>
#include <tests/falcon/inverse.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace palpate::falcon {

namespace {

constexpr double armStep = 0.25e-3;     // of the arm [s]
constexpr double thinking = 40e-6;      // of the processor, between a packet and its answer [s]
constexpr double emulatedBoot = 50e-3;  // [s]
constexpr double bits = 10.0;           // of a byte on the serial line
constexpr std::size_t roomIn = 384;     // of the bridge: what nobody fetches is lost beyond it [bytes]
constexpr Vec3 out(0.0, 0.0, 0.1755), restingPlace(0.0, 0.0, 0.15);  // where an obedient hand homes, and then waits [m]
constexpr std::uint8_t modemStatus = 0x01, lineStatus = 0x60;
// A hand that holds a grip: stiff, and damped by its own flesh.
constexpr haptics::Grip firm{0.1, 8.0, 400.0};

haptics::DeviceParameters mechanics()
{
    haptics::DeviceParameters p = haptics::deviceParameters("falcon");
    // Counts and commands quantise, and the wire delays: the arm itself does neither.
    p.encoder = 0.0;
    p.forceStep = 0.0;
    p.delay = 0.0;
    p.peakForce = 40.0;
    return p;
}

}  // namespace

Emulator::Emulator(std::vector<std::uint8_t> firmware, std::uint64_t seed)
    : firmware_(std::move(firmware)),
      random_(seed),
      parameters_(mechanics()),
      arm_(parameters_, firm, Vec3(0.0, 0.0, 0.13), armStep),
      goal_(0.0, 0.0, 0.13)
{
    // At rest in the hand, under its own weight.
    arm_.release(goal_ - Vec3(0.0, weight_ / firm.stiffness, 0.0));
    powerCycle();
}

void Emulator::powerCycle()
{
    state_ = State::waiting;
    command_ = {};
    homed_ = 0;
    heard_.clear();
    arriving_.clear();
    leaving_.clear();
    dtrRose_ = false;
    const auto angles = anglesAt(arm_.position());
    offset_ = angles ? countsAt(*angles) : Triple{};
}

void Emulator::makeReady()
{
    state_ = State::running;
    homed_ = allHomed;
    offset_ = {};
}

bool Emulator::chance(double fraction)
{
    return fraction > 0.0 && static_cast<double>(random_() >> 11U) * 0x1.0p-53 < fraction;
}

double Emulator::byteTime() const noexcept
{
    const double rate = baud_ == bridge::baud9600 ? 9600.0 : 3e6 / std::max<double>(1.0, baud_);
    return bits / rate;
}

bool Emulator::control(std::uint8_t request, std::uint16_t value)
{
    switch (static_cast<Request>(request)) {
        case Request::reset:
            if (value == bridge::purgeIn) {
                leaving_.clear();
            } else if (value == bridge::purgeOut) {
                arriving_.clear();
            }
            return true;
        case Request::modemControl:
            if ((value & 0x0100U) != 0U) {
                const bool high = (value & 0x01U) != 0U;
                if (high && !dtr_) {
                    // Reset: back to the loader, and the zeros are gone.
                    powerCycle();
                    dtrRose_ = true;
                }
                dtr_ = high;
            }
            if ((value & 0x0200U) != 0U) {
                rts_ = (value & 0x02U) != 0U;
            }
            return true;
        case Request::baud:
            baud_ = value;
            return true;
        case Request::latency:
            latency_ = 1e-3 * value;
            return true;
        case Request::flowControl:
        case Request::format:
            return true;
    }
    return false;
}

void Emulator::put(std::span<const std::uint8_t> bytes)
{
    double due = arriving_.empty() ? time_ : std::max(time_, arriving_.back().ready);
    for (const std::uint8_t byte : bytes) {
        due += byteTime();
        arriving_.push_back({due, byte});
    }
}

void Emulator::reply(std::uint8_t byte, double delay)
{
    if (mishaps.mute || chance(mishaps.dropped)) {
        return;
    }
    const double from = std::max(time_ + delay, leaving_.empty() ? 0.0 : leaving_.back().ready);
    const auto noise = static_cast<std::uint8_t>(chance(mishaps.garbled) ? 1U << (random_() % 8U) : 0U);
    if (leaving_.size() < roomIn) {
        leaving_.push_back({from + byteTime(), static_cast<std::uint8_t>(byte ^ noise)});
    }
}

std::vector<std::uint8_t> Emulator::take(std::size_t most)
{
    most = std::min(most, usbPacket);
    const auto notReady = std::ranges::find_if(leaving_, [this](const Byte& b) { return b.ready > time_; });
    const auto ready = static_cast<std::size_t>(notReady - leaving_.begin());
    if (most < bridge::statusBytes || (ready + bridge::statusBytes < most && time_ < flushed_ + latency_)) {
        return {};
    }
    flushed_ = time_;
    std::vector<std::uint8_t> packet{modemStatus, lineStatus};
    while (packet.size() < most && !leaving_.empty() && leaving_.front().ready <= time_) {
        packet.push_back(leaving_.front().value);
        leaving_.pop_front();
    }
    return packet;
}

void Emulator::advance(double seconds)
{
    const double end = time_ + seconds;
    while (time_ < end) {
        const double next = arriving_.empty() ? end : std::min(end, std::max(time_, arriving_.front().ready));
        time_ = std::min(next, lived_ + armStep);
        if (time_ >= lived_ + armStep) {
            live(armStep);
            lived_ += armStep;
        }
        while (!arriving_.empty() && arriving_.front().ready <= time_) {
            const std::uint8_t byte = arriving_.front().value;
            arriving_.pop_front();
            hear(byte);
        }
        if (state_ == State::booting && time_ >= booted_ && !mishaps.neverRuns) {
            state_ = State::running;
            stream_.clear();
        }
    }
}

void Emulator::hear(std::uint8_t byte)
{
    if (state_ != State::running) {
        hearLoader(byte);
        return;
    }
    if (baud_ == bridge::baud1500k && !mishaps.stalled && stream_.take(byte)) {
        if (const auto command = decodeCommand(stream_.packet())) {
            answer(*command);
        }
    }
}

void Emulator::hearLoader(std::uint8_t byte)
{
    constexpr std::array<std::uint8_t, 3> greeting{0x0A, 0x43, 0x0D};
    if (state_ == State::waiting && baud_ == bridge::baud9600 && dtrRose_ && dtr_ && !rts_) {
        heard_.push_back(byte);
        if (heard_.size() > greeting.size()) {
            heard_.pop_front();
        }
        if (std::ranges::equal(heard_, greeting)) {
            if (mishaps.leadingZero) {
                reply(0, thinking);
            }
            for (const int b : {0x0A, mishaps.wrongGreeting ? 0x54 : 0x44, 0x2C, 0x0D}) {
                reply(static_cast<std::uint8_t>(b), thinking);
            }
            heard_.clear();
            state_ = mishaps.wrongGreeting ? State::waiting : State::greeted;
        }
    } else if (state_ == State::greeted && baud_ == bridge::baud140k && !dtr_ && byte == 0x41) {
        reply(byte, thinking);
        image_.clear();
        state_ = State::loading;
    } else if (state_ == State::loading && baud_ == bridge::baud140k) {
        const bool wrong = mishaps.wrongEcho == static_cast<long>(image_.size());
        image_.push_back(byte);
        reply(static_cast<std::uint8_t>(wrong ? byte ^ 0x10 : byte), thinking);
        if (image_ == firmware_) {
            state_ = State::booting;
            booted_ = time_ + emulatedBoot;
        }
    }
}

void Emulator::answer(const Command& command)
{
    command_ = command;
    // Only out there has every encoder passed its mark.
    if (command.home && !mishaps.homeless && arm_.position().z > homedDepth) {
        homed_ = allHomed;
        offset_ = {};
    }
    if (!mishaps.frozen) {
        if (const auto angles = anglesAt(arm_.position())) {
            const Triple there = countsAt(*angles);
            for (std::size_t i = 0; i < 3; ++i) {
                count_[i] = static_cast<std::int16_t>(there[i] - offset_[i]);
            }
        }
    }
    for (const std::uint8_t byte : encode(Reading{count_, hand.buttons, mishaps.homeless ? std::uint8_t{0} : homed_})) {
        reply(byte, thinking + mishaps.latency);
    }
    ++packets_;
}

void Emulator::moveHand(double seconds)
{
    Vec3 wish = hand.goal;
    if (hand.obeys && running() && homed_ != allHomed) {
        wish = command_.home ? out : restingPlace;
    }
    goal_ += haptics::bounded(wish - goal_, hand.speed * seconds);
    const double phase = 2.0 * std::numbers::pi * 9.0 * lived_;
    // Every leg sees it.
    const Vec3 shake = hand.tremor * Vec3(std::sin(phase), std::sin(1.13 * phase + 1.0), std::sin(0.87 * phase + 2.0));
    arm_.pull(goal_ + shake);
}

void Emulator::live(double seconds)
{
    moveHand(seconds);
    const auto angles = anglesAt(arm_.position());
    const auto posture = angles ? postureAt(*angles, arm_.position()) : std::nullopt;
    motorForce_ = posture && posture->margin > 1e-3 ? forceOf(*posture, torquesOf(command_.motor)) : Vec3(0.0);
    arm_.write(motorForce_ - Vec3(0.0, weight_, 0.0));
    const Vec3 before = arm_.position();
    arm_.read();
    // Its stops: where the legs are stretched, or under the base.
    const Vec3 p = arm_.position();
    if (!anglesAt(p) || p.z < 0.07 || p.z > 0.176 || std::hypot(p.x, p.y) > 0.06) {
        arm_.release(before);
    }
}

}  // namespace palpate::falcon
