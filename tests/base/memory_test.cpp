#include <base/memory.h>

#include <tests/folder.h>

#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

namespace palpate::base {
namespace {

TEST(Memory, IsSomeOfTheMachines)
{
    const double all = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE));
    EXPECT_GT(availableMemory(), 0.0);
    EXPECT_LT(availableMemory(), all);
}

// A control group with a bound of 8 GB in one without, of which files that were read take most.
TEST(Memory, FilesThatCanBeDroppedAreFree)
{
    const tests::Folder root;
    const auto write = [&](const std::string& name, const std::string& text) {
        std::filesystem::create_directories((root / name).parent_path());
        std::ofstream(root / name) << text;
    };
    EXPECT_EQ(availableMemory(root.path()), std::numeric_limits<double>::infinity()) << "nothing tells";
    write("proc/meminfo", "MemTotal: 64000000 kB\nMemAvailable: 60000000 kB\n");
    EXPECT_EQ(availableMemory(root.path()), 60e6 * 1024);
    write("proc/self/cgroup", "0::/jobs/one\n");
    write("sys/fs/cgroup/jobs/memory.max", "max\n");
    write("sys/fs/cgroup/jobs/memory.current", "9000000000\n");
    write("sys/fs/cgroup/jobs/one/memory.max", "8000000000\n");
    write("sys/fs/cgroup/jobs/one/memory.current", "7900000000\n");
    EXPECT_EQ(availableMemory(root.path()), 0.1e9);
    write("sys/fs/cgroup/jobs/one/memory.stat",
          "anon 900000000\nfile 7000000000\nactive_file 3000000000\ninactive_file "
          "3500000000\nslab_reclaimable 100000000\nslab_unreclaimable 5\n");
    EXPECT_EQ(availableMemory(root.path()), 6.7e9);
    write("sys/fs/cgroup/jobs/one/memory.current", "500000000\n");
    EXPECT_EQ(availableMemory(root.path()), 8e9) << "no more than the bound";
}

}  // namespace
}  // namespace palpate::base
