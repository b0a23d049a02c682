#include <studies/tick/bench_tick.h>

#include <haptics/hand.h>
#include <session/session.h>

#include <algorithm>

namespace palpate::studies {

using namespace haptics;

TickCase benchTick(const SessionModel& model, const ServoOptions& options)
{
    constexpr double startDistance = 10e-3;
    HandDevice hand = handBefore(model, startDistance);
    session::Session session(model, infoOf(model));

    TickCase result;
    double moved = 0.0;
    const auto sink = [&](const TickRecord& record, const ServoTiming&) {
        if (record.phase == Phase::free) {
            return;
        }
        moved += record.moved;
        double tick = 0.0;
        for (std::size_t i = 0; i < taskCount; ++i) {
            const auto seconds = static_cast<double>(record.seconds[i]);
            result.contactTasks[i].add(seconds);
            tick += seconds;
        }
        result.contact.add(tick);
    };
    result.all = session.run(hand, {.servo = options}, sink);
    result.meanMoved = moved / static_cast<double>(std::max<std::uint64_t>(result.contact.count(), 1));
    return result;
}

}  // namespace palpate::studies
