#include <channel/segment.h>

#include <base/error.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

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

std::uint64_t layoutHash() noexcept
{
    return PALPATE_LAYOUT + sizeof(Header) + sizeof(Scenery) + sizeof(StateBlock) + sizeof(InputBlock) +
           sizeof(DisplacedBlock);
}

base::Descriptor openSegment(const std::string& name, int access) noexcept
{
    base::Descriptor file(::shm_open(name.c_str(), access | O_NONBLOCK, 0));
    const struct stat status = statusOf(file);
    if (file && (!S_ISREG(status.st_mode) || status.st_uid != ::geteuid())) {
        file = base::Descriptor();
        errno = EPERM;
    }
    return file;
}

struct stat statusOf(const base::Descriptor& file) noexcept
{
    struct stat status {};
    if (!file || ::fstat(*file, &status) != 0)
        return {};
    return status;
}

std::vector<std::string> segmentFiles()
{
    std::vector<std::string> found;
    std::error_code failed;
    for (auto i = std::filesystem::directory_iterator(segmentFolder, failed); !failed && i != end(i); i.increment(failed))
        if (i->path().filename().string().starts_with(segmentPrefix))
            found.push_back(i->path().filename());
    std::ranges::sort(found);
    return found;
}

}  // namespace palpate::channel
