#pragma once

#include <system_error>

namespace palpate::apps {

/// What a program says of an error that means that no thread can be started; null for any other.
inline const char* noThread(const std::system_error& e) noexcept
{
    return e.code() == std::errc::resource_unavailable_try_again
               ? "no thread can be started (Resource temporarily unavailable): end other programs, or allow more (ulimit "
                 "-u)"
               : nullptr;
}

}  // namespace palpate::apps
