#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <utility>

namespace palpate::base {

/// The name of a tissue or a structure as people say it: "idc_high_grade" is a "high-grade carcinoma"; of other names the
/// underscores become blanks.
inline std::string spoken(std::string_view name)
{
    constexpr std::array<std::pair<std::string_view, std::string_view>, 6> known{
        {{"idc_high_grade", "high-grade carcinoma"},
         {"idc_low_grade", "low-grade carcinoma"},
         {"ilc", "lobular carcinoma"},
         {"dcis", "carcinoma in situ (DCIS)"},
         {"tdlu", "milk gland lobule"},
         {"fibrocystic", "fibrocystic change"}}};
    for (const auto& [key, words] : known) {
        if (name == key) {
            return std::string(words);
        }
    }
    std::string words(name);
    std::replace(words.begin(), words.end(), '_', ' ');
    return words;
}

}  // namespace palpate::base
