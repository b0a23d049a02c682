#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace palpate::base {

/// "1 session", "3 sessions".
inline std::string counted(std::size_t count, std::string_view what)
{
    return std::to_string(count) + ' ' + std::string(what) + (count == 1 ? "" : "s");
}

}  // namespace palpate::base
