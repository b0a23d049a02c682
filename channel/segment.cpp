#include <channel/segment.h>

#include <base/error.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

namespace palpate::channel {

std::string segmentName(const std::string& session)
{
    constexpr std::size_t longest = 64;
    const auto allowed = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    };
    base::failIf(session.empty() || session.size() > longest || !std::all_of(session.begin(), session.end(), allowed),
                 "session \"{}\": a name is 1 to 64 letters, digits, '-' and '_'", session.substr(0, longest));
    return "/palpate-" + session;
}

int openSegment(const std::string& name, int access) noexcept
{
    const int file = ::shm_open(name.c_str(), access | O_NONBLOCK, 0);
    if (file < 0)
        return file;
    struct stat status {};
    if (::fstat(file, &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == ::geteuid())
        return file;
    ::close(file);
    errno = EPERM;
    return -1;
}

}  // namespace palpate::channel
