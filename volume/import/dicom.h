#pragma once

#include <volume/import/source.h>

// Inside volume/import/ only: what comes as a folder or as DICOM, and OpenVDB files that are not ours.
namespace palpate::volume {

using Files = std::vector<std::filesystem::path>;

/// True for a file that begins as DICOM does, with a preamble or without.
bool isDicom(const std::filesystem::path& file);
/// The files in a folder that are read: volumes with the other files of theirs, and DICOM.
Files filesOfFolder(const std::filesystem::path& folder);
/// The DICOM files in a folder, by name; refuses a folder without any.
Files dicomFilesIn(const std::filesystem::path& folder);

/// A label map from a DICOM SEG, or from a series whose values are labels. `path` is what the user named.
ImportedLabels dicomLabels(const std::filesystem::path& path, const Files& files, const ImportOptions& options);
ImportedImage dicomImage(const std::filesystem::path& path, const Files& files, const ImportOptions& options);

/// A folder with a DICOM series, or with one mask per structure.
ImportedLabels folderLabels(const std::filesystem::path& folder, const ImportOptions& options);

/// Labels from an integer grid, or the inside of a level set, of a .vdb that another program wrote.
ImportedLabels vdbLabels(const std::filesystem::path& file, const ImportOptions& options);

}  // namespace palpate::volume
