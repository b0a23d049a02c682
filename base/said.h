#pragma once

#include <base/words.h>

#include <fmt/format.h>

#include <string>

namespace palpate::base {

/// A translated format with its values; {:.1Lf} writes a number as the language does. A translation that does not fit its
/// values gives their format itself: a test finds those.
template <typename... Values>
std::string said(const char* format, const Values&... values)
{
    try {
        return fmt::vformat(numbers(), format, fmt::make_format_args(values...));
    } catch (const fmt::format_error&) {
        return format;
    }
}

}  // namespace palpate::base
