#pragma once

#include <datasets/scene.h>
#include <haptics/session_model.h>

#include <memory>
#include <string>

namespace palpate::tests {

/// The model of a scene given as TOML.
inline haptics::SessionModel modelOf(const std::string& text)
{
    auto scene = datasets::parseScene(text, "test.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

/// Flat skin, fat, gland with a tumour, muscle on bone; the skin is the plane y = 0 and the body lies behind it (+y).
inline std::string layeredSceneOf(int width)
{
    return R"(name = "layers"
[volume]
phantom = "layered"
voxel_mm = 1.0
[volume.parameters]
tumour_diameter_mm = 12
tumour_depth_mm = 20
width_mm = )" +
           std::to_string(width) + R"(
[[vital]]
name = "bone"
warn_mm = 5
[target]
structure = "tumour"
)";
}

inline const std::string layeredScene = layeredSceneOf(40);

inline const haptics::SessionModel& layeredNeedle()
{
    static const auto model = modelOf(layeredScene);
    return model;
}

/// A block of fat under a 10 mm sphere; surface y = 0, body behind it. `rest` is what [target] has beside the entry, and
/// further sections.
inline std::string sphereOnBlock(const std::string& rest)
{
    return R"(name = "block"
[volume]
phantom = "block"
voxel_mm = 2.0
[tool]
kind = "sphere"
radius_mm = 10
[dffb]
mode = "off"
[target]
entry_mm = [0, 0, 0]
)" + rest;
}

/// With a stiff inclusion.
inline const std::string blockScene = sphereOnBlock("structure = \"tumour\"\naim_mm = [0, 25, 0]\n");

inline const haptics::SessionModel& blockSphere()
{
    static const auto model = modelOf(blockScene);
    return model;
}

}  // namespace palpate::tests
