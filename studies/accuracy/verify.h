#pragma once

#include <filesystem>

namespace palpate::studies {

/// `palpate accuracy --verify`: the kernel, and palpate-reference where it was built, against closed forms. Prints a table
/// and writes verification[]. Throws std::runtime_error when a row is over its bound.
/// @param quick  coarse grids only
void verifyCommand(bool quick, const std::filesystem::path& json);

}  // namespace palpate::studies
