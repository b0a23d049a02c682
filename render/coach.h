#pragma once

#include <channel/layout.h>

#include <glm/vec3.hpp>

#include <string>

namespace palpate::render {

/// What a trainee is to do now, and what is wrong, in words.
struct Coaching {
    int step = 0, steps = 0;  // from 1; 0: there is nothing to do
    std::string now;          // what to do
    std::string wrong;        // empty: nothing
    bool last = false;        // a click on the words ends the session
};

/// What somebody who holds the tool has to be told.
struct CoachView {
    glm::dvec3 aim{0.0};        // of the planned line, where the deformed tissue has it now [m]
    bool planned = true;        // the planned line is shown
    bool targetHidden = false;  // it is to be found
    bool handIsHere = false;    // the window is the hand: steps name the keys
    bool outOfSight = false;    // the tip is outside the picture
    bool scanned = false;       // the ultrasound picture is shown, where the other mouse button moves the probe
};

/// Whether so much target in a core ends a biopsy: half of it, as briefings ask for and as the score has all points for
/// (docs/score.md), in whole per cent as it is shown.
/// @param target  fraction
bool isEnough(double target) noexcept;

/// The step that the session is at: of a touch or an advance where the scene asks for that, else of a biopsy (needle) or
/// palpation (any other tool).
///
/// A tool in the air that is outside the picture is what is wrong, whatever else is. As long as no core has enough
/// target the biopsy begins again. A length that is off is told with its direction in the patient: towards the head, feet,
/// front, back, left or right.
Coaching coach(const channel::Scenery& scenery, const channel::State& state, const CoachView& view);

}  // namespace palpate::render
