#include <studies/accuracy/command_log.h>

#include <base/split.h>

#include <algorithm>
#include <fstream>

namespace palpate::studies {

std::string lastLine(const std::filesystem::path& log)
{
    constexpr std::size_t longest = 200;
    std::ifstream in(log);
    std::string last;
    for (std::string line; std::getline(in, line);) {
        last = base::trimmed(line).empty() ? last : std::string(base::trimmed(line));
    }
    std::ranges::replace_if(
        last, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
    return last.substr(0, longest);
}

}  // namespace palpate::studies
