#include <studies/stability/limits.h>

#include <studies/stability/theory.h>

namespace palpate::studies {

namespace {

constexpr double friction = 0.5;    // of the device [N s/m]
constexpr double limitTick = 1e-3;  // [s]

LimitPoint limitAt(double x, double delay, double hand, double period)
{
    auto device = idealDevice(friction);
    device.delay = delay;
    const haptics::Grip grip{hand > 0.0 ? 0.1 : 0.0, hand, 0.0};
    const double predicted = (friction + hand) / (0.5 * period + delay);
    return {x, predicted, stableStiffness(device, grip, 0.0, period, predicted)};
}

}  // namespace

std::vector<LimitMap> limitMaps()
{
    LimitMap delay{"delay", "delay [ms]", {}};
    for (const double ms : {0.0, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0}) {
        delay.points.push_back(limitAt(ms, ms * 1e-3, 0.0, limitTick));
    }
    LimitMap hand{"damping", "damping of the hand [N s/m]", {}};
    for (const double damping : {0.0, 0.5, 1.0, 2.0, 3.0, 5.0}) {
        hand.points.push_back(limitAt(damping, 0.0, damping, limitTick));
    }
    LimitMap rate{"rate", "rate of the loop [Hz]", {}};
    for (const double hertz : {60.0, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0}) {
        rate.points.push_back(limitAt(hertz, 0.0, 0.0, 1.0 / hertz));
    }
    return {delay, hand, rate};
}

}  // namespace palpate::studies
