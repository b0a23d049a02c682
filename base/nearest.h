#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::base {

/// Letters to add, take away or change to make one word of the other. Source: V. I. Levenshtein 1966.
inline std::size_t editDistance(std::string_view a, std::string_view b)
{
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) {
        row[j] = j;
    }
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
            diagonal = row[j];
            row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row[b.size()];
}

/// The one of `words` that a mistyped word may mean: at most two letters off, and fewer than it has. Empty: none.
inline std::string nearest(std::string_view word, const std::vector<std::string>& words)
{
    constexpr std::size_t maxOff = 2;
    std::string best;
    std::size_t least = std::min(maxOff + 1, word.size());
    for (const std::string& candidate : words) {
        if (const std::size_t off = editDistance(word, candidate); off < least) {
            least = off;
            best = candidate;
        }
    }
    return best;
}

/// "; did you mean X?", for the word that nearest() finds; `otherwise` where there is none.
inline std::string meant(std::string_view word, const std::vector<std::string>& words, const std::string& otherwise = "")
{
    const std::string one = nearest(word, words);
    return one.empty() ? otherwise : "; did you mean " + one + "?";
}

}  // namespace palpate::base
