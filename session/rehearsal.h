#pragma once

#include <haptics/session_model.h>

#include <string>

namespace palpate::session {

/// What ticks of a model take on this machine.
struct Rehearsal {
    double p50 = 0;    // processor time of a tick in contact: half take at most so long [s]
    double worst = 0;  // longest [s]
};

/// Ticks of a session that is thrown away: its tool goes from the entry towards the aim at 100 mm/s, 4 mm deep. Ends after
/// 40 ticks, or after the tick in which 0.3 s are over. Before a session begins it tells what the session will ask for.
Rehearsal rehearse(const haptics::SessionModel& model);

/// Empty, or why such a session should not begin unless its user insists: one that keeps time (`paced`) whose ticks take
/// over five times what there is, one that does not whose second would take over a minute. One sentence, for the user.
std::string whyTooSlow(const Rehearsal& rehearsal, bool paced);

}  // namespace palpate::session
