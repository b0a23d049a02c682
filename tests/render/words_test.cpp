#include <base/words.h>
#include <render/result_file.h>
#include <tests/folder.h>
#include <tests/render/studio.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <regex>
#include <utility>

namespace palpate::render {
namespace {

// One window for its tests, as it is slow to make, and a coarse body, as it is made anew for each picture.
class WordsTest : public testing::Test {
protected:
    static void SetUpTestSuite() { studio = std::make_unique<Studio>(52); }
    static void TearDownTestSuite() { studio.reset(); }

    static std::unique_ptr<Studio> studio;
};
std::unique_ptr<Studio> WordsTest::studio;

void expectApart(const std::vector<Written>& all, int wide, int high, const std::string& name)
{
    for (std::size_t a = 0; a < all.size(); ++a) {
        const Written& p = all[a];
        EXPECT_TRUE(p.low[0] >= 0 && p.high[0] <= wide + 1 && p.low[1] >= 0 && p.high[1] <= high)
            << name << ": '" << p.words << "' is cut off";
        for (std::size_t b = 0; b < a; ++b) {
            const Written& q = all[b];
            const bool shadow = q.words == p.words && std::abs(q.low[0] - p.low[0]) < 2;
            EXPECT_TRUE(shadow || p.high[0] <= q.low[0] + 1 || q.high[0] <= p.low[0] + 1 || p.high[1] <= q.low[1] + 1 ||
                        q.high[1] <= p.low[1] + 1)
                << name << ": '" << p.words << "' lies on '" << q.words << "'";
        }
    }
}

// All keys of the ultrasound window, in German the longest, can be read in a small one.
TEST_F(WordsTest, AllKeysCanBeReadInASmallWindow)
{
    Picture& picture = studio->picture();
    std::vector<KeyHelp> keys(46, {"Alt rechts links", "ihn um 1 mm quer bewegen; mit Umschalt um 2 Grad drehen"});
    for (std::size_t i = 0; i < keys.size(); ++i)
        keys[i].what = std::to_string(i) + " " + (i % 2 == 0 ? keys[i].what : "Ultraschallbild, Körper");
    picture.setHelp(keys);
    for (const auto& [wide, high] : {std::pair{640, 480}, {1280, 800}}) {
        const std::string name = "help-" + std::to_string(wide);
        studio->resize(wide, high);
        studio->take(0.05, Layout::trainee, true, name);
        const std::vector<Written> all = picture.written();
        expectApart(all, wide, high, name);
        const auto named = [](const Written& w) { return w.words == "Alt rechts links"; };
        EXPECT_EQ(std::count_if(all.begin(), all.end(), named), 46) << name;
        const auto row = std::find_if(all.begin(), all.end(), named);
        EXPECT_GE(row->high[1] - row->low[1], 8) << name;
    }
    picture.setHelp({});
    studio->resize(width, height);
}

// The list lies below caption and warning and on no other words: neither on the title of the instructor's small body nor on
// what a picture before it has left in parts of the window that nothing else draws.
TEST_F(WordsTest, TheListOfKeysLiesOnNoOtherWords)
{
    Picture& picture = studio->picture();
    picture.setCaption("hold the left button, or press Enter, to take the tool   (? lists the keys)");
    std::vector<KeyHelp> keys(
        26, {"Page down, up", "push it in by 1 mm along itself, pull it out; with Ctrl into the picture"});
    for (std::size_t i = 0; i < keys.size(); ++i)
        keys[i].what = std::to_string(i) + " " + keys[i].what;
    constexpr std::array<std::pair<int, int>, 4> sizes{{{320, 320}, {480, 360}, {640, 480}, {1280, 960}}};
    for (const auto& [wide, high] : sizes)
        for (const auto& [layout, layoutName] : layouts) {
            const std::string name = "keys-" + std::to_string(wide) + "x" + std::to_string(high) + "-" + layoutName;
            studio->resize(wide, high);
            const auto listedAfter = [&](Layout before) {
                picture.setHelp({});
                studio->take(2.9, before, true);
                picture.setHelp(keys);
                return studio->take(2.9, layout, true, name);
            };
            const Image one = listedAfter(Layout::trainee);
            expectApart(picture.written(), wide, high, name);
            const Image other = listedAfter(Layout::instructor);
            EXPECT_EQ(one.differing(other, {0, 0, wide, high}), 0) << name << ": what was before is seen";
        }
    picture.setHelp({});
    picture.setCaption("");
    studio->resize(width, height);
}

// The tool stays live below the list: what to do and what is wrong can be read above it.
TEST_F(WordsTest, TheListOfKeysLeavesTheStepInSight)
{
    Picture& picture = studio->picture();
    picture.setHelp({{"?", "shows the keys"}, {"L", "changes the layout"}});
    picture.setSteps(true, true);
    studio->resize(1280, 960);
    studio->take(0.05, Layout::trainee, true);
    const auto listed = picture.written();
    EXPECT_TRUE(std::ranges::any_of(listed, [](const Written& w) { return w.words.starts_with("1/5  "); }));
    picture.setHelp({});
    picture.setSteps(false, false);
    studio->resize(width, height);
}

// A record has stopped or runs, also while the keys are listed.
TEST_F(WordsTest, TheListOfKeysLeavesTheCaptionOfARecordInSight)
{
    Picture& picture = studio->picture();
    picture.setHelp({{"?", "shows the keys"}, {"L", "changes the layout"}});
    picture.setSteps(true, true);
    picture.setTimeline(0.5);
    picture.setCaption("PAUSED   1.000 of 2.0 s");
    for (const auto& [wide, high] : {std::pair{640, 480}, {1280, 960}}) {
        studio->resize(wide, high);
        for (const double t : {0.05, 1.5, 2.9}) {
            studio->take(t, Layout::trainee, true);
            EXPECT_GT(std::ranges::count(picture.written(), "PAUSED   1.000 of 2.0 s", &Written::words), 0)
                << wide << ", " << t;
        }
    }
    picture.setHelp({});
    picture.setSteps(false, false);
    picture.setTimeline(-1);
    picture.setCaption("");
    studio->resize(width, height);
}

// A record that stands still is behind nothing, and one that a crash has cut off has not counted its ticks.
TEST_F(WordsTest, OfHealthAreOnlyWhatIsKnown)
{
    Picture& picture = studio->picture();
    studio->take(1.0, Layout::trainee, true);
    channel::State state = storyState(studio->scenery, 1.0);
    state.missed = channel::notCounted;
    for (const auto& [delay, words] : {std::pair{0.02, "30 frames/s, 20 ms behind"}, {0.0, "30 frames/s"}}) {
        picture.update(state, nullptr, {30, delay, 1000});
        picture.render(Quality::still);
        EXPECT_GT(std::ranges::count(picture.written(), words, &Written::words), 0) << words;
    }
}

// Scale, console and the mark of the probe's side, with caption and step above them.
TEST_F(WordsTest, OfAnUltrasoundPictureLieOnNothingElse)
{
    Picture& picture = studio->picture();
    picture.setCaption("hold the left button, or press Enter, to take the tool   (? lists the keys)");
    picture.setSteps(true, true);
    picture.showUltrasound(true);
    constexpr std::array<std::pair<int, int>, 4> sizes{{{320, 320}, {480, 360}, {640, 480}, {1280, 960}}};
    for (const auto& [wide, high] : sizes)
        for (const auto& [layout, layoutName] : layouts) {
            const std::string name = "scan-" + std::to_string(wide) + "x" + std::to_string(high) + "-" + layoutName;
            studio->resize(wide, high);
            studio->take(1.0, layout, true, name);  // there is no warning yet
            const std::vector<Written> all = picture.written();
            expectApart(all, wide, high, name);
            const bool marked = layout == Layout::instructor || wide == 320 ||
                                std::ranges::count(all, std::string("P"), &Written::words) == 1;
            EXPECT_TRUE(marked) << name << ": the probe's side is hidden";
        }
    picture.showUltrasound(false);
    picture.setCaption("");
    picture.setSteps(false, false);
    studio->resize(width, height);
}

// A frozen picture has the line of the needle that is in it, while the needle goes on. Before there is a picture there is
// nothing to freeze.
TEST_F(WordsTest, AFrozenUltrasoundPictureKeepsTheLineOfItsNeedle)
{
    Picture& picture = studio->picture();
    picture.showUltrasound(true);
    picture.open(studio->scenery, studio->labels, "story");
    picture.showUltrasound(true);
    picture.ultrasound().toggleFreeze();
    EXPECT_FALSE(picture.ultrasound().frozen());
    const auto line = [](const Image& image) {
        std::vector<std::pair<int, int>> out;
        for (int y = 0; y < image.high; ++y)
            for (int x = 0; x < image.wide; ++x)
                if (near(image.at(x, y), {77, 242, 102}, 30))
                    out.emplace_back(x, y);
        return out;
    };
    const auto at = [&](double t) {
        picture.update(storyState(studio->scenery, t), nullptr, {30, 0.02, 1000});
        picture.render(Quality::still);
        return line(studio->grab("guide"));
    };
    studio->take(2.2, Layout::trainee, true);
    picture.showUltrasound(true);
    const auto first = at(2.2), later = at(3.3);
    EXPECT_GT(first.size(), 20U);
    EXPECT_NE(later, first);
    at(2.2);
    picture.ultrasound().toggleFreeze();
    ASSERT_TRUE(picture.ultrasound().frozen());
    EXPECT_EQ(at(3.3), first);
    picture.ultrasound().toggleFreeze();
    picture.showUltrasound(false);
}

// In every window and with everything that there may be to say: words lie inside the window and on no other words.
TEST_F(WordsTest, LieInTheWindowAndNotOnEachOther)
{
    Picture& picture = studio->picture();
    picture.setCaption("hold the left button, or press Enter, to take the tool   (? lists the keys)");
    picture.setSteps(true, true);
    constexpr std::array<std::pair<int, int>, 5> sizes{{{320, 320}, {420, 700}, {700, 320}, {500, 400}, {1280, 960}}};
    for (const auto& [wide, high] : sizes)
        for (const auto& [layout, layoutName] : layouts)
            for (const double scale : {1.0, 2.0}) {
                const std::string name = std::to_string(wide) + "x" + std::to_string(high) + "-" + layoutName + "-" +
                                         std::to_string(static_cast<int>(scale));
                studio->resize(wide, high);
                picture.setDisplayScale(scale);
                studio->take(2.9, layout, true, "words-" + name);
                const std::vector<Written>& all = picture.written();
                EXPECT_GT(all.size(), 12U) << name;
                expectApart(all, wide, high, name);
            }
    picture.setCaption("");
    picture.setSteps(false, false);
    picture.setDisplayScale(1);
    studio->resize(width, height);
}

// The scene's name is for files: who trains a case reads what that is called.
TEST_F(WordsTest, TheHeadingIsTheTitleThatIsGivenElseTheNameOfTheScene)
{
    Picture& picture = studio->picture();
    const auto heads = [&](const std::string& words) {
        return std::ranges::count(picture.written(), words, &Written::words);
    };
    picture.setTitle("Stanzbiopsie");
    studio->take(1.0, Layout::trainee, true);
    EXPECT_GT(heads("Stanzbiopsie"), 0);
    EXPECT_EQ(heads("test body"), 0);
    picture.setTitle("");
    studio->take(1.0, Layout::trainee, true);
    EXPECT_GT(heads("test body"), 0);
}

// Of figures, slices and axes of traces.
TEST_F(WordsTest, NoNumberHasADecimalPointInGerman)
{
    base::useLanguage("de");
    const std::regex point("[0-9]\\.[0-9]");
    bool comma = false;
    for (const auto& [layout, name] : layouts) {
        studio->take(1.0, layout, true);
        for (const Written& w : studio->picture().written()) {
            EXPECT_FALSE(std::regex_search(w.words, point)) << name << ": " << w.words;
            comma = comma || w.words == "2,5";
        }
    }
    base::useLanguage("en");
    EXPECT_TRUE(comma) << "the axis of the force";
}

// A body that is guided by CT, before the first scan.
Picture& guidedByCt(Studio& studio)
{
    channel::Scenery scenery = studio.scenery;
    scenery.ctSlices = 3;
    scenery.ctWidth = 5e-3;
    scenery.ctDoseIndex = 5;
    scenery.ctDoseLength = 7.5;
    studio.picture().open(scenery, studio.labels, "ct");
    return studio.picture();
}

bool writes(const Picture& picture, const std::string& words)
{
    return std::ranges::any_of(picture.written(), [&](const Written& w) { return w.words.starts_with(words); });
}

// Who holds no tool is not told of a key that does nothing.
TEST_F(WordsTest, BeforeTheFirstScanTheHandIsToldOfItsKeyAndNobodyElse)
{
    Picture& picture = guidedByCt(*studio);
    const channel::State state = storyState(studio->scenery, 0.1);
    for (const bool handIsHere : {true, false}) {
        picture.setSteps(false, handIsHere);
        picture.update(state, nullptr, {});
        picture.render(Quality::still);
        EXPECT_EQ(writes(picture, "P takes a CT scan"), handIsHere);
        EXPECT_EQ(writes(picture, "no CT scan yet"), !handIsHere);
    }
    picture.setSteps(false, false);
}

// A scan takes a third of a second in a thread of its own: longer than one picture of the window.
TEST_F(WordsTest, AScanThatIsBeingComputedSaysSo)
{
    Picture& picture = guidedByCt(*studio);
    channel::State state = storyState(studio->scenery, 0.1);
    for (state.pictures = 1; state.pictures < 3; ++state.pictures) {
        picture.update(state, nullptr, {});
        picture.render(Quality::moving);
        EXPECT_TRUE(writes(picture, "CT scan is being computed")) << state.pictures;
        picture.render(Quality::still);
        EXPECT_TRUE(writes(picture, "CT scan " + std::to_string(state.pictures) + " at 0.1 s"));
    }
}

TEST_F(WordsTest, SlicesOfAScanHaveTheDecimalSignOfTheLanguage)
{
    base::useLanguage("de");
    Picture& picture = guidedByCt(*studio);
    channel::State state = storyState(studio->scenery, 0.1);
    state.pictures = 1;
    picture.update(state, nullptr, {});
    picture.render(Quality::still);
    base::useLanguage("en");
    EXPECT_TRUE(writes(picture, "z 5,0 mm"));
    EXPECT_FALSE(writes(picture, "z 5.0 mm"));
}

// There a look costs a dose.
TEST_F(WordsTest, ABodyThatIsGuidedByCtHasNoUltrasoundPicture)
{
    Picture& picture = guidedByCt(*studio);
    picture.showUltrasound(true);
    EXPECT_FALSE(picture.ultrasoundShown());
    picture.open(studio->scenery, studio->labels, "other");
    picture.showUltrasound(true);
    EXPECT_TRUE(picture.ultrasoundShown());
    guidedByCt(*studio);
    EXPECT_FALSE(picture.ultrasoundShown()) << "shown before";
    picture.showUltrasound(false);
}

// Half a point less than 100, which is shown as 100: the loss has its name.
TEST(ResultFile, NamesTheOnlyLossHoweverSmall)
{
    const tests::Folder folder;
    std::ofstream(folder / "r.json") << R"({"score": {"total": 99.62, "points": {"core": 50, "vital": 25,
        "technique": 24.62}, "losses": [{"points": 0.38, "words": "The tip went 166 mm inside the body"}]}})";
    const auto card = readResult(folder / "r.json");
    ASSERT_TRUE(card);
    EXPECT_EQ(card->losses, std::vector<std::string>{"-0.4   The tip went 166 mm inside the body"});
}

// What was asked for is named, and not always a core.
TEST(ResultFile, NamesWhatWasJudged)
{
    const tests::Folder folder;
    const std::string points = R"("total": 90, "points": {"core": 50, "vital": 25, "technique": 15})";
    for (const auto& [more, name] : {std::pair(R"("judged": "rest")", "Rest on the skin 50 of 50"),
                                     {R"("judged": "way")", "Way to the target 50 of 50"},
                                     {R"("judged": "core")", "Core 50 of 50"},
                                     {R"("mark_error_mm": 3.0)", "Place and size 50 of 50"}}) {
        std::ofstream(folder / "r.json") << "{\"score\": {" << points << ", " << more << "}}";
        const auto card = readResult(folder / "r.json");
        ASSERT_TRUE(card) << more;
        EXPECT_EQ(card->parts.front(), name);
    }
}

}  // namespace
}  // namespace palpate::render
