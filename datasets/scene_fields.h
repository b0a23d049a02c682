#pragma once

// Keys and limits of a scene's tool and model; shared by the reader (scene_text.cpp) and checkScene(), no public header.

#include <base/units.h>
#include <datasets/scene.h>
#include <datasets/toml_fields.h>

#include <array>

namespace palpate::datasets {

inline constexpr std::array<Field<ToolSpec>, 8> toolFields{{
    {"radius_mm", "mm", 0.1, 30, 1e-3, &ToolSpec::radius},
    {"length_mm", "mm", 10, 500, 1e-3, &ToolSpec::length},
    {"throw_mm", "mm", 0, 50, 1e-3, &ToolSpec::throwLength},
    {"notch_mm", "mm", 1, 50, 1e-3, &ToolSpec::notchLength},
    {"notch_radius_mm", "mm", 0.05, 10, 1e-3, &ToolSpec::notchRadius},
    {"tip_mm", "mm", 0.1, 50, 1e-3, &ToolSpec::tipLength},
    {"bevel_deg", "deg", 0, 80, units::degree, &ToolSpec::bevel},
    {"bevel_turn_deg", "deg", -360, 360, units::degree, &ToolSpec::bevelTurn},
}};

inline constexpr std::array<Field<ModelSettings>, 5> modelFields{{
    {"spacing_mm", "mm", 0.2, 20, 1e-3, &ModelSettings::spacing},
    {"max_moves", "", 1, 1e6, 1, &ModelSettings::maxMoves},
    {"stiffness_n_m", "N/m", 0, 10000, 1, &ModelSettings::stiffness},
    {"relaxation", "", 0, 0, 1, &ModelSettings::relaxation},
    {"walls", "", 0, 0, 1, &ModelSettings::walls},
}};

inline constexpr std::array<Field<ElasticSettings>, 5> elasticFields{{
    {"spacing_mm", "mm", 0.2, 20, 1e-3, &ElasticSettings::spacing},
    {"window", "", 9, 41, 1, &ElasticSettings::window},
    {"cycles", "", 1, 100, 1, &ElasticSettings::cycles},
    {"poisson_cap", "", 0, 0.499, 1, &ElasticSettings::poissonCap},
    {"friction", "", 0, 5, 1, &ElasticSettings::friction},
}};

}  // namespace palpate::datasets
