#include <sweep/lock.h>

#include <base/error.h>
#include <base/process.h>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <ctime>
#include <fstream>
#include <random>
#include <utility>

namespace palpate::sweep {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// What the file says; no object where it says nothing, as in the moment after it was made.
json read(const fs::path& folder)
{
    std::ifstream in(folder / "lock");
    return json::parse(in, nullptr, false);
}

std::string newId()
{
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
}

base::FileLock lockOf(const fs::path& folder)
{
    if (auto lock = base::FileLock::of(folder / "lock")) {
        return std::move(*lock);
    }
    const json other = read(folder);
    const auto word = [&](const char* key) { return other.is_object() ? other.value(key, "?") : "?"; };
    throw base::error("{}: another run works on it (process {} on {}, since {}): wait for it or stop it", folder.string(),
                      other.is_object() ? other.value("process", 0L) : 0L, word("machine"), word("since"));
}

}  // namespace

FolderLock::FolderLock(fs::path folder) : folder_(std::move(folder)), id_(newId()), lock_(lockOf(folder_))
{
    const json own{{"id", id_},
                   {"machine", base::hostName()},
                   {"process", static_cast<long>(getpid())},
                   {"since", fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::localtime(std::time(nullptr)))}};
    lock_.write(own.dump() + "\n");
}

std::string FolderLock::holder(const fs::path& folder)
{
    const json lock = read(folder);
    return lock.is_object() ? lock.value("id", "") : "";
}

void FolderLock::check() const
{
    base::failIf(holder(folder_) != id_, "{}: another run has taken it over: this one ends", folder_.native());
}

}  // namespace palpate::sweep
