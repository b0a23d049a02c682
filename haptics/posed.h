#pragma once

#include <chainmail/posture.h>
#include <datasets/scene.h>
#include <volume/tissue.h>

#include <memory>
#include <optional>

namespace palpate::haptics {

/// A scene's volume as it is under the scene's gravity, with the plan that goes with it.
struct Posed {
    std::shared_ptr<const volume::Tissue> tissue;      // the volume itself where nothing moves
    std::optional<Vec3> entry, aim;                    // of the scene, moved with the tissue [m]
    std::optional<chainmail::PostureFigures> figures;  // of the posture; nothing: nothing moves
};

/// @param tissue  as the scene's volume has it (datasets::sceneVolume()); never null
/// Takes seconds where the scene has [gravity]. Throws std::runtime_error as chainmail::postureOf() does, and where the
/// plan has places that do not move with tissue: steps of a script, a probe's place, an entry or an aim in air.
Posed posed(const datasets::Scene& scene, std::shared_ptr<const volume::Tissue> tissue);

/// What a posture came to, as people read it.
std::string textOf(const chainmail::PostureFigures& figures);

}  // namespace palpate::haptics
