#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace palpate::studies {

/// An open file, as a stream of another program; number() is negative where it could not be opened.
class File {
public:
    /// @param flags  of open(2)
    File(const std::filesystem::path& path, int flags) : number_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
    ~File() { ::close(number_); }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    int number() const noexcept { return number_; }

private:
    int number_;
};

/// The last line of a program's log that is not empty, for a message: without control characters, its first 200. "" where
/// there is none.
std::string lastLine(const std::filesystem::path& log);

}  // namespace palpate::studies
