#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <base/inputs.h>
#include <render/controls.h>
#include <render/keys.h>

#include <gtest/gtest.h>

#include <set>
#include <sstream>
#include <string>
#include <tuple>

namespace palpate::render {
namespace {

// In each kind of window a key does one thing. Keys that are known by their letter have none of GLFW's codes that mean the
// same (those are ASCII).
TEST(Keys, NoKeyHasTwoMeanings)
{
    std::set<std::tuple<unsigned, int, int, char, bool>> seen;
    for (const Controls::Key& key : Controls::keys) {
        EXPECT_EQ(key.strokes.empty(), key.act == nullptr) << key.shown;
        EXPECT_NE(std::string(key.what), "") << key.shown;
        for (const Controls::Stroke& s : key.strokes) {
            EXPECT_NE(s.key == 0, s.name == 0) << key.shown;
            EXPECT_TRUE(s.key == 0 || s.key >= GLFW_KEY_ESCAPE || s.key == GLFW_KEY_SPACE) << key.shown;
            // What is shown: the body, the ultrasound picture, CT in the place of both.
            for (const unsigned window : {1U, 2U, 4U, 8U})
                for (const int shown : {0, 1, 2})
                    if ((key.windows & window) != 0 && ((key.windows & Controls::ofUltrasound) == 0 || shown == 1) &&
                        ((key.windows & Controls::ofCt) == 0 || shown == 2) &&
                        ((key.windows & Controls::withoutCt) == 0 || shown != 2)) {
                        EXPECT_TRUE(seen.emplace(window, shown, s.key, s.name, s.alt).second)
                            << key.shown << ": " << key.what;
                    }
        }
    }
    EXPECT_GT(seen.size(), 40U);
}

// There a look costs a dose.
TEST(Keys, NoneShowsAnUltrasoundPictureWhereTheSceneHasCt)
{
    for (const Controls::Key& key : Controls::keys) {
        const bool shows = std::string(key.what).find("ultrasound picture") != std::string::npos;
        EXPECT_EQ(shows, (key.windows & Controls::withoutCt) != 0) << key.shown << ": " << key.what;
    }
}

// Layout, cut and opacity are the ways into a body that is closed.
TEST(Keys, NoneOpensABodyThatIsClosedToATrainee)
{
    int guarded = 0;
    for (const Controls::Key& key : Controls::keys) {
        const std::string what = key.what;
        const bool opens =
            what.starts_with("layout") || what.starts_with("cut") || what.find("tissue") != std::string::npos;
        const bool ofSlices = (key.windows & Controls::ofImage) != 0 || (key.windows & Controls::ofCt) != 0;
        const bool isGuarded = (key.windows & (Controls::ofOpenBody | Controls::ofLayouts)) != 0;
        EXPECT_EQ(opens && !ofSlices, isGuarded) << key.shown << ": " << what;
        guarded += isGuarded ? 1 : 0;
    }
    EXPECT_EQ(guarded, 4);
}

// The page has what `palpate-view --keys` prints, and so each key of the list.
TEST(Keys, ThePageHasAllOfThem)
{
    const std::string page = base::contentOf(PALPATE_SOURCE_DIR "/docs/viewer.md").value();
    std::string block, line;
    for (std::istringstream words(keysInWords()); std::getline(words, line);) {
        block += (line.empty() ? "" : "    ") + line + "\n";
    }
    EXPECT_NE(page.find(block), std::string::npos) << "put this into docs/viewer.md:\n" << block;
    for (const Controls::Key& key : Controls::keys) {
        EXPECT_NE(block.find(key.what), std::string::npos) << key.shown;
    }
}

}  // namespace
}  // namespace palpate::render
