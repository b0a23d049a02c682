#pragma once

#include <CLI/App.hpp>

namespace palpate::studies {

/// `palpate validate`: what is simulated beside measurements and closed forms.
void addValidate(CLI::App& app);

}  // namespace palpate::studies
