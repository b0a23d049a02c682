#include <volume/import/dicom.h>

// In place of the DICOM reader in a build without it (-DPALPATE_DICOM=OFF).
namespace palpate::volume {

namespace {

[[noreturn]] void refuseDicom(const std::filesystem::path& path)
{
    refuse(path, "is DICOM, which this build does not read: configure with -DPALPATE_DICOM=ON, or convert it to NIfTI");
}

}  // namespace

ImportedLabels dicomLabels(const std::filesystem::path& path, const Files& /*files*/, const ImportOptions& /*options*/)
{
    refuseDicom(path);
}

ImportedImage dicomImage(const std::filesystem::path& path, const Files& /*files*/, const ImportOptions& /*options*/)
{
    refuseDicom(path);
}

}  // namespace palpate::volume
