#pragma once

#include <datasets/scene.h>
#include <haptics/recorder.h>
#include <session/trainer.h>

#include <nlohmann/json_fwd.hpp>

namespace palpate::apps {

/// What `palpate train --json` gives.
nlohmann::json figuresOf(const session::TrainResult& result, const haptics::SessionInfo& info,
                         const datasets::ModelSettings& model);
/// The same for people, on standard output.
void summarise(const session::TrainResult& result, const haptics::SessionInfo& info, const datasets::ModelSettings& model);

}  // namespace palpate::apps
