#pragma once

#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

namespace palpate::training {

/// Where data that come along lie: share/palpate beside the program's folder, or the folder that PALPATE_DATA names.
std::filesystem::path installedData();

/// base::UserFolder::data.
/// Throws std::runtime_error where neither XDG_DATA_HOME nor HOME is set.
std::filesystem::path userData();

/// Folders in which things of a kind ("cases", "curricula") are looked for: the user's, then those that come along.
std::vector<std::filesystem::path> dataFolders(const char* kind);

/// What lies in these folders and is wanted, one of each name: the user's hides one of the same name that came along.
std::vector<std::filesystem::path> entriesOf(const char* kind,
                                             const std::function<bool(const std::filesystem::path&)>& wanted);

/// What `load` makes of each of them. Those that it refuses are left out, and `faults`, where it is not null, has why.
template <class Made, class Load>
std::vector<Made> loadedOf(const char* kind, const std::function<bool(const std::filesystem::path&)>& wanted,
                           const Load& load, std::vector<std::string>* faults)
{
    std::vector<Made> all;
    for (const std::filesystem::path& entry : entriesOf(kind, wanted)) {
        try {
            all.push_back(load(entry));
        } catch (const std::runtime_error& e) {
            if (faults != nullptr) {
                faults->emplace_back(e.what());
            }
        }
    }
    return all;
}

/// What to say where a list of them is empty: where was looked, and which package has them.
std::string nothingThere(const char* kind);

}  // namespace palpate::training
