#pragma once

#include <volume/prepare/mapping.h>

#include <optional>

namespace palpate::prepare {

/// Names of label values from a file beside the labels.
struct NameTable {
    struct Entry {
        std::int64_t value = 0;
        std::string name;
        std::optional<std::array<std::uint8_t, 3>> colour = std::nullopt;
    };

    std::filesystem::path file;
    std::string kind;                  // "colour table", "ITK-SNAP label description", "dataset.json"
    std::vector<Entry> entries;        // by value; two names of one value are an error only where the value is in use
    std::vector<std::string> regions;  // of a dataset.json: names of several values together, which name none of them
};

/// Reads a colour table of 3D Slicer (.ctbl) or FreeSurfer (FreeSurferColorLUT.txt), a label description of ITK-SNAP, or
/// the dataset.json of the Medical Segmentation Decathlon ({"1": "liver"}) or of nnU-Net ({"liver": 1}). What it is is seen
/// in the text. Throws std::runtime_error ("FILE:LINE: ..") for what is none of these.
NameTable readNameTable(const std::filesystem::path& file);

/// The dataset.json that certainly belongs to `labels`: that of the data set whose folder labelsTr, labelsTs or labelsVa it
/// lies in, where it lists the file or lists none, or that beside a prediction of nnU-Net (with its plans.json). Appends to
/// `notes` why one that is there is not taken.
std::optional<std::filesystem::path> datasetOf(const std::filesystem::path& labels, std::vector<std::string>& notes);

/// Gives the labels that are there the names of options.names, or of datasetOf() where the file has no names itself.
/// Appends to labels.warnings what was found and what has no name. Throws std::runtime_error where the table contradicts
/// names in the file, and where it names none of the labels.
void addNames(const MappingOptions& options, const std::filesystem::path& file, const LabelCounts& counts,
              volume::ImportedLabels& labels);

}  // namespace palpate::prepare
