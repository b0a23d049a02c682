#include <base/file_lock.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace palpate::base {

namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const char* what, int error)
{
    throw std::runtime_error(file.string() + ": " + what + " (" + std::strerror(error) + ")");
}

// Whether the file that is open still has its name: who lets go removes it.
bool named(int descriptor, const std::filesystem::path& file) noexcept
{
    struct stat open {
    }, there{};
    return ::fstat(descriptor, &open) == 0 && ::stat(file.c_str(), &there) == 0 && open.st_dev == there.st_dev &&
           open.st_ino == there.st_ino;
}

}  // namespace

std::optional<FileLock> FileLock::of(const std::filesystem::path& file)
{
    while (true) {
        Descriptor descriptor(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666));
        if (!descriptor) {
            fail(file, "cannot be made: check the folder and its rights", errno);
        }
        struct flock whole {};
        whole.l_type = F_WRLCK;
        whole.l_whence = SEEK_SET;
        if (::fcntl(*descriptor, F_OFD_SETLK, &whole) != 0) {
            const int error = errno;
            if (error == EAGAIN || error == EACCES) {
                return std::nullopt;
            }
            fail(file, "cannot be locked: choose a folder on a file system with locks", error);
        }
        if (named(*descriptor, file)) {
            return FileLock(file, std::move(descriptor));
        }
    }
}

FileLock::~FileLock()
{
    if (descriptor_ && named(*descriptor_, file_)) {
        ::unlink(file_.c_str());
    }
}

void FileLock::write(std::string_view text) const
{
    const auto size = static_cast<ssize_t>(text.size());
    if (::ftruncate(*descriptor_, 0) != 0 || ::pwrite(*descriptor_, text.data(), text.size(), 0) != size) {
        fail(file_, "cannot be written: check the space on the disk", errno);
    }
}

}  // namespace palpate::base
