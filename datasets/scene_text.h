#pragma once

#include <datasets/scene.h>

#include <cstddef>
#include <string>

namespace palpate::datasets {

/// Vital structures of a scene: a session follows 16 structures, the target among them.
inline constexpr std::size_t mostVital = 15;

/// A scene as TOML text with every field, for scenes that no one wrote. parseScene() reads it back.
std::string sceneText(const Scene& scene);

}  // namespace palpate::datasets
