#pragma once

#include <cstdlib>
#include <string>

namespace palpate::tests {

/// How many copies a test mutates: `usual` as ctest runs it, and PALPATE_FUZZ where that says more.
inline int fuzzCount(int usual)
{
    const char* asked = std::getenv("PALPATE_FUZZ");
    return asked != nullptr ? std::stoi(asked) : usual;
}

}  // namespace palpate::tests
