#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

struct DeepCommand {
    std::vector<std::string> scenes;                               // of those that have forces; none = all
    std::vector<std::string> settings{"fast", "default", "fine"};  // of level elastic
    double speed = 20;                                             // [mm/s]
    bool quick = false;                                            // the block, two places in the grid
    std::filesystem::path folder, json;                            // "" = none
};

/// `palpate accuracy --depth`: level elastic from first touch to two radii and back, against stored forces of finite
/// elements. Prints a table, and writes depth.json, depth.csv, depth.html and a PNG per case. Throws std::runtime_error,
/// also where a tool was pulled into the body.
void deepCommand(const DeepCommand& command);

/// Writes these files. Returns the pictures.
std::vector<std::filesystem::path> writeDeepFolder(const std::filesystem::path& folder, const nlohmann::json& figures);

/// `palpate accuracy --verify`: the kernel, and palpate-reference where it was built, against closed forms. Prints a table
/// and writes verification[]. Throws std::runtime_error when a row is over its bound.
/// @param quick  coarse grids only
void verifyCommand(bool quick, const std::filesystem::path& json);

}  // namespace palpate::studies
