#include <base/room.h>

#include <fcntl.h>

#include <cerrno>

namespace palpate::base {

Descriptor keepRoom(const std::filesystem::path& folder, std::size_t bytes)
{
    Descriptor file(::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
    if (file) {
        errno = ::posix_fallocate(*file, 0, static_cast<off_t>(bytes));
    }
    return file && errno == 0 ? std::move(file) : Descriptor();
}

bool hasRoom(const std::filesystem::path& folder, std::size_t bytes)
{
    return keepRoom(folder, bytes) || (errno != ENOSPC && errno != EDQUOT && errno != EFBIG);
}

}  // namespace palpate::base
