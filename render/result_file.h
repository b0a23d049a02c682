#pragma once

#include <render/header.h>

#include <filesystem>
#include <optional>

namespace palpate::render {

/// Reads the figures that `palpate train` writes at the end of a session (score.total, score.points, losses[]). Nothing
/// where the file is not there yet, or says none of it.
std::optional<ResultCard> readResult(const std::filesystem::path& file);

}  // namespace palpate::render
