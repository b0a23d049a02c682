#include <base/inputs.h>

#include <base/error.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

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

std::optional<std::string> contentOf(const std::filesystem::path& file)
{
    try {
        std::ifstream in(file, std::ios::binary);
        std::string bytes{std::istreambuf_iterator<char>(in), {}};
        return in.is_open() ? std::optional(std::move(bytes)) : std::nullopt;
    } catch (const std::ios_base::failure&) {  // of the standard library's buffer, where reading fails
        return std::nullopt;
    }
}

std::vector<std::filesystem::path> filesWith(const std::string& ending, const std::filesystem::path& folder)
{
    std::error_code none;
    std::vector<std::filesystem::path> files;
    std::ranges::copy_if(std::filesystem::directory_iterator(folder, none), std::back_inserter(files),
                         [&](const std::filesystem::path& file) { return file.extension() == ending; });
    std::ranges::sort(files);
    return files;
}

void checkTable(const std::filesystem::path& file, const char* kind)
{
    constexpr std::uintmax_t largest = 16U << 20U;
    const std::string why = whyNoFile(file);
    failIf(!why.empty(), "{}: {}", file.native(), why);
    std::error_code error;
    const auto size = std::filesystem::file_size(file, error);
    failIf(error || size > largest, "{}: over 16 MB, too large for {}: is it a volume?", file.native(), kind);
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
