#include <haptics/record_rows.h>

namespace palpate::haptics::format {

void readEvent(const Statement& row, TickRecord& record)
{
    base::failIf(integerOf(row, 5, "position of an event", 0, maxEventsPerTick - 1) != record.eventCount,
                 "tick {}: event {} is missing or there twice", record.tick, record.eventCount);
    Event& event = record.events[record.eventCount++];
    event.kind = fromName<EventKind>(row.text(1), eventNames);
    event.structure = optionalIndex(row, 2, "structure of an event");
    event.tissue = static_cast<std::uint8_t>(integerOf(row, 3, "tissue of an event", 0, maxTissues - 1));
    event.value = realOf(row, 4, "value of an event");
}

void readCore(const Statement& row, TickRecord& record, bool& found)
{
    base::failIf(!record.fired, "tick {}: a core of a tick that did not fire", record.tick);
    CoreSample& core = record.core;
    const auto real = [&row](int column) { return realOf(row, column, "a value of a core"); };
    core.volume = real(1);
    core.targetFraction = real(2);
    core.targetLength = real(3);
    core.notchStart = {real(4), real(5), real(6)};
    core.notchEnd = {real(7), real(8), real(9)};
    core.fragments =
        static_cast<std::uint32_t>(integerOf(row, 10, "fragments of a core", 0, std::numeric_limits<std::uint32_t>::max()));
    found = true;
}

void readFraction(const Statement& row, TickRecord& record)
{
    base::failIf(!record.fired, "tick {}: fractions of a core of a tick that did not fire", record.tick);
    const auto tissue = integerOf(row, 1, "tissue of a core", 0, static_cast<std::int64_t>(maxTissues) - 1);
    record.core.fraction[static_cast<std::size_t>(tissue)] = realOf(row, 2, "fraction of a core");
}

}  // namespace palpate::haptics::format
