#pragma once

#include <fmt/chrono.h>

#include <ctime>
#include <string>

namespace palpate::base {

/// A time as records and profiles have it, in UTC: "2026-11-22T09:14:05Z".
inline std::string utc(std::time_t at = std::time(nullptr))
{
    return fmt::format("{:%FT%TZ}", fmt::gmtime(at));
}

}  // namespace palpate::base
