#pragma once

#include <unistd.h>

#include <cstdlib>
#include <sstream>
#include <string>

namespace palpate::tests {

/// Whether a program can be found in PATH.
inline bool installed(const std::string& program)
{
    std::istringstream path(std::getenv("PATH") != nullptr ? std::getenv("PATH") : "");
    for (std::string folder; std::getline(path, folder, ':');)
        if (::access((folder + "/" + program).c_str(), X_OK) == 0)
            return true;
    return false;
}

}  // namespace palpate::tests
