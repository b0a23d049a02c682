#pragma once

#include <volume/label_image.h>
#include <volume/tissue_table.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::datasets {

/// The built-in tissue table (datasets/tables/tissues.toml). Row 0 is air; every row carries its source.
volume::TissueTable defaultTissues();

/// A tissue table from TOML. Throws std::runtime_error ("FILE:LINE: tissue 'fat': youngs_kpa = -3 kPa: must be 0 to 2e+07
/// kPa").
volume::TissueTable loadTissues(const std::filesystem::path& file);

/// How label values of one segmenter map to tissues.
struct LabelMap {
    std::string name;
    std::vector<volume::LabelName> labels;
};

/// Names of the built-in maps: "victre", "totalsegmentator".
std::vector<std::string> labelMapNames();
/// A built-in map by name, or one from a TOML file. Throws std::runtime_error that lists the names there are.
LabelMap labelMap(const std::string& nameOrFile);

}  // namespace palpate::datasets
