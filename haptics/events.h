#pragma once

#include <haptics/tick.h>

namespace palpate::haptics {

/// Adds an event to the tick. There is always room for the shot and the fault; of the others those that a record cannot
/// hold are left out, which takes a tip that jumps among many structures.
inline void addEvent(TickRecord& record, const Event& event) noexcept
{
    const bool always = event.kind == EventKind::fire || event.kind == EventKind::fault;
    if (record.eventCount < (always ? maxEventsPerTick : maxEventsPerTick - 2)) {
        record.events[record.eventCount++] = event;
    }
}

}  // namespace palpate::haptics
