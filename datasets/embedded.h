#pragma once

#include <string_view>

namespace palpate::datasets {

/// Text of a data file that was built in ("tables/tissues.toml"); empty for a name that is not there.
std::string_view embeddedFile(std::string_view file) noexcept;

}  // namespace palpate::datasets
