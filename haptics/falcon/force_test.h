#pragma once

#include <haptics/falcon/guardian.h>
#include <haptics/falcon/link.h>

#include <atomic>
#include <string>

namespace palpate::falcon {

/// What came of a test push.
struct ForceTest {
    bool held = false;      // the centre button was pressed in time
    bool complete = false;  // it stayed pressed, and the Falcon answered, to the end of the push
    double peak = 0;        // largest force of the motors towards the user [N]
    double moved = 0;       // how far the grip gave way towards the user [m]
};

inline constexpr double testNewton = 1.0;  // towards the user, for a second [N]

/// Pushes the grip towards its user with `testNewton`: comes up within half a second, stays for one, falls within half.
/// The user holds the centre button; letting it go takes the force off at once.
/// @param link  connected and homed
/// @param wire  the link's, for its clock
/// @param say   tells the user what to do
/// @param stop  ends it before its time
/// @param guardian  hears of every packet, whether it put torque on
ForceTest testForce(Link& link, const Transport& wire, const Say& say, const std::atomic<bool>& stop, Guardian& guardian);

/// What it means, in words for the user, and what to do.
std::string inWords(const ForceTest& test);

}  // namespace palpate::falcon
