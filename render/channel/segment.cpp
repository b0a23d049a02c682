#include <render/channel/segment.h>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
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

// Field 22 of /proc/PID/stat (proc(5)). The command's name is in brackets and may hold anything, so count from the last
// one.
std::uint64_t processStart(std::uint64_t pid) noexcept
{
    std::array<char, 64> path{};
    std::snprintf(path.data(), path.size(), "/proc/%llu/stat", static_cast<unsigned long long>(pid));
    const int file = ::open(path.data(), O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return 0;
    std::array<char, 1024> text{};
    const ssize_t length = ::read(file, text.data(), text.size() - 1);
    ::close(file);
    if (length <= 0)
        return 0;
    const char* at = std::strrchr(text.data(), ')');
    if (at == nullptr || at[1] != ' ' || at[2] == 'Z' || at[2] == 'X')
        return 0;
    constexpr int stateField = 3, startField = 22;
    at += 2;
    for (int field = stateField; field < startField; ++field) {
        at = std::strchr(at, ' ');
        if (at == nullptr)
            return 0;
        ++at;
    }
    return std::strtoull(at, nullptr, 10);
}

}  // namespace palpate::channel
