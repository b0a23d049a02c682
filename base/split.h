#pragma once

#include <charconv>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace palpate::base {

/// Without the blanks at both ends.
inline std::string_view trimmed(std::string_view text)
{
    const auto first = text.find_first_not_of(" \t\r");
    return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// What stands between the characters `at`, of which there is one less. The parts refer to the text.
inline std::vector<std::string_view> splitAt(char at, std::string_view text)
{
    std::vector<std::string_view> parts;
    for (std::size_t end = 0; end != std::string_view::npos;) {
        end = text.find(at);
        parts.push_back(text.substr(0, end));
        text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    }
    return parts;
}

/// The cells of a line, trimmed. They refer to the line's text.
inline std::vector<std::string_view> csvCells(std::string_view line)
{
    std::vector<std::string_view> cells = splitAt(',', line);
    for (std::string_view& cell : cells) {
        cell = trimmed(cell);
    }
    return cells;
}

/// A text in quotes, as a cell of a CSV file (RFC 4180).
inline std::string csvQuoted(std::string_view text)
{
    std::string out = "\"";
    for (const char c : text) {
        out += c == '"' ? "\"\"" : std::string(1, c);
    }
    return out + '"';
}

/// The same, in quotes only where the text needs them.
inline std::string csvCell(const std::string& text)
{
    return text.find_first_of(",\"\r\n") == std::string::npos ? text : csvQuoted(text);
}

/// Without the '+' before a plain number, which std::from_chars() does not take: "0" for "+0", and "+-0" for "+-0".
inline std::string_view withoutPlus(std::string_view text)
{
    const bool signedNumber = text.size() > 1 && text[0] == '+' && ((text[1] >= '0' && text[1] <= '9') || text[1] == '.');
    return signedNumber ? text.substr(1) : text;
}

/// The number that a cell holds, which may be infinite or NaN; nothing where it holds anything else.
template <typename Number = double>
std::optional<Number> numberIn(std::string_view cell)
{
    cell = withoutPlus(cell);
    Number value = 0;
    const auto [rest, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    return error == std::errc() && rest == cell.data() + cell.size() ? std::optional(value) : std::nullopt;
}

}  // namespace palpate::base
