#pragma once

#include <datasets/scene.h>
#include <volume/tissue.h>

#include <filesystem>
#include <span>
#include <vector>

namespace palpate::datasets {

/// A coordinate in a scene or a `.loc` file from the origin, at most [mm].
inline constexpr double farthestCoordinate = 5000.0;

/// The volume with the inserts in it; only voxels that hold tissue change. Throws std::runtime_error for a tissue that the
/// volume's table does not have, a name that is there already, and an insert that touches no tissue.
volume::Tissue withInserts(const volume::Tissue& tissue, std::span<const Insert> inserts);

/// The volume with another tissue table, whose rows have the same names.
volume::Tissue withTable(const volume::Tissue& tissue, volume::TissueTable table);

/// Places where a lesion may grow: the `.loc` file of a VICTRE phantom, one "x,y,z" per line [mm] in the phantom's own
/// frame, returned in [m]. Throws std::runtime_error ("FILE:LINE: ..") for anything else, or when there is none.
std::vector<Vec3> loadLocations(const std::filesystem::path& file);

/// `lesion` at one of the places, chosen by its seed among those at which it lies wholly in tissue that is neither skin nor
/// bone. Throws std::runtime_error when there is no such place.
Insert placeLesion(const volume::Tissue& tissue, const std::filesystem::path& locations, Insert lesion);

/// `lesion` in the structure or tissue called so, chosen by its seed among the places at which it lies wholly inside.
/// Throws std::runtime_error when there is no room for it.
Insert placeLesionIn(const volume::Tissue& tissue, const std::string& structure, Insert lesion);

}  // namespace palpate::datasets
