#include <channel/segment.h>

#include <algorithm>
#include <stdexcept>

namespace palpate::channel {

std::string segmentName(const std::string& session)
{
    constexpr std::size_t longest = 64;
    const auto allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    };
    if (session.empty() || session.size() > longest || !std::all_of(session.begin(), session.end(), allowed))
        throw std::runtime_error("session \"" + session.substr(0, longest) +
                                 "\": a name is 1 to 64 letters, digits, '-' and '_'");
    return "/palpate-" + session;
}

}  // namespace palpate::channel
