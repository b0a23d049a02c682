#pragma once

#include <volume/geometry.h>

#include <fmt/format.h>

#include <string>
#include <vector>

/// What several tests write into files of images.
namespace palpate::volume {

/// As they lie in memory.
template <typename T>
std::string bytesOf(const std::vector<T>& values)
{
    return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

/// A line of MetaImage: the axes are the patient's.
inline constexpr const char* patientAxes = "TransformMatrix = 1 0 0 0 1 0 0 0 1\n";

/// As DICOM writes three numbers.
inline std::string dicomVector(const Vec3& v)
{
    return fmt::format("{:.10g}\\{:.10g}\\{:.10g}", v.x, v.y, v.z);
}

/// Reads DCMTK's dictionary of tags. The importer reads each DICOM file in a process of its own, which has the dictionary
/// of the one that began it, or reads it anew.
void loadDicomDictionary();

}  // namespace palpate::volume
