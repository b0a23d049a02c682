#include <base/memory.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

namespace palpate::base {

namespace {

constexpr double none = std::numeric_limits<double>::infinity();

// The number that a file begins with; none where there is no such file, or a word ("max").
double numberIn(const std::filesystem::path& file)
{
    std::ifstream in(file);
    double value = none;
    return in >> value ? value : none;
}

double systemMemory()
{
    std::ifstream in("/proc/meminfo");
    std::string key, unit;
    for (double kilobytes = 0; in >> key >> kilobytes; std::getline(in, unit)) {
        if (key == "MemAvailable:") {
            return 1024.0 * kilobytes;
        }
    }
    return none;
}

// The second version of control groups: the group and each above it has a bound of its own, "max" where it has none.
double groupMemory()
{
    std::ifstream in("/proc/self/cgroup");
    double least = none;
    for (std::string line; std::getline(in, line);) {
        if (!line.starts_with("0::/")) {
            continue;
        }
        const std::filesystem::path root = "/sys/fs/cgroup";
        for (auto group = root / line.substr(4); group != root && group.has_relative_path(); group = group.parent_path()) {
            const double bound = numberIn(group / "memory.max"), used = numberIn(group / "memory.current");
            least = used < none ? std::min(least, std::max(0.0, bound - used)) : least;
        }
    }
    return least;
}

}  // namespace

double availableMemory()
{
    return std::min(systemMemory(), groupMemory());
}

}  // namespace palpate::base
