#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace palpate::base {

/// "400us", "0.4ms" or "0.0004s" in seconds, also with blanks before the unit; nothing for anything else.
std::optional<double> timeOf(std::string_view text);

/// "100mm", "10cm" or "0.1m" in metres, also with blanks before the unit; nothing for anything else.
std::optional<double> lengthOf(std::string_view text);

/// "1280x960" as width and height, both over 0; nothing for anything else.
std::optional<std::pair<int, int>> pixelsOf(std::string_view text);

/// "3%" or "0.03" as a share, over 0 and under 1. Throws std::runtime_error that names the option.
double parseShare(const std::string& option, const std::string& text);

/// "400us", "0.4ms" or "0.0004s" in seconds, over 0 and up to 1 s. Throws std::runtime_error that names the option.
double parseTime(const std::string& option, const std::string& text);

/// "2", "2mm" or "0.2cm" in metres, from `least` to `most` [m]; a number alone is in millimetres. Throws std::runtime_error
/// that names the option.
double lengthFrom(const std::string& option, const std::string& text, double least, double most);

/// A length [m] that was said as `text`, from `least` to `most`; nothing is none. Throws as lengthFrom().
double lengthWithin(const std::string& option, const std::string& text, std::optional<double> length, double least,
                    double most);

}  // namespace palpate::base
