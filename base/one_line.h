#pragma once

#include <fmt/format.h>

#include <string>
#include <string_view>

namespace palpate::base {

/// A text that has names of others in it, for one line of a terminal: control characters as in C, "a\\nb" and "\\x1b".
inline std::string oneLine(std::string_view text)
{
    std::string line;
    for (const char c : text) {
        const auto code = static_cast<unsigned char>(c);
        if (c == '\n' || c == '\t' || c == '\r') {
            line += c == '\n' ? "\\n" : c == '\t' ? "\\t" : "\\r";
        } else if (code < 0x20 || code == 0x7f) {
            line += fmt::format("\\x{:02x}", code);
        } else {
            line += c;
        }
    }
    return line;
}

}  // namespace palpate::base
