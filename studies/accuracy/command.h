#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate accuracy`.
void addAccuracy(CLI::App& app);

}  // namespace palpate::studies
