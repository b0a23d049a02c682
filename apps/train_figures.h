#pragma once

#include <apps/train_profile.h>
#include <base/descriptor.h>
#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <session/trainer.h>

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <memory>

namespace palpate::apps {

/// Room on the disk for the figures (--json), until it is given back: a record may fill the disk, and what the session came
/// to is told nevertheless. Throws std::runtime_error where the disk is full already.
std::shared_ptr<base::Descriptor> roomForFigures(const std::filesystem::path& json);
/// What `palpate train --json` gives.
nlohmann::json figuresOf(const session::TrainResult& result, const haptics::SessionInfo& info,
                         const haptics::SessionModel& model, const Conclusion& conclusion);
/// The same for people, on standard output.
/// @param next  setting that the next session takes because this one was too slow; empty: the same
void summarise(const session::TrainResult& result, const haptics::SessionInfo& info, const haptics::SessionModel& model,
               const std::string& next);

}  // namespace palpate::apps
