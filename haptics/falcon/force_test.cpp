#include <haptics/falcon/force_test.h>

#include <base/words.h>

#include <algorithm>

namespace palpate::falcon {

namespace {

constexpr double patience = 30.0;                     // for the button [s]
constexpr double rise = 0.5, stay = 1.0, fall = 0.5;  // of the push [s]

bool held(const Link& link)
{
    return (link.pose().buttons & buttonCentre) != 0U;
}

// Fraction of the push at `t` seconds after its begin.
double shape(double t)
{
    return std::clamp(std::min(t / rise, (rise + stay + fall - t) / fall), 0.0, 1.0);
}

// Of the motors at the grip, towards the user [N].
double motorPush(const Link& link)
{
    const auto posture = postureAt(anglesOf(link.reading().count), link.pose().position);
    return posture ? forceOf(*posture, torquesOf(link.command().motor)).z : 0.0;
}

// Whether the button came in time.
bool waitForHold(Link& link, const Transport& wire, const std::atomic<bool>& stop)
{
    for (const double end = wire.now() + patience; wire.now() < end && !stop && !link.lost();) {
        link.exchange({});
        if (held(link)) {
            return true;
        }
    }
    return false;
}

}  // namespace

ForceTest testForce(Link& link, const Transport& wire, const Say& say, const std::atomic<bool>& stop, Guardian& guardian)
{
    ForceTest test;
    say("hold the grip loosely and press its centre button: it pushes towards you with 1 N, about the weight of an apple");
    test.held = waitForHold(link, wire, stop);
    if (!test.held) {
        link.rest();
        return test;
    }
    const double begun = wire.now(), from = link.pose().position.z;
    double t = 0;
    while (t < rise + stay + fall && held(link) && !stop && !link.lost() && !link.frozen()) {
        t = wire.now() - begun;
        link.exchange({{0.0, 0.0, testNewton * shape(t)}, wire.now(), 1});
        guardian.beat(link.command().motor != Triple{});
        test.peak = std::max(test.peak, motorPush(link));
        test.moved = std::max(test.moved, link.pose().position.z - from);
    }
    test.complete = t >= rise + stay + fall;
    link.rest();
    guardian.beat(false);
    return test;
}

std::string inWords(const ForceTest& test)
{
    if (!test.held) {
        return base::marked("The centre button of the grip was not pressed: no force was given.");
    }
    if (!test.complete) {
        return base::marked("The push was not finished: the centre button was let go, or the Falcon stopped answering.");
    }
    if (test.peak < 0.8 * testNewton) {
        return base::marked(
            "The motors were not told the whole force: hold the grip in the middle of its reach, and try again.");
    }
    return base::marked(
        "The Falcon pushed towards you with 1 N. Where you felt nothing, check its power supply, and home it again.");
}

}  // namespace palpate::falcon
