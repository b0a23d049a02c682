#pragma once

#include <base/error.h>
#include <training/folders.h>

#include <fmt/format.h>

#include <string>
#include <vector>

namespace palpate::apps {

/// What training::allCases() or allCurricula() finds, with a warning for each that it refuses. Throws std::runtime_error
/// where there is none.
template <typename All>
auto listed(const char* kind, const All& allOf)
{
    std::vector<std::string> faults;
    auto all = allOf(&faults);
    for (const std::string& fault : faults) {
        fmt::print(stderr, "palpate: warning: {}\n", fault);
    }
    base::failIf(all.empty(), "{}", training::nothingThere(kind));
    return all;
}

}  // namespace palpate::apps
