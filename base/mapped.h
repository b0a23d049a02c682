#pragma once

#include <functional>
#include <ranges>
#include <utility>
#include <vector>

namespace palpate::base {

/// What `of` makes of each of `values`, in their order: of is a function or a member, as in
/// `mapped<std::string>(people, &Person::name)`.
template <typename Made, std::ranges::input_range Values, typename Of>
std::vector<Made> mapped(Values&& values, Of&& of)
{
    std::vector<Made> made;
    for (auto&& value : values) {
        made.push_back(static_cast<Made>(std::invoke(of, std::forward<decltype(value)>(value))));
    }
    return made;
}

}  // namespace palpate::base
