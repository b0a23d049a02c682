#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>
#include <string>
#include <vector>

namespace palpate::trainer {

/// Short commands of `palpate`, which the window waits for.
class Commands {
public:
    /// @param programs  folder of palpate
    /// @param scratch   for what they print
    Commands(std::filesystem::path programs, std::filesystem::path scratch);

    /// What a command writes with --json. Discarded where it fails: `notice` then says why, in a sentence of the user's
    /// language before that of the command.
    nlohmann::json answer(std::vector<std::string> words, std::string& notice) const;
    /// Of one that writes no JSON. Returns whether it did what it was asked; `notice` says why not, and else is empty.
    bool did(const std::vector<std::string>& words, std::string& notice) const;

private:
    std::filesystem::path programs_, scratch_;
};

/// What a command that needs profiles has said, or why there can be none; empty where it said nothing.
std::string aboutProfiles(const std::string& said);
/// When somebody last wrote to a file; the least time where there is none.
std::filesystem::file_time_type writtenAt(const std::filesystem::path& file) noexcept;
/// With what the desktop opens pages with; nothing happens where it has nothing.
void openPage(const std::filesystem::path& page);

}  // namespace palpate::trainer
