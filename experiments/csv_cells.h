#pragma once

#include <charconv>
#include <cstddef>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

namespace palpate::experiments {

/// Without the blanks at both ends.
inline std::string_view trimmed(std::string_view text)
{
    const auto first = text.find_first_not_of(" \t\r");
    return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// What stands between the commas of a line, trimmed. They refer to the line's text.
inline std::vector<std::string_view> csvCells(std::string_view line)
{
    std::vector<std::string_view> cells;
    for (std::size_t comma = 0; comma != std::string_view::npos;) {
        comma = line.find(',');
        cells.push_back(trimmed(line.substr(0, comma)));
        line.remove_prefix(comma == std::string_view::npos ? line.size() : comma + 1);
    }
    return cells;
}

/// The number that a cell holds, which may be infinite or NaN; nothing where it holds anything else.
inline std::optional<double> numberIn(std::string_view cell)
{
    double value = 0.0;
    const auto [rest, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    return error == std::errc() && rest == cell.data() + cell.size() ? std::optional(value) : std::nullopt;
}

}  // namespace palpate::experiments
