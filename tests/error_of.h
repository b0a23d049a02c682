#pragma once

#include <stdexcept>
#include <string>

namespace palpate::tests {

/// What the std::runtime_error says that `action` throws; "" when it throws none.
inline std::string errorOf(const auto& action)
{
    try {
        action();
        return "";
    } catch (const std::runtime_error& e) {
        return e.what();
    }
}

}  // namespace palpate::tests
