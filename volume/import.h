#pragma once

#include <volume/label_image.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace palpate::volume {

/// What a reader cannot know by itself.
struct ImportOptions {
    /// Which segment a voxel belongs to where several hold it: names of segments, of which later ones win, or one of
    /// "smallest", "last", "first". Segments that are not named lose against those that are. Empty: "smallest", the segment
    /// with the fewest voxels wins (the later one where they have the same number), so that no structure is swallowed.
    std::vector<std::string> overlap;
    /// A probability from which a voxel is taken as set (DICOM SEG of type FRACTIONAL); none: 0.5. Labels without
    /// probabilities are refused with one.
    std::optional<float> fractionalThreshold;
    std::string series;  // SeriesInstanceUID to take where a folder holds several; a file is what it is
    /// Of an image: series that the labels were made of (ImportedLabels::madeOf). Where a folder holds several, none is
    /// named and one of them is of these, it is taken.
    std::vector<std::string> seriesOfLabels = {};
    /// Distance between the slices of a DICOM SEG whose frames leave slices out and that does not say it [m]; 0: refuse it.
    double sliceSpacing = 0;
    /// Grids whose voxel axes are not at right angles (tilted gantry, affine registration) are refused unless the caller
    /// resamples them. Images are read in any case.
    bool sheared = false;
    int volume = 0;    // which of the volumes of a file with four dimensions, from 1; 0: refuse such a file
    std::string axes;  // where the voxel axes of a file go that does not say it: "LPS", "RAS", ...; "": LPS, with a warning
    bool axesIfUnsaid = false;                  // a file that says it is not refused for `axes`; it keeps its own
    bool renumber = false;                      // values that are no label (negative, over 65535) get free ones
    bool round = false;                         // values within 0.001 of a whole number are taken as that
    bool dicomLabels = false;                   // the values of a DICOM series of CT, MR and the like are labels
    std::function<void(double)> progress = {};  // is called with the share that is done, 0 to 1; may be empty
};

/// Voxels that two segments claimed.
struct Overlap {
    std::uint16_t kept = 0;    // label value of the segment that won
    std::uint16_t lost = 0;    // of one that did not
    std::uint64_t voxels = 0;  // how many
};

/// A value of the file that is no label, and the label that its voxels have instead.
struct Renumbered {
    std::int64_t original = 0;  // in the file
    std::uint16_t value = 0;    // in the volume
};

/// A label map as a file holds it, with what the reader had to say.
struct ImportedLabels {
    LabelImage image;                    // labels and their place
    std::vector<LabelName> names;        // segment names where the file holds some; tissue is left empty
    std::vector<Overlap> overlaps;       // a voxel of `lost` is counted once, against the segment that has it now
    std::vector<std::string> warnings;   // geometry that was chosen among several, and the like
    std::vector<Renumbered> renumbered;  // by the value in the file; empty without options.renumber
    std::string frame;                   // DICOM's Frame of Reference UID; empty where the file has none
    std::vector<std::string> madeOf;     // SeriesInstanceUIDs of the images that a DICOM SEG says it was made of

    /// The value that the file has for a label.
    std::int64_t originalOf(std::uint16_t value) const noexcept;
};

/// An intensity image: CT, MR.
struct ImportedImage {
    Index3 size{0};                     // voxels along each axis
    Affine affine;                      // where they are [m]
    std::vector<float> values;          // size.x * size.y * size.z, x fastest; finite
    std::string what;                   // "HU" where the file says that it is CT, else empty
    std::vector<std::string> warnings;  // as of labels
    std::string frame;                  // as of labels: places of two frames have nothing to do with each other
};

/// Reads a label map. A file: NIfTI (.nii, .nii.gz, .hdr/.img), NRRD (.nrrd, .nhdr, .seg.nrrd), MetaImage (.mha, .mhd),
/// DICOM SEG, OpenVDB. A folder: a DICOM series, or one mask per structure. docs/formats.md has the rules of each. Every
/// header is checked against the bytes that are there before anything is allocated for it. Throws std::runtime_error
/// ("FILE: what is wrong and what to do").
ImportedLabels importLabels(const std::filesystem::path& path, const ImportOptions& options = {});

/// Reads an intensity image from the same formats, slope and intercept applied. Throws like importLabels().
ImportedImage importImage(const std::filesystem::path& path, const ImportOptions& options = {});

/// The files that importLabels() or importImage() would read: those of a folder that are of its kinds, a header and its
/// data. Throws like these.
std::vector<std::filesystem::path> filesOf(const std::filesystem::path& path);

/// Largest deviation of the angles between voxel axes from a right angle [rad].
double shearOf(const Affine& affine) noexcept;

}  // namespace palpate::volume
