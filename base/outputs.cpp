#include <base/error.h>
#include <base/inputs.h>
#include <base/outputs.h>

#include <fmt/format.h>

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace palpate::base {

namespace fs = std::filesystem;

namespace {

// A link that leads back to itself would be replaced by the file.
void refuseCircle(const fs::path& file)
{
    std::error_code failed;
    static_cast<void>(fs::status(file, failed));
    if (failed == std::errc::too_many_symbolic_link_levels) {
        throw std::runtime_error(file.string() + ": " + whyNoFile(file));
    }
}

// Whether both names lead to one file. Not for what takes bytes from everybody: a device, standard output.
bool areOneFile(const fs::path& a, const fs::path& b)
{
    if (a.empty() || b.empty() || a == "-" || b == "-") {
        return false;
    }
    std::error_code none;
    if (fs::exists(a, none) && fs::exists(b, none)) {
        return fs::is_regular_file(a, none) && fs::equivalent(a, b, none);
    }
    const fs::path there = fs::weakly_canonical(fs::absolute(a), none);
    return !fs::exists(a, none) && there == fs::weakly_canonical(fs::absolute(b), none);
}

// A device or a pipe: it takes what is written and is no place for another file.
bool takesBytes(const fs::path& file)
{
    std::error_code none;
    const fs::file_status status = fs::status(file, none);
    return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

}  // namespace

void checkOutput(const fs::path& file)
{
    if (file.empty() || file == "-") {
        return;
    }
    refuseCircle(file);
    std::error_code none;
    base::failIf(fs::is_directory(file, none) || !file.has_filename(), "{}: is a folder: give the name of a file",
                 file.native());
    const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
    base::failIf(!fs::is_directory(folder, none), "{}: cannot be written: there is no folder {}: make it first",
                 file.native(), folder.native());
    const auto mayWrite = [&](const fs::path& place, int how) {
        if (access(place.c_str(), how) != 0) {
            throw base::error("{}: cannot be written ({}): choose another place", file.string(), std::strerror(errno));
        }
    };
    if (fs::exists(file, none)) {
        mayWrite(file, W_OK);
    }
    if (!takesBytes(file)) {
        // It is written beside its place and moved there, see writeWhole().
        const fs::path place = replaceable(file);
        mayWrite(place.has_parent_path() ? place.parent_path() : ".", W_OK | X_OK);
    }
}

void checkNames(const std::vector<fs::path>& outputs)
{
    base::failIf(std::ranges::find(outputs, fs::path("-")) != outputs.end(),
                 "-: this output goes to a file: give its name (./- for one that is called so)");
}

void checkOutputs(const std::vector<fs::path>& outputs, const std::vector<fs::path>& inputs)
{
    for (auto file = outputs.begin(); file != outputs.end(); ++file) {
        checkOutput(*file);
        const auto same = [&](const fs::path& other) { return areOneFile(*file, other); };
        std::error_code none;
        base::failIf(fs::exists(*file, none) && std::ranges::any_of(inputs, same),
                     "{}: is a file that is read, and would be replaced: choose another name", file->native());
        base::failIf(std::any_of(outputs.begin(), file, same),
                     "{}: would be written twice: give each file a name of its own", file->native());
    }
}

void checkOutputFolder(const fs::path& folder)
{
    if (folder.empty()) {
        return;
    }
    std::error_code none;
    fs::path there = fs::absolute(folder);
    while (!fs::exists(there, none) && there != there.root_path()) {
        there = there.parent_path();
    }
    base::failIf(!fs::is_directory(there, none), "{}: cannot be made: {} is no folder", folder.native(), there.native());
    if (access(there.c_str(), W_OK) != 0) {
        throw base::error("{}: cannot be written ({}): choose another place", folder.native(), std::strerror(errno));
    }
}

bool makeFolders(const fs::path& folder)
{
    std::error_code failed;
    const bool made = fs::create_directories(folder, failed);
    base::failIf(static_cast<bool>(failed), "{}: this folder cannot be made ({}): choose another place", folder.native(),
                 failed.message());
    return made;
}

fs::path replaceable(const fs::path& file)
{
    base::failIf(takesBytes(file), "{}: is no file: give the name of a file", file.native());
    refuseCircle(file);
    std::error_code none;
    const fs::path target = fs::is_symlink(file, none) ? fs::weakly_canonical(file, none) : file;
    return target.empty() ? file : target;
}

void writeWhole(const fs::path& file, std::string_view bytes)
{
    const bool direct = takesBytes(file);
    const fs::path place = direct ? file : replaceable(file);
    fs::path half = place;
    half += direct ? "" : fmt::format(".{}.part", getpid());  // another process may write the same file
    std::ofstream out(half, std::ios::binary);
    out << bytes;
    out.close();
    std::error_code failed;
    if (out && !direct) {
        fs::rename(half, place, failed);
    }
    if (!out || failed) {
        std::error_code ignored;
        if (!direct) {
            fs::remove(half, ignored);
        }
        throw std::runtime_error(file.string() + ": cannot be written: check the folder and the space on the disk");
    }
}

}  // namespace palpate::base
