#pragma once

#include <experiments/stability/matrix.h>

#include <filesystem>

namespace palpate::apps {

/// Runs a cell once more and records it as a session that `palpate replay` and the viewer play; its volume is written
/// beside it, with the ending .vdb. Baselines: poses and forces; `replay` then says where Palpate's forces differ from
/// theirs. Throws std::runtime_error, also when a file is there already.
experiments::CellResult recordCell(const experiments::Cell& cell, const experiments::StabilityModels& models,
                                   const std::filesystem::path& file);

}  // namespace palpate::apps
