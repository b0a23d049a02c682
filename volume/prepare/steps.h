#pragma once

#include <volume/label_image.h>
#include <volume/tissue.h>

#include <nlohmann/json_fwd.hpp>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace palpate::prepare {

/// What may be done to a label map before it becomes tissue, in the order in which it is done. Nothing is the default.
struct PreparationOptions {
    std::string crop;                      // "", "tissue", a structure, or "x0,x1,y0,y1,z0,z1" [mm]
    double cropMargin = 10e-3;             // around a structure [m]
    double voxel = 0;                      // edge of the new, cubic voxels [m]; 0 = as they are
    bool largest = false;                  // keep the largest piece only
    std::vector<std::string> largestOf;    // of these structures or tissues; none: of all
    std::optional<double> closeSkinHoles;  // no larger than this [m]
    double addSkin = 0;                    // thickness [m]
    double pad = 0;                        // [m]
};

/// What one step did to one structure.
struct PreparationStep {
    std::string step;       // "resample", "largest-piece", ..
    std::string structure;  // "" = the whole volume
    std::string text;       // for people
    std::uint64_t voxels = 0;
    double volume = 0;    // [m^3]
    double before = 0;    // resample: volume of the structure [m^3]
    std::string warning;  // for people; "" = nothing to warn of
};

/// Where label 0 is tissue, gives it a free value, in `image` and `names`: 0 then is outside, as it is to all that adds
/// voxels. Empty where there was nothing to do. Throws std::runtime_error where no value is free.
std::vector<PreparationStep> separateOutside(volume::LabelImage& image, std::vector<volume::LabelName>& names,
                                             const volume::TissueTable& table);

/// Does to `image` what is asked for; a skin that was added gets a row in `names`. Throws std::runtime_error for structures
/// that are not there and steps that cannot be done.
/// @param tell  is called with what is going on
std::vector<PreparationStep> prepare(volume::LabelImage& image, std::vector<volume::LabelName>& names,
                                     const volume::TissueTable& table, const PreparationOptions& options,
                                     const std::function<void(const std::string&)>& tell);

/// [{step, structure, voxels, volume_ml, ..}]
nlohmann::json stepFigures(const std::vector<PreparationStep>& steps);

}  // namespace palpate::prepare
