#pragma once

#include <volume/label_image.h>
#include <volume/tissue.h>

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::datasets {

/// How the labels of one segmenter map to tissues.
struct LabelMap {
    std::string name;
    std::vector<volume::LabelName> labels;                      // by value; an empty name: the file's own
    std::vector<std::pair<std::string, std::string>> segments;  // by segment's name, tissue: entries without a value
    std::string source = {};                                    // where the values come from
    bool general = true;  // its names mean in other files what they mean here; "cancer", "PZ" do not
};

/// The built-in maps: "victre", "totalsegmentator", "freesurfer", those of challenges and of TotalSegmentator's tasks.
const std::vector<LabelMap>& labelMaps();
/// Their names.
std::vector<std::string> labelMapNames();
/// A built-in map by name ("destrieux" is "freesurfer"), or one from a TOML file. Throws std::runtime_error that names some
/// of those there are and says how to list all.
LabelMap labelMap(const std::string& nameOrFile);
/// The map as a TOML file that labelMap() reads.
std::string labelMapText(const LabelMap& map);

/// Knows tissues by what people and programs call structures (datasets/tables/names.toml).
class StructureNames {
public:
    StructureNames();
    /// The tissue of a structure that is called just so, but for sides, numbers and the like: "Left lung (upper lobe)".
    std::optional<std::string> tissueOf(std::string_view name) const;
    /// A tissue that the name speaks of; nothing to rely on.
    std::optional<std::string> suggestion(std::string_view name) const;

private:
    using Words = std::vector<std::string>;
    Words wordsOf(std::string_view name) const;

    Words ignored_;
    std::vector<Words> ambiguous_;                        // mean different things in different files
    std::vector<std::pair<Words, std::string>> phrases_;  // words, tissue
    std::vector<std::pair<Words, std::string>> labels_;   // the same of the built-in label maps that are general
};

/// A stiffness map from TOML, or the built-in one called "hu". `unit`: that of the image; a map for another unit is
/// refused. Throws std::runtime_error.
volume::StiffnessMap stiffnessMap(const std::string& nameOrFile, const std::string& unit, const volume::TissueTable& table);

}  // namespace palpate::datasets
