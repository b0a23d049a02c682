#pragma once

#include <session/trainer.h>

namespace palpate::apps {

/// Runs a session to its end, again for as long as its user begins it anew. Of an attempt that was begun anew nothing is
/// kept. Throws std::runtime_error, as session::Trainer does.
/// @param info  its `started` becomes that of the attempt whose result is returned
session::TrainResult runToItsEnd(const haptics::SessionModel& model, haptics::SessionInfo& info,
                                 const session::TrainOptions& options);

}  // namespace palpate::apps
