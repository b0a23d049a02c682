#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

namespace palpate::base {

/// The error that refuses a file, an option or a scene: `throw base::error("{}: there is no such scene", name)`.
template <typename... Values>
std::runtime_error error(fmt::format_string<Values...> message, Values&&... values)
{
    return std::runtime_error(fmt::format(message, std::forward<Values>(values)...));
}

/// Throws that error if `wrong`. The values are evaluated in any case, and maybe first: name only such as can be.
template <typename... Values>
void failIf(bool wrong, fmt::format_string<Values...> message, Values&&... values)
{
    if (wrong) {
        throw error(message, std::forward<Values>(values)...);
    }
}

}  // namespace palpate::base
