#pragma once

#include <functional>
#include <ranges>

namespace palpate::base {

/// `start` and what `of` makes of each of `values`, added up in their order. As with mapped(), of is a function or a
/// member.
template <std::ranges::input_range Values, typename Of, typename Sum = double>
constexpr Sum sumOf(Values&& values, Of&& of, Sum start = Sum(0))
{
    for (auto&& value : values) {
        start += std::invoke(of, value);
    }
    return start;
}

/// The largest of `start` and what `of` makes of each of `values`.
template <std::ranges::input_range Values, typename Of, typename Value = double>
constexpr Value largestOf(Values&& values, Of&& of, Value start = Value(0))
{
    for (auto&& value : values) {
        const Value made = std::invoke(of, value);
        start = start < made ? made : start;
    }
    return start;
}

}  // namespace palpate::base
