#pragma once

#include <haptics/session_model.h>

#include <memory>
#include <string>

namespace palpate::studies {

/// A block of fat on a base, small enough to be solved in no time: 30 x 16 x 30 mm, pressed by a sphere of 5 mm radius.
inline haptics::SessionModel smallBlock(const std::string& more = "")
{
    auto scene = datasets::parseScene(
        "name = \"small\"\n[volume]\nphantom = \"block\"\nvoxel_mm = 1\n[volume.parameters]\nwidth_mm = 30\nthickness_mm = "
        "16\ntumours = 0\n[model]\nlevel = \"spring\"\n[dffb]\nmode = \"off\"\n[target]\nstructure = \"base\"\naim_mm = "
        "[0, "
        "16, 0]\nentry_mm = [0, 0, 0]\n[tool]\nkind = \"sphere\"\nradius_mm = 5\n" +
            more,
        "small.toml");
    auto tissue = std::make_shared<const volume::Tissue>(datasets::sceneVolume(scene));
    return haptics::buildModel(std::move(scene), std::move(tissue));
}

}  // namespace palpate::studies
