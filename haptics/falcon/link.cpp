#include <haptics/falcon/link.h>

#include <haptics/falcon/trouble_if.h>

#include <fmt/format.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <utility>

namespace palpate::falcon {

namespace {

constexpr double probeTime = 0.2;         // for a loaded Falcon to answer [s]
constexpr double bootTime = 2.0;          // for the firmware to begin [s]
constexpr double betweenAttempts = 0.5;   // [s]
constexpr double restTime = 30e-3;        // [s]
constexpr int minMoved = 8;               // counts by which an encoder has moved for sure
constexpr double countsPerSecond = 60e3;  // faster than any hand: 38 rad/s, over 2 m/s of the grip
constexpr double countsAtOnce = 30;
constexpr int believed = 3;        // readings that follow each other
constexpr double stillTime = 2.0;  // under a force that no hand holds so still [s]
constexpr double feltForce = 0.5;  // [N]

constexpr Command waiting{{}, lampRed, false};

void heed(const std::atomic<bool>& stop)
{
    troubleIf(stop, Cause::interrupted, "interrupted while the Falcon was made ready");
}

bool follows(const Triple& before, const Triple& after, double seconds) noexcept
{
    const double most = countsAtOnce + countsPerSecond * std::clamp(seconds, 0.0, 0.1);
    return std::ranges::equal(before, after, [&](double a, double b) { return std::abs(b - a) <= most; });
}

// From 1 at `from` to 0 at `to`.
double falling(double x, double from, double to) noexcept
{
    return std::clamp((to - x) / (to - from), 0.0, 1.0);
}

// Where closing everything and beginning again may help.
bool mayPass(Cause cause) noexcept
{
    return cause == Cause::silent || cause == Cause::garbled || cause == Cause::firmware || cause == Cause::frozen;
}

}  // namespace

Link::Link(Transport& wire, LinkOptions options, Say say) : wire_(wire), options_(std::move(options)), say_(std::move(say))
{
}

void Link::connect(const std::atomic<bool>& stop)
{
    bool reload = false;
    for (int n = 1;; ++n) {
        try {
            attempt(reload, stop);
            return;
        } catch (const Trouble& trouble) {
            close();
            if (!mayPass(trouble.cause())) {
                throw;
            }
            troubleIf(n == attempts, trouble.cause(), "{} (tried {} times)", trouble.what(), attempts);
            say_(fmt::format("{}: trying again ({} of {})", trouble.what(), n + 1, attempts));
            // Firmware that was loaded badly answers, but its encoders stand still.
            reload = trouble.cause() == Cause::frozen && options_.firmware.has_value();
            wire_.sleep(betweenAttempts);
        }
        heed(stop);
    }
}

void Link::attempt(bool reload, const std::atomic<bool>& stop)
{
    wire_.open();
    stream_.clear();
    command_ = waiting;
    posture_.reset();
    frozen_ = false;
    stillSince_ = wire_.now();
    start(reload, stop);
    if (options_.home) {
        homeGrip(stop);
        seeEncodersMove(stop);
    }
    forcesOff_ = wire_.now();
}

// Whether the firmware runs.
bool Link::answers() noexcept
{
    candidates_ = 0;
    heard_ = 0.0;
    const double end = wire_.now() + probeTime;
    while (wire_.now() < end && !wire_.gone()) {
        if (send(waiting) && listen(answerTime)) {
            return true;
        }
    }
    return false;
}

void Link::start(bool reload, const std::atomic<bool>& stop)
{
    enterRunMode(wire_);
    loadedNow_ = false;
    if (reload || !answers()) {
        troubleIf(!options_.firmware, Cause::firmwareFile,
                  "the Falcon has no firmware running (it loses it with its power supply): give the file with "
                  "--falcon-firmware FILE");
        say_("loading the Falcon's firmware");
        loadFirmware(wire_, *options_.firmware, stop);
        enterRunMode(wire_);
        loadedNow_ = true;
        const double end = wire_.now() + bootTime;
        while (!answers()) {
            heed(stop);
            troubleIf(wire_.now() > end, Cause::firmware,
                      "{}: the Falcon took every byte but does not run it: give its own firmware", options_.firmware->file);
        }
    }
    least_ = most_ = reading_.count;
}

void Link::homeGrip(const std::atomic<bool>& stop)
{
    if (reading_.homed == allHomed) {
        return;
    }
    say_("pull the Falcon's grip all the way out towards you, and push it back in");
    const Command homing{{}, lampRed, true};
    const double end = wire_.now() + homingTime;
    for (int seen = 0; seen < believed;) {
        heed(stop);
        if (send(homing) && listen(answerTime)) {
            seen = reading_.homed == allHomed ? seen + 1 : 0;
        }
        troubleIf(wire_.gone() || wire_.now() - heard_ > silence, wire_.gone() ? Cause::unplugged : Cause::silent,
                  "the Falcon stopped answering while it was homed: check its cable and power supply");
        const bool over = wire_.now() > end;
        troubleIf(over && least_ == most_, Cause::frozen,
                  "the Falcon answers but its encoders stand still: switch its power supply off and on, so that its "
                  "firmware is loaded anew");
        troubleIf(over, Cause::homing,
                  "the Falcon was not homed within {:.0f} s: start again and pull its grip all the way out towards you",
                  homingTime);
    }
}

void Link::seeEncodersMove(const std::atomic<bool>& stop)
{
    const auto moved = [this](std::size_t i) { return most_[i] - least_[i] >= minMoved; };
    const auto allMoved = [&] { return moved(0) && moved(1) && moved(2); };
    if (!allMoved()) {
        say_("move the Falcon's grip a little to every side");
    }
    const double end = wire_.now() + moveTime;
    while (!allMoved()) {
        heed(stop);
        if (send(waiting)) {
            listen(answerTime);
        }
        troubleIf(wire_.gone(), Cause::unplugged,
                  "the Falcon was unplugged while it was made ready: plug it in and start again");
        troubleIf(
            wire_.now() > end, Cause::frozen,
            "of the Falcon's encoders {} of 3 moved in {:.0f} s: when its grip was moved, switch its power supply off "
            "and on, so that its firmware is loaded anew",
            moved(0) + moved(1) + moved(2), moveTime);
    }
}

bool Link::send(const Command& command) noexcept
{
    const Packet packet = encode(command);
    if (!wire_.send(packet)) {
        return false;
    }
    command_ = command;
    sent_ = wire_.now();
    return true;
}

// Takes in what comes until a reading is accepted, and whatever has come by then.
bool Link::listen(double seconds) noexcept
{
    std::array<std::uint8_t, usbPacket> bytes{};
    const double end = wire_.now() + seconds;
    bool accepted = false;
    for (double left = seconds; left > 0.0 || accepted; left = end - wire_.now()) {
        const std::size_t n = wire_.receive(bytes, accepted ? 0.0 : left);
        for (std::size_t i = 0; i < n; ++i) {
            if (stream_.take(bytes[i])) {
                const auto reading = decodeReading(stream_.packet());
                accepted = (reading && accept(*reading)) || accepted;
            }
        }
        if (n == 0 && (accepted || wire_.gone())) {
            break;
        }
    }
    counts_.lostBytes = stream_.lost();
    return accepted;
}

bool Link::accept(const Reading& reading) noexcept
{
    const double now = wire_.now();
    // Before the homing is done counts may begin anew at any time.
    const bool tied = heard_ > 0.0 && wasHomed_;
    if (tied && !follows(reading_.count, reading.count, now - heard_)) {
        ++counts_.implausible;
        const bool again = candidates_ > 0 && follows(candidate_.count, reading.count, 0.0);
        candidates_ = again ? candidates_ + 1 : 1;
        candidate_ = reading;
        if (candidates_ < believed) {
            return false;
        }
        forcesOff_ = now;
    }
    candidates_ = 0;
    candidate_ = reading;
    const bool begins = heard_ == 0.0 || (!wasHomed_ && reading.homed == allHomed);
    if (begins && reading.homed != allHomed) {
        least_ = most_ = reading.count;
    }
    reading_ = reading;
    heard_ = now;
    if (!begins) {
        noteMotion();
    }
    if (reading.homed == allHomed) {
        posture_ = postureAt(anglesOf(reading.count), posture_ ? posture_->position : Vec3(0.0));
        if (posture_) {
            pose_ = {posture_->position, reading.buttons, now, posture_->margin};
        }
        wasHomed_ = true;
    } else {
        posture_.reset();
    }
    return true;
}

void Link::noteMotion() noexcept
{
    for (std::size_t i = 0; i < 3; ++i) {
        least_[i] = std::min(least_[i], reading_.count[i]);
        most_[i] = std::max(most_[i], reading_.count[i]);
    }
    if (reading_.count != still_.count) {
        still_ = reading_;
        stillSince_ = heard_;
        frozen_ = false;
    }
}

Triple Link::motorFor(const ForceOrder& order, double now) noexcept
{
    const double size = glm::length(order.force);
    const double age = now - order.time;
    const double silent = now - heard_;
    const bool sound = posture_ && std::isfinite(size) && silent < faded && age < faded;
    if (size < feltForce) {
        stillSince_ = now;
    }
    frozen_ = frozen_ || now - stillSince_ > stillTime;
    if (!sound || frozen_) {
        forcesOff_ = now;
        return {};
    }
    const double fraction = falling(std::max(age, silent), fresh, faded) * falling(posture_->margin, wellPosed, singular) *
                            std::clamp((now - forcesOff_) / ramp, 0.0, 1.0);
    const Torques torques = torquesFor(*posture_, fraction * (order.force + Vec3(0.0, options_.weight, 0.0)));
    return slewed(motorCommand(torques), now);
}

Triple Link::slewed(const Triple& wanted, double now) noexcept
{
    std::array<int, 3> change{};
    int largest = 0;
    for (std::size_t i = 0; i < 3; ++i) {
        change[i] = wanted[i] - command_.motor[i];
        largest = std::max(largest, std::abs(change[i]));
    }
    const double most = commandPerSecond * std::clamp(now - sent_, 0.0, 5e-3);
    const double fraction = largest > most ? most / largest : 1.0;
    Triple motor{};
    for (std::size_t i = 0; i < 3; ++i) {
        motor[i] = static_cast<std::int16_t>(command_.motor[i] + std::lround(fraction * change[i]));
    }
    return motor;
}

bool Link::exchange(const ForceOrder& order) noexcept
{
    const double now = wire_.now();
    const Triple motor = motorFor(order, now);
    const std::uint8_t lamp = frozen_ || !posture_ ? lampRed : order.engaged != 0 ? lampGreen : lampBlue;
    const bool answered = send({motor, lamp, false}) && listen(answerTime);
    if (answered) {
        ++counts_.exchanges;
    } else {
        ++counts_.unanswered;
        // What cannot be sent takes no time; a loop must not spin on it.
        if (wire_.now() - now < answerTime) {
            wire_.sleep(answerTime);
        }
    }
    return answered;
}

void Link::rest() noexcept
{
    const double end = wire_.now() + restTime;
    while (!wire_.gone() && wire_.now() < end) {
        // The answer to the second says that the first was taken.
        if (send({}) && listen(answerTime) && send({}) && listen(answerTime)) {
            return;
        }
    }
}

void Link::close() noexcept
{
    wire_.close();
    posture_.reset();
}

bool Link::lost() const noexcept
{
    const double last = options_.home ? pose_.time : heard_;
    return wire_.gone() || wire_.now() - last > silence;
}

}  // namespace palpate::falcon
