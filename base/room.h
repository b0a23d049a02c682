#pragma once

#include <base/descriptor.h>

#include <cstddef>
#include <filesystem>

namespace palpate::base {

/// Room on the disk of a folder that is kept free for what is written later: given back when the result is destroyed, or
/// the process ends. No file can be seen. Empty where the disk is full, or keeps none.
Descriptor keepRoom(const std::filesystem::path& folder, std::size_t bytes);

/// Whether the disk of a folder takes so many bytes more. True where that cannot be found out.
bool hasRoom(const std::filesystem::path& folder, std::size_t bytes);

}  // namespace palpate::base
