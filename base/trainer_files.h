#pragma once

// Files of the trainer's window that erasing a person must find too.

#include <filesystem>
#include <string>

namespace palpate::base {

/// The window's settings, with who trained last: $XDG_CONFIG_HOME/palpate/trainer.json, or
/// ~/.config/palpate/trainer.json.
std::filesystem::path trainerSettings();
/// A text as the name of a file: ASCII signs that are no letter and no digit become '-'.
std::string plainName(std::string text);
/// What the pages of somebody's progress are called, without ending. Names that differ in signs only share them.
std::string progressPages(const std::string& person);

}  // namespace palpate::base
