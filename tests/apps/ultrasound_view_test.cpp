#include <tests/apps/desktop.h>

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <thread>

namespace palpate::apps {
namespace {

namespace fs = std::filesystem;

// A stored picture whose text holds `words`; empty: none.
std::string pictureWith(const fs::path& folder, const std::string& words)
{
    for (const auto& entry : fs::directory_iterator(folder))
        if (entry.path().extension() == ".png" && readText(entry.path()).find(words) != std::string::npos)
            return entry.path();
    return {};
}

// The same moment of a record gives the same file: twice, and from what a stored picture says of itself.
TEST(Ultrasound, ARecordsPictureComesAgainBitForBit)
{
    const Folder folder;
    const auto make = [&](const std::string& name, const std::vector<std::string>& how) {
        std::vector<std::string> words{"export", "--record", threeSeconds(), "-o", folder / name};
        words.insert(words.end(), how.begin(), how.end());
        const Outcome outcome = palpate(words);
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        return readText(folder / name);
    };
    const std::string first = make("a.png", {"--at", "2.5s"});
    EXPECT_EQ(make("b.png", {"--at", "2.5s"}), first);
    EXPECT_EQ(make("c.png", {"--like", folder / "a.png"}), first);
    EXPECT_NE(make("d.png", {"--at", "0.1s"}), first);
    expectRefusal({"export", "--record", threeSeconds(), "-o", folder / "e.png", "--at", "9s"}, "the record runs from");
    expectRefusal({"export", "--record", threeSeconds(), "-o", folder / "e.png", "--like", threeSeconds()},
                  "is no ultrasound image");
    figures({"train", "find-lump", "--model", "spring", "--unpaced", "--no-view", "--seconds", "3", "--record",
             folder / "other.db"});
    expectRefusal({"export", "--record", folder / "other.db", "-o", folder / "e.png", "--like", folder / "a.png"},
                  "is a picture of another body");
    expectRefusal({"export", "--record", threeSeconds(), "-o", folder / "e.nrrd", "--what", "ultrasound", "--at", "1s"},
                  "are written as .png");
}

// Keys turn the console and store a picture; the record gives that picture again, byte by byte.
TEST(Ultrasound, APictureThatAViewerHasStoredIsTheRecords)
{
    if (!built("palpate-view") || !installed("Xvfb") || !installed("xdotool"))
        GTEST_SKIP() << "needs palpate-view, Xvfb and xdotool";
    const Folder folder;
    const Desktop desktop;
    const auto view = desktop.start(
        "palpate-view", {"--replay", threeSeconds(), "--ultrasound", "--images", folder.path(), "--size", "480x400"});
    const std::string window = desktop.window("Palpate");
    ASSERT_NE(window, "");
    desktop.xdotool({"windowfocus", window});
    const auto storeUntil = [&](const std::string& words) {
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(120);
        while (pictureWith(folder.path(), words).empty() && std::chrono::steady_clock::now() < end) {
            desktop.xdotool({"key", "p"});
            std::this_thread::sleep_for(std::chrono::milliseconds(500));
        }
        return pictureWith(folder.path(), words);
    };
    // From the first picture on the console obeys.
    ASSERT_NE(storeUntil("palpate"), "");
    desktop.xdotool({"key", "g", "3", "o"});
    const std::string stored = storeUntil("\"tgc_db\":[0.0,0.0,2.0,");
    ASSERT_NE(stored, "");
    const std::string bytes = readText(stored);
    EXPECT_NE(bytes.find("\"mirrored\":true"), std::string::npos);
    EXPECT_NE(bytes.find("\"gain_db\":2.0"), std::string::npos);
    const Outcome again = palpate({"export", "--record", threeSeconds(), "--like", stored, "-o", folder / "again.png"});
    ASSERT_EQ(again.status, 0) << again.err;
    EXPECT_EQ(readText(folder / "again.png"), bytes);
}

}  // namespace
}  // namespace palpate::apps
