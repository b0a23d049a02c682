#pragma once

#include <apps/train_profile.h>
#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <session/trainer.h>

#include <nlohmann/json_fwd.hpp>

namespace palpate::apps {

/// What `palpate train --json` gives.
nlohmann::json figuresOf(const session::TrainResult& result, const haptics::SessionInfo& info,
                         const haptics::SessionModel& model, const Conclusion& conclusion);
/// The same for people, on standard output.
/// @param next  setting that the next session takes because this one was too slow; empty: the same
void summarise(const session::TrainResult& result, const haptics::SessionInfo& info, const haptics::SessionModel& model,
               const std::string& next);

}  // namespace palpate::apps
