#pragma once

#include <string>
#include <string_view>

namespace palpate::base {

/// A word as one types it in a shell: in quotes where the shell would read it otherwise (O'Brien, a path with a space).
inline std::string shellWord(std::string_view word)
{
    constexpr std::string_view plain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_./=:,+@";
    if (!word.empty() && word.find_first_not_of(plain) == std::string_view::npos) {
        return std::string(word);
    }
    std::string quoted = "'";
    for (const char c : word) {
        if (c == '\'') {
            quoted += "'\\'";  // out of the quotes, a quote, and in again
        }
        quoted += c;
    }
    quoted += '\'';
    return quoted;
}

}  // namespace palpate::base
