#pragma once

// A hand that holds a device, for the tests of the stabiliser.
#include <haptics/stabiliser.h>

#include <cmath>

namespace palpate::haptics::stabilised {

inline const StabiliserOptions premium;

inline DeviceSample heldAt(Vec3 position)
{
    DeviceSample s;
    s.position = position;
    s.buttons = buttonDeadMan;
    return s;
}

inline SentForce sendFor(double seconds, Vec3 basic, const DeviceSample& sample, const StabiliserOptions& o,
                         StabiliserState& s)
{
    SentForce sent;
    for (int i = 0; i < static_cast<int>(std::lround(seconds / o.period)); ++i) {
        sent = stabilise(basic, Vec3(0.0), sample, o, s);
    }
    return sent;
}

}  // namespace palpate::haptics::stabilised
