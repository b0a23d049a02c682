#include <base/outputs.h>

#include <base/inputs.h>
#include <tests/folder.h>

#include <gtest/gtest.h>

#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>

namespace palpate::base {
namespace {

namespace fs = std::filesystem;

// A pipe or a device (/dev/null) takes the bytes and stays what it is; put in its place, a file would end it for everybody.
TEST(Outputs, APipeIsWrittenIntoAndStaysAPipe)
{
    const tests::Folder folder;
    const std::string pipe = folder / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    std::string read;
    std::thread reader([&] { read = base::contentOf(pipe).value(); });
    writeWhole(pipe, "a,b\n1,2\n");
    reader.join();
    EXPECT_EQ(read, "a,b\n1,2\n");
    EXPECT_TRUE(fs::is_fifo(pipe));
    EXPECT_THROW(replaceable(pipe), std::runtime_error);
    EXPECT_EQ(std::distance(fs::directory_iterator(fs::path(pipe).parent_path()), {}), 1);
}

// A link stays, and what it leads to is replaced; so is a file, whole.
TEST(Outputs, ALinkStaysALink)
{
    const tests::Folder folder;
    const std::string file = folder / "there.csv", link = folder / "link.csv", fresh = folder / "fresh.csv";
    writeWhole(file, "what was there, and is longer");
    fs::create_symlink(file, link);
    writeWhole(link, "new");
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_EQ(base::contentOf(file).value(), "new");
    EXPECT_EQ(replaceable(link), fs::canonical(file));
    writeWhole(fresh, "first");
    EXPECT_EQ(base::contentOf(fresh).value(), "first");
    EXPECT_EQ(replaceable(fresh), fresh);
    EXPECT_THROW(writeWhole(folder / "none/of.csv", "x"), std::runtime_error);
}

TEST(Outputs, ALinkToItselfIsRefusedAndStays)
{
    const tests::Folder folder;
    const std::string one = folder / "one.json", two = folder / "two.json";
    fs::create_symlink(two, one);
    fs::create_symlink(one, two);
    EXPECT_THROW(checkOutput(one), std::runtime_error);
    EXPECT_THROW(writeWhole(one, "x"), std::runtime_error);
    EXPECT_TRUE(fs::is_symlink(one));
}

// A file is written beside its place and moved there: that it may be written itself is not enough. It is told before the
// work, and not after. Without root's rights, who may write everywhere.
TEST(Outputs, AFileInAFolderThatMayNotBeWrittenIsRefusedAtOnce)
{
    const tests::Folder folder;
    const std::string file = folder / "there.csv";
    writeWhole(file, "x");
    fs::permissions(file, fs::perms::all);
    fs::permissions(folder.path(),
                    fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read | fs::perms::others_exec);
    const auto asNobody = [&] {
        constexpr unsigned nobody = 65534;
        if (::getuid() == 0 && ::setuid(nobody) != 0) {
            std::exit(2);
        }
        try {
            checkOutput(file);
        } catch (const std::runtime_error& e) {
            std::fputs(e.what(), stderr);
            std::exit(1);
        }
        std::exit(0);
    };
    EXPECT_EXIT(asNobody(), ::testing::ExitedWithCode(1), "cannot be written .Permission denied.");
    fs::permissions(folder.path(), fs::perms::owner_all);
    EXPECT_NO_THROW(checkOutput(file));
}

// Also by another path to it, and through a link; a device may be both, and a file that is not there is no file that is
// read.
TEST(Outputs, WhatIsReadIsNotReplacedAndNothingIsWrittenTwice)
{
    const tests::Folder folder;
    const std::string file = folder / "poses.csv", link = folder / "link.csv", round = folder / "./poses.csv";
    writeWhole(file, "x_mm\n1\n");
    fs::create_symlink(file, link);
    for (const std::string& name : {file, link, round}) {
        EXPECT_THROW(checkOutputs({"", name}, {"block", file}), std::runtime_error) << name;
        EXPECT_THROW(checkOutputs({file, name}, {}), std::runtime_error) << name;
    }
    const std::string fresh = folder / "fresh.json";
    EXPECT_THROW(checkOutputs({fresh, folder / "./fresh.json"}, {}), std::runtime_error);
    EXPECT_NO_THROW(checkOutputs({fresh, file, "", ""}, {fresh, "", "-"}));
    EXPECT_NO_THROW(checkOutputs({"-", "-", "/dev/null", "/dev/null"}, {"-", "/dev/null"}));
}

}  // namespace
}  // namespace palpate::base
