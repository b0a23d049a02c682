#pragma once

namespace palpate::volume {

/// Provenance entries of this key are what an import warned of; they travel with the file.
inline constexpr const char* warningKey = "warning";
/// And of this key what it did to the labels.
inline constexpr const char* stepKey = "step";

}  // namespace palpate::volume
