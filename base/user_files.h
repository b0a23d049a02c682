#pragma once

// Where the programs keep what belongs to a user, by the XDG base directory specification.

#include <filesystem>
#include <string>

namespace palpate::base {

enum class UserFolder { config, data, cache };

/// $XDG_CONFIG_HOME/palpate, $XDG_DATA_HOME/palpate or $XDG_CACHE_HOME/palpate; else palpate in ~/.config, ~/.local/share
/// or ~/.cache. A path that is not absolute is ignored. Not made here.
/// @returns  an empty path where neither the variable nor HOME says where
std::filesystem::path userFolder(UserFolder kind);
/// The window's settings, with who trained last: trainer.json in the user's config, empty where that is.
std::filesystem::path trainerSettings();
/// The folder of a session's ultrasound images, beside its record.
std::filesystem::path imagesBeside(std::filesystem::path record);
/// A text as the name of a file: ASCII signs that are no letter and no digit become '-'.
std::string plainName(std::string text);
/// What the pages of somebody's progress are called, without ending. Names that differ in signs only share them.
std::string progressPages(const std::string& person);

}  // namespace palpate::base
