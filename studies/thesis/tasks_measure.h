#pragma once

#include <haptics/broadcast.h>
#include <haptics/session_model.h>
#include <studies/thesis/tasks_scene.h>
#include <studies/thesis/tasks_thesis.h>

#include <array>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

namespace palpate::studies {

/// Where the time of an event goes [s].
struct EventTimes {
    std::string_view event;
    double process = 0;       // of a tick: median over frames of 33 ticks of their mean; see countedWork()
    double p50 = 0, p99 = 0;  // of single ticks, with all that they did
    std::array<double, haptics::taskCount> tasks{};  // medians; 0 for what did not run
    double publish = 0;                              // H8 and H9: mean, as one tick in 33 has a shape to publish
};

struct EventOptions {
    int frames = 10;  // of 33 ticks each, for each event
};

/// The time of a tick that counts for an event: all that the loop did in it, publishing included, but for H6 where Table 3
/// has it off: ours never stops watching. The deformation goes with H4, the stabiliser with H7's clock.
/// @param task  of each task [s]    @param publish  [s]
double countedWork(const TaskEvent& event, const std::array<double, haptics::taskCount>& task, double publish) noexcept;

/// Viewers of a session, for events with graphics on.
struct Graphics {
    haptics::Broadcast& broadcast;  // made with a viewer's hand, whose first beats tell that it draws
    std::function<bool()> lost;     // the viewer has ended; called from the measuring thread
};

/// Runs events of the thesis on one model, one tick per millisecond, in a thread that asks for real-time priority.
///
/// Touching: the needle is 30 mm inside the block and goes 2 mm out and in. Not touching: it does the same 15 mm in front
/// of it. Poses come from a path and forces go nowhere: H2 and H5 are without a device's transfer. Haptics off: the pose is
/// read, and nothing is done with it but what the event has on.
///
/// @param graphics  null: only for events without graphics. The events begin when a viewer draws; where none does within
///                  20 s nothing is returned
/// The model must outlive the call and its additional force is switched by it.
std::vector<EventTimes> timeEvents(haptics::SessionModel& model, std::span<const TaskEvent> events,
                                   const Graphics* graphics, const EventOptions& options);

/// The same for the objects of the thesis, without graphics: touching is inside of the first object.
std::vector<EventTimes> timeEvents(const ObjectScene& scene, const datasets::DffbParameters& dffb,
                                   std::span<const TaskEvent> events, const EventOptions& options);

/// Events of `all` with graphics on, or off.
std::vector<TaskEvent> eventsWith(std::span<const TaskEvent> all, bool graphics);

}  // namespace palpate::studies
