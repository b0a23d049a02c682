#include <render/space_mouse.h>

#include <spnav.h>

#include <algorithm>

namespace palpate::render {
constexpr double fullDeflection = 350;  // of an axis, as the daemon counts
constexpr double longestPeriod = 0.1;   // [s]: after a pause the first event has all of it

SpaceMouse::SpaceMouse() : connected_(spnav_open() == 0) {}

SpaceMouse::~SpaceMouse()
{
    if (connected_)
        spnav_close();
}

// The daemon's axes: x to the right, y up, z towards the user.
ultrasound::ProbeMove SpaceMouse::moved()
{
    ultrasound::ProbeMove sum;
    spnav_event event;
    while (connected_ && spnav_poll_event(&event) != 0) {
        if (event.type != SPNAV_EVENT_MOTION)
            continue;
        const auto& m = event.motion;
        const double seconds = std::min(1e-3 * m.period, longestPeriod);
        const auto fraction = [](int v) { return std::clamp(v / fullDeflection, -1.0, 1.0); };
        const double way = fastest * seconds, angle = fastestTurn * seconds;
        sum += {.slide = -way * fraction(m.x),
                .sweep = -way * fraction(m.z),
                .rock = angle * fraction(m.rz),
                .turn = angle * fraction(m.ry),
                .press = -way * fraction(m.y),
                .tilt = angle * fraction(m.rx)};
    }
    return sum;
}

}  // namespace palpate::render
