#pragma once

#include <haptics/falcon/transport.h>

#include <fmt/format.h>

#include <utility>

namespace palpate::falcon {

/// Throws that trouble if `wrong`. The values are evaluated in any case.
template <typename... Values>
void troubleIf(bool wrong, Cause cause, fmt::format_string<Values...> what, Values&&... values)
{
    if (wrong) {
        throw Trouble(cause, fmt::format(what, std::forward<Values>(values)...));
    }
}

}  // namespace palpate::falcon
