#include <base/inputs.h>

#include <system_error>

namespace palpate::base {

std::string whyNoFile(const std::filesystem::path& file)
{
    std::error_code error;
    switch (std::filesystem::status(file, error).type()) {
        case std::filesystem::file_type::regular:
            return "";
        case std::filesystem::file_type::directory:
            return "is a folder, not a file: name a file in it";
        case std::filesystem::file_type::fifo:
            return "is a named pipe, not a file: save what comes out of it as a file";
        case std::filesystem::file_type::socket:
            return "is a socket, not a file: name a file";
        case std::filesystem::file_type::character:
        case std::filesystem::file_type::block:
            return "is a device, not a file: name a file";
        default:
            break;
    }
    if (error == std::errc::too_many_symbolic_link_levels) {
        return "is a symbolic link that leads back to itself: name the file itself";
    }
    if (error == std::errc::permission_denied) {
        return "cannot be reached: check the permissions of its folder";
    }
    return std::filesystem::is_symlink(std::filesystem::symlink_status(file, error))
               ? "is a symbolic link to a file that is not there: check where it leads"
               : "there is no such file: check the name";
}

std::string inWords(const std::filesystem::filesystem_error& error)
{
    if (error.path1().empty()) {
        return error.code().message();
    }
    const bool loop = error.code() == std::errc::too_many_symbolic_link_levels;
    return error.path1().string() + ": " + (loop ? whyNoFile(error.path1()) : error.code().message());
}

}  // namespace palpate::base
