#pragma once

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

// Inside volume/import/ only, and only for sources that know DCMTK.
namespace palpate::volume {

/// Frames that are deflated one by one (DICOM Supplement 244, 2025), which DCMTK does not know.
inline constexpr const char* deflatedFrames = "1.2.840.10008.1.2.8.1";

/// The UID that the file's meta header gives; "" where it has none.
std::string transferSyntaxOf(const std::filesystem::path& file);

/// Loads a file, deflated frames too; refuses what cannot be read, with the transfer syntax where that is the reason.
void loadDicom(const std::filesystem::path& file, DcmFileFormat& format);

/// The first segment of an RLE frame (PS3.5, G.3), up to `wanted` bytes; fewer where it is damaged.
std::vector<std::byte> unpackedRle(std::span<const std::byte> frame, std::size_t wanted);
/// A deflated frame without header (RFC 1951), up to `wanted` bytes; fewer where it is damaged.
std::vector<std::byte> inflated(std::span<const std::byte> frame, std::size_t wanted);

}  // namespace palpate::volume
