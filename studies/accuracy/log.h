#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::studies {

/// The finished cases of a run, one JSON text per line: what a run that was stopped has done already. Lines of other
/// builds, of other references, or that are cut short count for nothing and stay.
class AccuracyLog {
public:
    /// @param file   "" = nothing is kept
    /// @param build  of this program
    /// Throws std::runtime_error when the file is there and cannot be read.
    AccuracyLog(std::filesystem::path file, std::string build);

    /// The entry of a case that is done, or null. `reference`: its key.
    const nlohmann::json* find(const std::string& reference, const std::string& method, const std::string& setting) const;
    /// Appends at once, so that whatever ends the program loses no case. Throws std::runtime_error.
    void add(const std::string& reference, const nlohmann::json& entry);

private:
    std::filesystem::path file_;
    std::string build_;
    std::vector<nlohmann::json> lines_;  // of this build
};

}  // namespace palpate::studies
