#pragma once

#include <volume/label_image.h>
#include <volume/resample.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string_view>

namespace palpate::volume {

/// How a label map is written.
struct ExportOptions {
    /// NIfTI-2, which keeps positions as doubles. NIfTI-1 keeps them as floats: 8e-6 mm at 150 mm from the origin.
    bool nifti2 = false;
    std::function<void(double)> progress = {};  // is called with the share that is done, 0 to 1; may be empty
};

/// Checks that `file` ends as one of the formats that can be written: .nii, .nii.gz, .nrrd, .seg.nrrd, .mha, .mhd. Throws
/// std::runtime_error that lists them, and `others` that the caller can write.
void checkExportName(const std::filesystem::path& file, std::string_view others = "");

/// Whether `file` ends as NIfTI: .nii or .nii.gz.
bool isNifti(const std::filesystem::path& file);

/// The file beside `file` that holds the voxels: the .raw of an .mhd. Empty for the other formats.
std::filesystem::path exportedDataOf(const std::filesystem::path& file);

/// Writes a label map in the format that its name asks for: bytes where all labels are under 256, else 16 bits. The file
/// appears whole or not at all; that of the voxels of an .mhd, a .raw, comes first. A .raw that is there is replaced
/// if the .mhd that is there names it.
///
///     .nii, .nii.gz   sform, and qform where the axes are at right angles; names and colours as Caret's label table
///     .nrrd           gzip
///     .seg.nrrd       3D Slicer's segmentation, one layer: name, colour, extent and terminology of every segment
///     .mha, .mhd      not compressed; no names
///
/// @param file     that is written
/// @param image    the labels
/// @param names    of labels; those of value 0 and of labels that no voxel has are left out
/// @param options  version of NIfTI, and who hears how far it is
/// Throws std::runtime_error ("FILE: what is wrong and what to do"), as the other three do where there is not one value for
/// each place of the grid, or where that is empty; for voxels without a volume as the next two do.
void exportLabels(const std::filesystem::path& file, const LabelImage& image, std::span<const LabelName> names,
                  const ExportOptions& options = {});

/// Writes an intensity image as 32-bit floats (count x 1); not as .seg.nrrd.
void exportImage(const std::filesystem::path& file, const VoxelGrid& grid, std::span<const float> values,
                 const ExportOptions& options = {});

/// Writes a field of vectors in LPS [mm] as 32-bit floats (count x 3); not as .seg.nrrd. NIfTI: intent 1007 (vector), the
/// components along the fifth dimension, as ITK and ANTs have displacement fields.
void exportVectors(const std::filesystem::path& file, const VoxelGrid& grid, std::span<const Vec3f> values,
                   const ExportOptions& options = {});

/// Writes nodes and what they have moved by as a VTK unstructured grid (.vtu): a hexahedron between every eight nodes of
/// tissue, at rest [mm], with `displacement_mm` and `tissue`, the row of the tissue table. ParaView's "Warp By Vector"
/// gives the deformed shape.
/// @param file    that is written
/// @param grid    of the nodes
/// @param tissue  0: no node there (count x 1)
/// @param u       displacement [m] (count x 3)
/// Throws std::runtime_error.
void exportVtu(const std::filesystem::path& file, const NodeGrid& grid, std::span<const std::uint8_t> tissue,
               std::span<const Vec3f> u);

}  // namespace palpate::volume
