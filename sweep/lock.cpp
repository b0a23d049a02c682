#include <sweep/lock.h>

#include <base/process.h>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <fstream>
#include <random>
#include <stdexcept>
#include <system_error>

namespace palpate::sweep {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr auto beatEvery = std::chrono::seconds(5);
constexpr double deadAfter = 60.0;  // without a beat [s]
constexpr int attempts = 5;

std::string textOf(const fs::path& file)
{
    std::ifstream in(file);
    std::string line;
    std::getline(in, line);
    return line;
}

// Since the machine started [clock ticks]; empty: there is no such process.
std::string startOf(long pid)
{
    const std::uint64_t start = base::processStart(static_cast<std::uint64_t>(pid));
    return start == 0 ? "" : std::to_string(start);
}

// Where process numbers mean something: this boot of this machine, and in it this container.
std::string placeOfNumbers()
{
    std::error_code none;
    return textOf("/proc/sys/kernel/random/boot_id") + " " + fs::read_symlink("/proc/self/ns/pid", none).string();
}

double modified(const fs::path& file)
{
    struct stat s {};
    return stat(file.c_str(), &s) == 0
               ? static_cast<double>(s.st_mtim.tv_sec) + 1e-9 * static_cast<double>(s.st_mtim.tv_nsec)
               : 0.0;
}

// `fresh`: a file that was written just now, for the folder's own clock.
bool isDead(const json& lock, const fs::path& file, const fs::path& fresh)
{
    if (!lock.is_object()) {
        return modified(fresh) - modified(file) > deadAfter;
    }
    if (lock.value("place", "") == placeOfNumbers()) {
        return startOf(lock.value("process", 0L)) != lock.value("start", "");
    }
    return modified(fresh) - modified(file) > deadAfter;
}

// Takes the dead lock away, unless another run has just put its own in the place.
void remove(const fs::path& file, const json& dead, const std::string& id)
{
    fs::path aside = file;
    aside += "." + id + ".dead";
    if (::rename(file.c_str(), aside.c_str()) != 0) {
        return;
    }
    if (json::parse(textOf(aside), nullptr, false) != dead) {
        [[maybe_unused]] const int back = ::link(aside.c_str(), file.c_str());
    }
    ::unlink(aside.c_str());
}

std::string newId()
{
    std::random_device random;
    return fmt::format("{:08x}{:08x}", random(), random());
}

}  // namespace

std::string machineName()
{
    std::array<char, 256> name{};
    gethostname(name.data(), name.size() - 1);
    return name.data();
}

FolderLock::FolderLock(fs::path folder) : folder_(std::move(folder)), file_(folder_ / "lock"), id_(newId())
{
    const fs::path mine = folder_ / fmt::format("lock.{}", id_);
    const json own{{"id", id_},
                   {"machine", machineName()},
                   {"process", static_cast<long>(getpid())},
                   {"start", startOf(getpid())},
                   {"place", placeOfNumbers()},
                   {"since", fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::localtime(std::time(nullptr)))}};
    std::ofstream out(mine);
    out << own.dump() << std::endl;
    if (!out) {
        throw std::runtime_error(
            fmt::format("{}: cannot be written: check the folder and the space on the disk", mine.string()));
    }
    out.close();
    json other;
    for (int i = 0; i < attempts; ++i) {
        if (::link(mine.c_str(), file_.c_str()) == 0) {
            ::unlink(mine.c_str());
            beaten_ = std::chrono::steady_clock::now();
            return;
        }
        other = json::parse(textOf(file_), nullptr, false);
        if (fs::exists(file_) && !isDead(other, file_, mine)) {
            break;
        }
        remove(file_, other, id_);
    }
    ::unlink(mine.c_str());
    const auto word = [&](const char* key) { return other.is_object() ? other.value(key, "?") : "?"; };
    throw std::runtime_error(fmt::format("{}: another run works on it (process {} on {}, since {}): wait for it or stop it",
                                         folder_.string(), other.is_object() ? other.value("process", 0L) : 0L,
                                         word("machine"), word("since")));
}

FolderLock::~FolderLock()
{
    if (holder(folder_) == id_) {
        ::unlink(file_.c_str());
    }
}

std::string FolderLock::holder(const fs::path& folder)
{
    const json lock = json::parse(textOf(folder / "lock"), nullptr, false);
    return lock.is_object() ? lock.value("id", "") : "";
}

void FolderLock::beat()
{
    const auto now = std::chrono::steady_clock::now();
    if (now - beaten_ < beatEvery) {
        return;
    }
    beaten_ = now;
    if (holder(folder_) != id_) {
        throw std::runtime_error(folder_.string() + ": another run has taken it over: this one ends");
    }
    ::utimensat(AT_FDCWD, file_.c_str(), nullptr, 0);
}

}  // namespace palpate::sweep
