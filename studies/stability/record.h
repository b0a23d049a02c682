#pragma once

#include <studies/stability/matrix.h>

#include <filesystem>

namespace palpate::studies {

/// Runs a cell once more and records it as a session that `palpate replay` and the viewer play; its volume is written
/// beside it, with the ending .vdb. Baselines: poses and forces; `replay` then says where Palpate's forces differ from
/// theirs. Throws std::runtime_error, also when a file is there already.
/// @param file  ends in .db
CellResult recordCell(const Cell& cell, const StabilityModels& models, const std::filesystem::path& file);

/// Where the volume of a record goes. Throws std::runtime_error for a name that does not end in .db.
std::filesystem::path volumeBeside(const std::filesystem::path& record);

}  // namespace palpate::studies
