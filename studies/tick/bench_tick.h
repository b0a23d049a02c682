#pragma once

#include <haptics/servo.h>
#include <haptics/session_model.h>
#include <haptics/timing.h>

#include <string>
#include <vector>

namespace palpate::studies {

/// Time per query of one tool at the surface of one body.
struct QueryCase {
    std::string tool;         // sphere_3_elements, needle or sphere_10mm
    int elementsPerSide = 0;  // of the body
    bool deformed = false;    // the tool lies in a dent; else it overlaps tissue at rest
    haptics::Histogram touch;
    haptics::Histogram sweep;  // a millimetre closer to the surface, without a hit
    double meanTouched = 0;    // elements per touch
};

/// Times occupancy::touch() and sweep() of every tool on a cube of `elementsPerSide` elements, 2 mm apart, at rest and with
/// a dent of 4 mm in the form of a Gaussian bell. The poses lie around one place, as those of a hand do from tick to tick.
std::vector<QueryCase> benchQuery(int elementsPerSide);

/// Time per tick of one scripted session.
struct TickCase {
    haptics::ServoTiming all;    // every tick
    haptics::Histogram contact;  // ticks in which the tool has hold of tissue: what a bigger volume could slow down
    std::array<haptics::Histogram, haptics::taskCount> contactTasks;
    double meanMoved = 0;  // nodes per tick in contact
};

/// Runs the scene's scripted trainee once through the servo loop and times each tick by task.
TickCase benchTick(const haptics::SessionModel& model, const haptics::ServoOptions& options);

}  // namespace palpate::studies
