#pragma once

#include <volume/import.h>

// Inside volume/import/ only: a fault barrier around libraries that a damaged file can abort.
namespace palpate::volume {

constexpr const char* dicomLibrary = "the DICOM library (DCMTK)";

using LabelReader = std::function<ImportedLabels(const ImportOptions&)>;
using ImageReader = std::function<ImportedImage(const ImportOptions&)>;

/// What `read` returns or throws, from a process of its own: where that dies by a signal (a failed assertion of a decoder,
/// a segmentation fault, want of memory), the file is refused and this process goes on. Nothing that `read` does stays but
/// its result; what libraries print is dropped. options.progress is called here.
///
/// @param path     what the user named
/// @param library  who reads, for the reason of a refusal
ImportedLabels labelsApart(const std::filesystem::path& path, const char* library, const ImportOptions& options,
                           const LabelReader& read);
ImportedImage imageApart(const std::filesystem::path& path, const char* library, const ImportOptions& options,
                         const ImageReader& read);

}  // namespace palpate::volume
