#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate bench view`: how long a viewer takes for a picture of a body that deforms everywhere in every frame.
void addBenchView(CLI::App& bench);

}  // namespace palpate::studies
