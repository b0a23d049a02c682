#pragma once

#include <haptics/servo.h>
#include <haptics/session_model.h>

namespace palpate::studies {

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
