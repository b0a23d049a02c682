#pragma once

#include <datasets/scene.h>
#include <haptics/recorder.h>
#include <haptics/session_model.h>
#include <volume/tissue.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace palpate::session {

/// What --dffb takes: `on` is the scene's own mode, or `field` where it has none; `fade` is `on` with a gain that falls to
/// nothing, over the trials of a study (--trial) or else over the session (the scene's fade_s, or fadeSeconds).
inline const std::vector<std::string> dffbChoices{"on", "off", "thesis", "field", "fade"};
inline constexpr double fadeSeconds = 120.0;

/// A lesion at one of the places that a file names.
struct LesionFrom {
    std::filesystem::path from;  // see datasets::loadLocations()
    datasets::Insert shape;      // its place is chosen by its seed
};

/// What the command line changes in a scene.
struct SceneChanges {
    std::optional<std::string> model;    // one of datasets::modelLevels
    std::optional<std::string> setting;  // of level `elastic`: one of datasets::elasticSettings()
    /// Names the setting where level is `elastic` and neither scene nor `setting` says one; empty: the scene's standard.
    std::function<std::string(const datasets::Scene&)> fit;
    std::optional<std::string> dffb;   // one of dffbChoices
    std::optional<std::string> trial;  // with "fade": "K/N"
    /// Another tool in place of the scene's, for what is no session: the scene's text does not have it.
    std::function<datasets::ToolSpec(const datasets::ToolSpec&)> tool;
    std::optional<std::string> arm;         // haptic device: one of haptics::deviceNames()
    std::optional<std::string> target;      // structure
    std::optional<std::uint64_t> seed;      // of a phantom
    bool seedElsewhere = false;             // it decides more than a phantom: no error where there is none
    std::optional<double> voxelsPerSide;    // of a phantom
    std::optional<LesionFrom> lesion;       // only of a volume (.vdb)
    bool palpate = false;                   // find the target with a fingertip instead of taking a core of it
    std::vector<datasets::Insert> inserts;  // further ones
    double memory = std::numeric_limits<double>::infinity();  // that a phantom may take [bytes]
};

/// Loads a volume (.vdb). Throws std::runtime_error, also for a folder.
volume::Tissue loadVolume(const std::filesystem::path& file);

/// The scene called `what`: a built-in one by name, a TOML file, or a volume (.vdb) with the standard biopsy on it. Loads
/// the volume and builds the model. Throws std::runtime_error, also for a change that has nothing to change.
haptics::SessionModel openSession(const std::string& what, SceneChanges changes);

/// Words where the body's cells are wider than the scene asks for, since finer ones would be over 4 million; else "".
std::string widerCells(const haptics::SessionModel& model);

/// The session of a record again: same scene, same volume, which lies where it was or beside the record `file`. Throws
/// std::runtime_error when the volume is another now or gone, and when the record says something else of its scene than the
/// scene does.
haptics::SessionModel reopenSession(const std::string& file, const haptics::SessionInfo& info);

/// Says of `info` that its session starts now, on this machine.
void startHere(haptics::SessionInfo& info);

/// What a record says about this session, which starts now on this machine.
haptics::SessionInfo describeSession(const haptics::SessionModel& model, const std::string& origin,
                                     const std::string& device);

}  // namespace palpate::session
