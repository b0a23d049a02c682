#pragma once

#include <string>

namespace palpate::apps {

/// "3%" or "0.03" as a share, over 0 and under 1. Throws std::runtime_error that names the option.
double parseShare(const std::string& option, const std::string& text);

/// "400us", "0.4ms" or "0.0004s" in seconds, over 0 and up to 1 s. Throws std::runtime_error that names the option.
double parseTime(const std::string& option, const std::string& text);

}  // namespace palpate::apps
