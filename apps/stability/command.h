#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

/// `palpate stability`.
void addStability(CLI::App& app);

}  // namespace palpate::apps
