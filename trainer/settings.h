#pragma once

#include <filesystem>
#include <string>

namespace palpate::trainer {

/// What the window remembers from one day to the next.
struct Settings {
    std::string language;              // "en", "de"; empty: that of the desktop
    std::string palette = "standard";  // of tissues, see palpate-view --palette
    bool sounds = false;               // for warnings
    double textScale = 1;              // 0.5 to 3
    std::string person;                // who trained last; empty: nobody
};

/// What is not there, or not as it should be, is as at first.
Settings readSettings(const std::filesystem::path& file);
/// @returns  what is wrong, for the user; empty: it is written
std::string writeSettings(const std::filesystem::path& file, const Settings& settings);

}  // namespace palpate::trainer
