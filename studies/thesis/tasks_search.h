#pragma once

#include <cstdint>
#include <optional>

namespace palpate::studies {

/// The largest size that holds, by doubling and then bisection.
///
/// @param first  where to begin, above 0      @param limit  nothing above is tried
/// @param near   bisection ends once the two sizes are this share apart, or one apart
/// @param holds  bool(std::uint64_t size); once it is false, it is taken to be false for all larger sizes
/// @returns      nothing where not even `first` holds
template <typename Holds>
std::optional<std::uint64_t> largestThatHolds(std::uint64_t first, std::uint64_t limit, double near, Holds&& holds)
{
    if (first > limit || !holds(first)) {
        return std::nullopt;
    }
    std::uint64_t good = first;
    std::uint64_t bad = limit + 1;
    while (good < limit && bad > limit) {
        const std::uint64_t next = good > limit / 2 ? limit : 2 * good;
        (holds(next) ? good : bad) = next;
    }
    while (bad <= limit && bad - good > 1 && static_cast<double>(bad - good) > near * static_cast<double>(good)) {
        const std::uint64_t middle = good + (bad - good) / 2;
        (holds(middle) ? good : bad) = middle;
    }
    return good;
}

}  // namespace palpate::studies
