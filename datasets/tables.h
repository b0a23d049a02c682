#pragma once

#include <datasets/scene.h>
#include <volume/tissue_table.h>

#include <filesystem>
#include <span>
#include <string>

namespace palpate::datasets {

/// The built-in tissue table (datasets/tables/tissues.toml). Row 0 is air; every row carries its source.
volume::TissueTable defaultTissues();

/// A tissue table from TOML. Throws std::runtime_error ("FILE:LINE: tissue 'fat': youngs_kpa = -3 kPa: must be 0 to 2e+07
/// kPa").
volume::TissueTable loadTissues(const std::filesystem::path& file);

/// What a tissue does to ultrasound. Where its table says nothing: the built-in table's row of the same name, else of its
/// role (air, skin, bone), else that of "soft_tissue".
volume::Acoustics acousticsOf(const volume::TissueRow& row);

/// The table with the changes of a scene in it. Throws std::runtime_error for a tissue that it does not have, and for
/// values that do not go together.
volume::TissueTable withChanges(volume::TissueTable table, std::span<const TissueChange> changes);

}  // namespace palpate::datasets
