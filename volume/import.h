#pragma once

#include <volume/label_image.h>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::volume {

/// A label map as a file holds it, with what the reader had to say.
struct ImportedLabels {
    LabelImage image;
    std::vector<LabelName> names;       // segment names where the file holds some; tissue is left empty
    std::vector<std::string> warnings;  // geometry that was chosen among several, and the like
};

/// Reads a label map: NIfTI (.nii, .nii.gz, .hdr/.img), NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd).
/// NRRD and MetaImage are decoded by ITK, after the header was checked against the bytes that are there. What ITK would get
/// wrong without an error is decoded here: NIfTI (it turns NaN into 0) and files whose header is wrong about their
/// compression. A NIfTI is placed by its sform when that has a code, else by its qform. Throws std::runtime_error ("FILE:
/// what is wrong and what to do").
ImportedLabels importLabels(const std::filesystem::path& file);

}  // namespace palpate::volume
