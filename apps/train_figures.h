#pragma once

#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <session/trainer.h>

#include <nlohmann/json_fwd.hpp>

namespace palpate::apps {

/// What `palpate train --json` gives.
nlohmann::json figuresOf(const session::TrainResult& result, const haptics::SessionInfo& info,
                         const haptics::SessionModel& model);
/// The same for people, on standard output.
void summarise(const session::TrainResult& result, const haptics::SessionInfo& info, const haptics::SessionModel& model);

}  // namespace palpate::apps
