#pragma once

#include <studies/accuracy/rival.h>

#include <vector>

namespace palpate::studies {

/// Solvers of others for which we have a program, and which are installed here: Bullet's deformable bodies and CalculiX.
/// docs/accuracy.md has their settings.
std::vector<Rival> installedRivals();

}  // namespace palpate::studies
