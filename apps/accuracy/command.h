#pragma once

#include <CLI/App.hpp>

namespace palpate::apps {

/// `palpate accuracy`.
void addAccuracy(CLI::App& app);

}  // namespace palpate::apps
