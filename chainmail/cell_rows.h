#pragma once

#include <volume/geometry.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace palpate::chainmail {

/// Of what lies at some of a grid's places, by z, then y, then x: the first in each row, at y + z * size.y, and behind them
/// the count. Empty where there is nothing.
/// @param place  of one
template <typename T>
std::vector<std::uint32_t> rowsOf(const std::vector<T>& all, Index3 size, Index3 T::*place)
{
    if (all.empty()) {
        return {};
    }
    std::vector<std::uint32_t> rows(static_cast<std::size_t>(size.y) * static_cast<std::size_t>(size.z) + 1, 0);
    for (const T& t : all) {
        ++rows[static_cast<std::size_t>((t.*place).y + (t.*place).z * size.y) + 1];
    }
    std::partial_sum(rows.begin(), rows.end(), rows.begin());
    return rows;
}

/// Those in a row, from `first` to `last` along x.
/// @param rows  of rowsOf()
template <typename T>
std::span<const T> inRow(const std::vector<T>& all, const std::vector<std::uint32_t>& rows, std::size_t row, int first,
                         int last, Index3 T::*place) noexcept
{
    if (rows.empty()) {
        return {};
    }
    const T* begin = all.data() + rows[row];
    const T* end = all.data() + rows[row + 1];
    begin = std::partition_point(begin, end, [&](const T& t) { return (t.*place).x < first; });
    end = std::partition_point(begin, end, [&](const T& t) { return (t.*place).x <= last; });
    return {begin, end};
}

}  // namespace palpate::chainmail
