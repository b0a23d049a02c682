#pragma once

#include <string_view>

namespace palpate::base {

/// Name, version and commit of this build: "palpate 0.1.0 1a2b3c4".
std::string_view build() noexcept;

}  // namespace palpate::base
