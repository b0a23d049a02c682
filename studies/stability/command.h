#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate stability`.
void addStability(CLI::App& app);

}  // namespace palpate::studies
