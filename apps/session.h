#pragma once

#include <datasets/scene.h>
#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <volume/tissue.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace palpate::apps {

/// What the command line changes in a scene.
struct SceneChanges {
    std::optional<std::string> model;    // one of datasets::modelLevels
    std::optional<std::string> setting;  // of level `elastic`: one of datasets::elasticSettings()
    std::optional<std::string> dffb;     // "off", "thesis", "field"
    std::optional<std::string> target;   // structure
    std::optional<std::uint64_t> seed;   // of a phantom
    std::optional<double> voxelsPerSide;
};

/// Loads a volume (.vdb). Throws std::runtime_error, also for a folder.
volume::Tissue loadVolume(const std::filesystem::path& file);

/// The scene called `what`: a built-in one by name, a TOML file, or a volume (.vdb) with the standard biopsy on it. Loads
/// the volume and builds the model. Throws std::runtime_error, also for a change that has nothing to change.
haptics::SessionModel openSession(const std::string& what, const SceneChanges& changes);

/// The session of a record again: same scene, same volume. Throws std::runtime_error when the volume is another now.
haptics::SessionModel reopenSession(const std::string& file, const haptics::SessionInfo& info);

/// What a record says about this session.
haptics::SessionInfo describeSession(const haptics::SessionModel& model, const std::string& origin,
                                     const std::string& device);

}  // namespace palpate::apps
