#include <training/folders.h>

#include <base/child_process.h>
#include <base/error.h>
#include <base/user_files.h>

#include <cstdlib>
#include <set>

namespace palpate::training {

namespace fs = std::filesystem;

fs::path installedData()
{
    if (const char* const named = std::getenv("PALPATE_DATA"); named != nullptr && *named != 0) {
        return named;
    }
    return base::programFolder().parent_path() / "share" / "palpate";
}

fs::path userData()
{
    fs::path folder = base::userFolder(base::UserFolder::data);
    base::failIf(folder.empty(), "profiles: neither XDG_DATA_HOME nor HOME says where they are: give --profiles FILE");
    return folder;
}

std::vector<fs::path> dataFolders(const char* kind)
{
    std::vector<fs::path> folders;
    try {
        folders.push_back(userData() / kind);
    } catch (const std::runtime_error&) {
        // A user without a home has those that come along.
    }
    folders.push_back(installedData() / kind);
    return folders;
}

std::vector<fs::path> entriesOf(const char* kind, const std::function<bool(const fs::path&)>& wanted)
{
    std::vector<fs::path> all;
    std::set<std::string> seen;
    for (const fs::path& folder : dataFolders(kind)) {
        std::error_code none;
        for (const auto& entry : fs::directory_iterator(folder, none)) {
            if (wanted(entry.path()) && seen.insert(entry.path().filename().string()).second) {
                all.push_back(entry.path());
            }
        }
    }
    return all;
}

std::string nothingThere(const char* kind)
{
    const char* const named = std::getenv("PALPATE_DATA");
    return (installedData() / kind).string() + ": there are no " + kind + " here: install the package palpate-data" +
           (named != nullptr && *named != 0 ? ", or correct PALPATE_DATA, which names this folder" : "");
}

}  // namespace palpate::training
