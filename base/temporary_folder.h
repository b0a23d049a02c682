#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>

namespace palpate::base {

/// A folder that goes away at the end.
class TemporaryFolder {
public:
    /// @param what  that is put there, in the message of the std::runtime_error where none can be made
    explicit TemporaryFolder(const std::string& what)
    {
        std::error_code none;
        const std::filesystem::path parent = std::filesystem::temp_directory_path(none);
        if (none) {
            const char* const set = std::getenv("TMPDIR");
            throw std::runtime_error("TMPDIR=" + std::string(set != nullptr ? set : "") + ": there is no such folder for " +
                                     what);
        }
        std::string name = (parent / "palpate-XXXXXX").string();
        if (::mkdtemp(name.data()) == nullptr) {
            throw std::runtime_error(name + ": no folder can be made there for " + what);
        }
        path_ = name;
    }
    ~TemporaryFolder()
    {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    TemporaryFolder& operator=(TemporaryFolder&&) = delete;

    const std::filesystem::path& path() const { return path_; }
    std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

private:
    std::filesystem::path path_;
};

}  // namespace palpate::base
