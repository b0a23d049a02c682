#pragma once

#include <volume/tissue.h>

#include <nlohmann/json_fwd.hpp>

namespace palpate::report {

/// Provenance entries of this key are what the import warned of; they travel with the file.
inline constexpr const char* warningKey = "warning";
/// And of this key what it did to the labels.
inline constexpr const char* stepKey = "step";

/// The figures of `info` and `import`: size, spacing_mm, direction, origin_mm, labels, memory_mb, warnings and more.
nlohmann::json volumeFigures(const volume::Tissue& tissue);

/// The same for people, in aligned columns on standard output.
void printVolume(const volume::Tissue& tissue);

}  // namespace palpate::report
