#pragma once

#include <datasets/insert.h>
#include <datasets/scene.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace palpate::datasets {

class Section;

/// Vital structures of a scene: a session follows 16 structures, the target among them.
inline constexpr std::size_t maxVital = 15;

/// The tables [tissue.NAME] of a scene, and back.
std::vector<TissueChange> readTissueChanges(Section& top);
std::string tissueChangesText(std::span<const TissueChange> changes);

/// The table [probe] and the tables [[probe_step]] of a scene, and back.
void readProbe(Section& top, ProbeSpec& probe);
std::string probeText(const ProbeSpec& probe);

/// The table [ct] of a scene, and back.
void readCt(Section& top, CtSpec& ct);
std::string ctText(const CtSpec& ct);

/// The table [gravity] of a scene, and back.
void readGravity(Section& top, GravitySpec& gravity);
std::string gravityText(const GravitySpec& gravity);

/// Refuses a scene whose settings, tool or places no text may have, for scenes that a program has made or changed. Throws
/// std::runtime_error: "block: [model.elastic] window = 0: must be 9 to 41".
void checkScene(const Scene& scene);

/// As parseScene(), of a record's text, which may name a structure several times among the target and [[vital]].
Scene parseRecordedScene(const std::string& text, const std::filesystem::path& origin);

/// A scene as TOML text with every field, for scenes that no one wrote. parseScene() reads it back.
std::string sceneText(const Scene& scene);
/// What the volume of a scene follows from, as text: scenes with the same text have the same sceneVolume().
std::string volumeText(const Scene& scene);

}  // namespace palpate::datasets
