#include <studies/stability/theory.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

namespace palpate::studies {

namespace {

using haptics::Arm;
using haptics::DeviceParameters;
using haptics::Grip;

constexpr double standardPeriod = 1e-3;  // T [s]
constexpr double watched = 4.0;          // of an oscillation [s]
constexpr double runaway = 1.0;          // surely grows [m]
constexpr int halvings = 30;

struct Spring {
    double stiffness = 0;  // K [N/m]
    double damping = 0;    // B [N s/m]
};

// Whether the oscillation after a release from `amplitude` [m] is larger in the last quarter than in the second.
bool grows(const DeviceParameters& device, const Grip& grip, const Spring& spring, double amplitude,
           double period = standardPeriod)
{
    Arm arm(device, grip, Vec3(0.0), period);
    arm.release({amplitude, 0, 0});
    const int ticks = static_cast<int>(watched / period);
    double last = amplitude, early = 0.0, late = 0.0;
    for (int i = 0; i < ticks; ++i) {
        const double x = arm.read().x;
        arm.write({-spring.stiffness * x - spring.damping * (x - last) / period, 0, 0});
        last = x;
        if (std::abs(x) > runaway) {
            return true;
        }
        if (4 * i >= 3 * ticks) {
            late = std::max(late, std::abs(x));
        } else if (4 * i >= ticks && 2 * i < ticks) {
            early = std::max(early, std::abs(x));
        }
    }
    return late > early;
}

// Where `happens` begins, between `low` and `high`.
template <typename Happens>
double onset(double low, double high, Happens&& happens)
{
    for (int i = 0; i < halvings; ++i) {
        const double middle = 0.5 * (low + high);
        (happens(middle) ? high : low) = middle;
    }
    return 0.5 * (low + high);
}

DeviceParameters ideal(double mass, double viscous)
{
    DeviceParameters device;
    device.mass = mass;
    device.viscous = viscous;
    return device;
}

// The largest stiffness K at which an oscillation of 1 mm decays, between a fifth and five times `about` [N/m].
double stableStiffness(const DeviceParameters& device, const Grip& grip, double damping, double period, double about)
{
    return onset(0.2 * about, 5.0 * about, [&](double k) { return grows(device, grip, {k, damping}, 1e-3, period); });
}

TheoryRow delayRow(double delay, double damping)
{
    DeviceParameters device = ideal(0.075, 0.5);
    device.delay = delay;
    const double predicted = (device.viscous + damping) / (0.5 * standardPeriod + delay);
    const double simulated = stableStiffness(device, haptics::released, damping, standardPeriod, predicted);
    return {fmt::format("largest K [N/m], delay {:g} ms, B {:g} N s/m", 1e3 * delay, damping), predicted, simulated};
}

TheoryRow handRow(double damping)
{
    const DeviceParameters device = ideal(0.075, 0.1);
    const double predicted = 2.0 * (device.viscous + damping) / standardPeriod;
    const double simulated = stableStiffness(device, {0.1, damping, 0.0}, 0.0, standardPeriod, predicted);
    return {fmt::format("largest K [N/m], hand {:g} N s/m", damping), predicted, simulated};
}

// Energy that a hand draws in one to-and-fro over `stroke` [m], `samples` samples each way at constant speed, from a wall
// whose encoder rounds down to steps of `encoder` [m] (0 = none).
double drawn(double stiffness, double stroke, int samples, double encoder, const DeviceParameters& device)
{
    const double step = stroke / samples;
    double energy = 0.0;
    for (int i = 0; i < 2 * samples; ++i) {
        const int place = i < samples ? i : 2 * samples - i;
        const double x = place * step;
        // A hair beyond the edge of an encoder's step counts as that step.
        const double read = encoder > 0.0 ? std::floor(x / encoder + 1e-9) * encoder : x;
        const double way = i < samples ? step : -step;
        energy += -stiffness * read * way - (device.viscous * step / standardPeriod + device.coulomb) * step;
    }
    return energy;
}

TheoryRow longStrokeRow()
{
    const DeviceParameters device = ideal(0.075, 0.5);
    const double predicted = 2.0 * device.viscous / standardPeriod;
    const double simulated =
        onset(0.2 * predicted, 5.0 * predicted, [&](double k) { return drawn(k, 10e-3, 50, 0.0, device) > 0.0; });
    return {"passive K [N/m], long stroke: 2 b / T", predicted, simulated};
}

TheoryRow quantumRow()
{
    DeviceParameters device = ideal(0.075, 0.0);
    device.coulomb = 0.038;
    device.encoder = 0.03e-3;
    const double predicted = 2.0 * device.coulomb / device.encoder;
    const double simulated = onset(0.2 * predicted, 5.0 * predicted,
                                   [&](double k) { return drawn(k, device.encoder, 1, device.encoder, device) > 0.0; });
    return {"passive K [N/m], stroke of an encoder step: 2 c / D", predicted, simulated};
}

TheoryRow coulombRow(double stiffness)
{
    DeviceParameters device = ideal(0.072, 0.1);
    device.coulomb = 0.038;
    const double leak = 0.5 * stiffness * standardPeriod - device.viscous;
    const double predicted = 4.0 * device.coulomb / (std::numbers::pi * leak * std::sqrt(stiffness / device.mass));
    const double simulated = onset(0.2 * predicted, 5.0 * predicted, [&](double amplitude) {
        return grows(device, haptics::released, {stiffness, 0.0}, amplitude);
    });
    return {fmt::format("largest release [mm], Coulomb friction, K {:g} N/m", stiffness), 1e3 * predicted, 1e3 * simulated};
}

LimitPoint limitAt(double x, double delay, double hand, double period)
{
    auto device = ideal(0.075, 0.5);
    device.delay = delay;
    const Grip grip{hand > 0.0 ? 0.1 : 0.0, hand, 0.0};
    const double predicted = (device.viscous + hand) / (0.5 * period + delay);
    return {x, predicted, stableStiffness(device, grip, 0.0, period, predicted)};
}

}  // namespace

std::vector<TheoryRow> theoryRows()
{
    std::vector<TheoryRow> rows;
    for (const double damping : {0.0, 0.5}) {
        for (const double delay : {0.0, 1e-3, 2e-3, 5e-3, 16e-3}) {
            rows.push_back(delayRow(delay, damping));
        }
    }
    std::ranges::transform(std::initializer_list{0.0, 1.0, 3.0}, std::back_inserter(rows), handRow);
    rows.push_back(longStrokeRow());
    rows.push_back(quantumRow());
    std::ranges::transform(std::initializer_list{400.0, 600.0, 1000.0}, std::back_inserter(rows), coulombRow);
    return rows;
}

std::vector<LimitMap> limitMaps()
{
    LimitMap delay{"delay", "delay [ms]", {}};
    for (const double ms : {0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0}) {
        delay.points.push_back(limitAt(ms, ms * 1e-3, 0.0, standardPeriod));
    }
    LimitMap hand{"damping", "damping of the hand [N s/m]", {}};
    for (const double damping : {0.0, 0.5, 1.0, 2.0, 3.0, 5.0}) {
        hand.points.push_back(limitAt(damping, 0.0, damping, standardPeriod));
    }
    LimitMap rate{"rate", "rate of the loop [Hz]", {}};
    for (const double hertz : {60.0, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0}) {
        rate.points.push_back(limitAt(hertz, 0.0, 0.0, 1.0 / hertz));
    }
    return {delay, hand, rate};
}

}  // namespace palpate::studies
