#pragma once

#include <filesystem>
#include <string>

// Inside report/ only: the card of a session's pictures.
namespace palpate::report {

/// The PNG files of a folder, in the order of their times: all of events, and of the others so many that there are eight,
/// at least two. Empty for no folder, and for one without pictures. Throws std::runtime_error where it cannot be read.
std::string picturesCard(const std::filesystem::path& folder);

}  // namespace palpate::report
