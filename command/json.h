#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>

namespace palpate::command {

/// Writes figures to the file of `--json` ("-" = standard output, "" = not asked for). Throws std::runtime_error.
void writeJson(const std::filesystem::path& file, const nlohmann::json& figures);

}  // namespace palpate::command
