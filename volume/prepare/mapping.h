#pragma once

#include <volume/import.h>
#include <volume/tissue_table.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::prepare {

/// What the command line says about labels.
struct MappingOptions {
    std::string map;                 // a built-in label map's name, or a TOML file; "" = found out by the file's names
    std::vector<std::string> set;    // "NAME=TISSUE" or "VALUE=TISSUE"
    std::string defaultTissue;       // of labels that nothing else names; "" = they are an error
    std::filesystem::path writeMap;  // a label map to write for editing; no volume is made then
    std::filesystem::path names;     // a colour table or dataset.json that names the labels; "" = found out
    bool verbose = false;            // a note for each label, not one for all
};

using LabelCounts = std::map<std::uint16_t, std::uint64_t>;  // label value, voxels

LabelCounts countLabels(const volume::LabelImage& image);

/// Whether a name is more than the label's value: some programs, and our own export, write "label 3" where they know none.
bool tellsMore(const volume::LabelName& label);
/// The same name but for case and for what stands between its words: "gall bladder", "Gall_Bladder".
bool sameName(std::string_view a, std::string_view b);

/// A name and a tissue for every label that is there, 0 only where it is mapped: by --set, else by the label map (by value,
/// then by the segment's name), else by what the segment is called, else the default tissue. Appends to `notes` what was
/// not said but found out. Values alone never decide. Throws std::runtime_error that lists the labels left over with their
/// voxels, and the built-in maps that have all of their values; and for a map that contradicts names in the file.
std::vector<volume::LabelName> mapLabels(const MappingOptions& options, const std::filesystem::path& file,
                                         const volume::ImportedLabels& labels, const LabelCounts& counts,
                                         const volume::TissueTable& table, std::vector<std::string>& notes);

/// A label map that the user is to fill in.
struct BegunMap {
    std::size_t labels = 0;  // that are in it
    std::size_t open = 0;    // of which the tissue is only suggested, or not known
};

/// Writes what is known of the labels as a label map for the user to edit: tissues that are only suggested, or not known,
/// are marked.
BegunMap writeLabelMap(const MappingOptions& options, const std::filesystem::path& file,
                       const volume::ImportedLabels& labels, const LabelCounts& counts, const volume::TissueTable& table);

}  // namespace palpate::prepare
