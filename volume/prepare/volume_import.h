#pragma once

#include <volume/import.h>
#include <volume/prepare/mapping.h>
#include <volume/prepare/steps.h>
#include <volume/tissue.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace palpate::prepare {

/// What is asked of an import: what `palpate import` takes on its command line.
struct ImportRequest {
    std::filesystem::path input;    // label map or segmentation: a file, or a folder of masks or of DICOM
    std::filesystem::path image;    // CT or MR of the same patient, on any grid; empty: none
    std::string stiffness;          // stiffness map, see datasets::stiffnessMap(); empty: the image changes nothing
    std::string imageUnit;          // "HU", where the image's file does not say so
    int imageVolume = 0;            // of an image with four dimensions, from 1
    std::string imageSeries;        // of an image that is a folder; empty: reading.series where the labels are one file
    bool ignoreFrame = false;       // labels and image of two DICOM frames of reference are in one all the same
    std::string imageAxes;          // where the image's axes go, if its file does not say it; empty: as reading.axes
    volume::ImportOptions reading;  // of the labels
    MappingOptions mapping;         // of labels to tissues
    PreparationOptions steps;       // done to the labels
    double hull = 0;                // thickness of a body that is invented around the labels [m]; 0: none
    bool bodyFromImage = false;     // find the body around the labels in the image, which is CT
};

/// The lengths of an import, by the options of `palpate import`, with their bounds [m]. 0 stands for none.
struct LengthBounds {
    const char* option;
    double least, most;
};
inline constexpr LengthBounds voxelBounds{"--voxel", 0.05e-3, 50e-3}, sliceBounds{"--slice-spacing", 0.05e-3, 50e-3},
    skinBounds{"--add-skin", 0.05e-3, 50e-3}, hullBounds{"--body-from-hull", 2e-3, 0.2}, padBounds{"--pad", 0.05e-3, 0.5},
    cropBounds{"--crop-margin", 0, 1}, holesBounds{"--close-skin-holes", 0.05e-3, 0.5};

/// Throws std::runtime_error for a request that contradicts itself, or has a length out of its bounds, by the options of
/// `palpate import`.
void checkRequest(const ImportRequest& request);

/// Refuses an output that is there and is one of the files that the import reads: those that the request names, their data
/// beside a header, what a folder of it holds, and the dataset.json that is found. Throws std::runtime_error.
void checkReplaced(const ImportRequest& request, const std::vector<std::filesystem::path>& outputs);

/// Told what is going on, and the fraction of it that is done where that is known.
using ImportProgress = std::function<void(const std::string& what, std::optional<double> fraction)>;

/// Labels as their file has them, named as far as file and name table go.
struct NamedLabels {
    volume::ImportedLabels labels;
    LabelCounts counts;
};

/// Reads the labels of an import. Throws std::runtime_error.
NamedLabels readLabels(const ImportRequest& request, const ImportProgress& tell);

/// What came of an import.
struct ImportedVolume {
    volume::Tissue tissue;
    std::vector<volume::Overlap> overlaps;
    std::vector<PreparationStep> steps;
};

/// Turns a segmentation into a volume of tissue. What it warned of and did is in the volume's provenance
/// (volume::warningKey, volume::stepKey). Throws std::runtime_error ("FILE: what is wrong and what to do").
ImportedVolume importVolume(const ImportRequest& request, const volume::TissueTable& table, const ImportProgress& tell);

}  // namespace palpate::prepare
