#pragma once

#include <filesystem>

namespace palpate::base {

/// Memory that this program can still get without swapping [bytes]: what the system has free (/proc/meminfo, MemAvailable)
/// and what the control groups of this process leave it, the less of them. Files that were read and can be dropped count as
/// free in both. Infinity where nothing tells.
/// @param root  where proc and sys are
double availableMemory(const std::filesystem::path& root = "/");

}  // namespace palpate::base
