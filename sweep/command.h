#pragma once

#include <CLI/App.hpp>

namespace palpate::sweep {

/// Adds `palpate sweep`.
void addSweep(CLI::App& app);

}  // namespace palpate::sweep
