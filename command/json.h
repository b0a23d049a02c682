#pragma once

#include <nlohmann/json_fwd.hpp>

#include <filesystem>

namespace palpate::command {

/// Writes figures where `--json FILE` asked for them ("-" = standard output). Throws std::runtime_error.
void writeJson(const std::filesystem::path& file, const nlohmann::json& figures);

}  // namespace palpate::command
