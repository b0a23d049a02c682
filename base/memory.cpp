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

double systemMemory(const std::filesystem::path& root)
{
    std::ifstream in(root / "proc/meminfo");
    std::string key, unit;
    for (double kilobytes = 0; in >> key >> kilobytes; std::getline(in, unit)) {
        if (key == "MemAvailable:") {
            return 1024.0 * kilobytes;
        }
    }
    return none;
}

// What a group has used and would give back before its bound is met: files that it has read. Bytes, of the kernel's table
// of its memory.
double reclaimable(const std::filesystem::path& table)
{
    std::ifstream in(table);
    std::string key;
    double sum = 0.0;
    for (double value = 0; in >> key >> value;) {
        const bool counts = key == "inactive_file" || key == "active_file" || key == "slab_reclaimable";
        sum += counts ? value : 0.0;
    }
    return sum;
}

// The second version of control groups: the group and each above it has a bound of its own, "max" where it has none.
double groupMemory(const std::filesystem::path& root)
{
    std::ifstream in(root / "proc/self/cgroup");
    double least = none;
    for (std::string line; std::getline(in, line);) {
        if (!line.starts_with("0::/")) {
            continue;
        }
        const std::filesystem::path all = root / "sys/fs/cgroup";
        for (auto group = all / line.substr(4); group != all && group.has_relative_path(); group = group.parent_path()) {
            const double bound = numberIn(group / "memory.max"), used = numberIn(group / "memory.current");
            const double free = bound - used + reclaimable(group / "memory.stat");
            least = used < none ? std::min(least, std::clamp(free, 0.0, bound)) : least;
        }
    }
    return least;
}

}  // namespace

double availableMemory(const std::filesystem::path& root)
{
    return std::min(systemMemory(root), groupMemory(root));
}

}  // namespace palpate::base
