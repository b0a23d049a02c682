#pragma once

#include <haptics/tick.h>

namespace palpate::haptics {

/// Adds an event to the tick; events beyond what a record holds are dropped (they are repeated states, never forces).
inline void addEvent(TickRecord& record, const Event& event) noexcept
{
    if (record.eventCount < maxEventsPerTick) {
        record.events[record.eventCount++] = event;
    }
}

}  // namespace palpate::haptics
