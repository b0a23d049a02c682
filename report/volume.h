#pragma once

#include <volume/tissue.h>

#include <nlohmann/json_fwd.hpp>

namespace palpate::report {

/// The figures of `info` and `import`: size, spacing_mm, direction, origin_mm, labels, memory_mb, support, warnings and
/// more. `support` is the plane on which a body lies in which nothing is fixed (point_mm, normal to where it is free), or
/// null.
nlohmann::json volumeFigures(const volume::Tissue& tissue);

/// The same for people, in aligned columns on standard output.
void printVolume(const volume::Tissue& tissue);

}  // namespace palpate::report
