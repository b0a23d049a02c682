#include <render/picture.h>

#include <channel/needle_shape.h>
#include <render/display.h>
#include <render/mouse_hand.h>
#include <tests/render/studio.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPNGWriter.h>
#include <vtkRenderWindow.h>
#include <vtkRendererCollection.h>
#include <vtkWindowToImageFilter.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace palpate::render {
namespace {

channel::Scenery inAScanner(channel::Scenery scenery)
{
    scenery.ctSlices = 3;
    scenery.ctWidth = 5e-3;
    scenery.ctDoseIndex = 10;
    scenery.ctDoseLength = 7.5;
    return scenery;
}

class PictureTest : public testing::Test {
protected:
    static void SetUpTestSuite()
    {
        try {
            studio = std::make_unique<Studio>();
        } catch (const std::exception& problem) {
            why = problem.what();
        }
    }
    static void TearDownTestSuite() { studio.reset(); }
    void SetUp() override { ASSERT_TRUE(studio) << why; }

    static std::unique_ptr<Studio> studio;
    static std::string why;
};
std::unique_ptr<Studio> PictureTest::studio;
std::string PictureTest::why;

struct Moment {
    const char* name;
    double time;
};
constexpr std::array<Moment, 5> moments{
    {{"rest", 0.6}, {"pressed", 1.99}, {"pierced", 2.15}, {"warned", 2.9}, {"fired", 4.2}}};
// Of points along the needle's middle line the 3-D view shows the needle's colour, lit, at all but a few (the aim's ball
// and texts may lie over it); before it has moved there it does not.
TEST_F(PictureTest, ShowsTheBentNeedleWhereThePoseProjects)
{
    constexpr Pixel lit{70, 235, 255};
    for (const auto& [layout, layoutName] : layouts)
        for (const Moment& moment : moments) {
            const Image image = studio->take(moment.time, layout, false, std::string(layoutName) + "-" + moment.name);
            const channel::NeedleShape shape = needleShape(studio->scenery, storyState(studio->scenery, moment.time));
            const Area view = ScreenPlan(width, height, layout).view;
            int inside = 0, seen = 0;
            for (std::size_t i = 0; i + 1 < shape.size(); ++i)
                for (int k = 0; k < 40; ++k) {
                    const glm::dvec3 on = shape[i] + 0.025 * k * (shape[i + 1] - shape[i]);
                    if (glm::distance(on, shape.back()) < 2e-3)  // the point is thinner than a pixel
                        continue;
                    const glm::dvec2 p = studio->project(on);
                    const int x = static_cast<int>(p.x), y = static_cast<int>(p.y);
                    if (x < view.x || y < view.y || x >= view.x + view.width || y >= view.y + view.height)
                        continue;
                    ++inside;
                    seen += near(image.at(x, y), lit, 75) ? 1 : 0;
                }
            ASSERT_GT(inside, 3) << layoutName << " " << moment.name;
            EXPECT_GT(seen, 0.8 * inside) << layoutName << " " << moment.name << " of " << inside;
        }
}

// A mark where the hand is, a line from it to the tip, and nothing of both when there is no hand.
TEST_F(PictureTest, ShowsHowFarTheHandIsAheadOfTheTip)
{
    const Image before = studio->take(0.05, Layout::trainee);
    const channel::State state = storyState(studio->scenery, 0.05);
    const glm::dvec3 tip = vec(state.tip), hand = tip + 10e-3 * vec(state.axis) + glm::dvec3(10e-3, 0, 0);
    Picture& picture = studio->picture();
    picture.setHand(hand);
    picture.render(Quality::still);
    const Image with = studio->grab();
    const auto shown = [&](glm::dvec3 p, const Image& image) {
        const glm::dvec2 at = studio->project(p);
        const Area around{static_cast<int>(at.x) - 3, static_cast<int>(at.y) - 3, 7, 7};
        return image.count(around, pixelOf(handColour), 90);
    };
    EXPECT_GT(shown(hand, with), 30);
    EXPECT_GT(shown(0.5 * (hand + tip), with), 3);
    EXPECT_EQ(shown(hand, before), 0);
    picture.setHand({});
    picture.render(Quality::still);
    EXPECT_EQ(before.differing(studio->grab(), {0, 0, width, height}), 0);
}

// The picture of the pressed body differs from that of the same tool over the body at rest, at the dimple and not far away.
TEST_F(PictureTest, ShowsTheDeformationWhereItIs)
{
    for (const auto& [layout, layoutName] : layouts) {
        const Image rigid = studio->take(1.99, layout, true), pressed = studio->take(1.99, layout);
        const auto around = [&](glm::dvec3 p, int side) {
            const glm::dvec2 at = studio->project(p);
            return Area{static_cast<int>(at.x) - side / 2, static_cast<int>(at.y) - side / 2, side, side};
        };
        const Area view = ScreenPlan(width, height, layout).view;
        const int side = view.height / 12;
        const glm::dvec3 entry = vec(studio->scenery.entry), axis = glm::normalize(vec(studio->scenery.aim) - entry);
        const glm::dvec3 dimple = entry + 3e-3 * axis + 4e-3 * glm::cross(axis, glm::dvec3(0, 0, 1));
        const glm::dvec3 opposite = entry + 65e-3 * axis;
        EXPECT_GT(rigid.differing(pressed, around(dimple, side)), side * side / 4) << layoutName;
        EXPECT_EQ(rigid.differing(pressed, around(opposite, side)), 0) << layoutName;
        const Area slice = ScreenPlan(width, height, layout).slices[0];
        EXPECT_GT(rigid.differing(pressed, slice), slice.width * slice.height / 200) << layoutName;
    }
}

TEST_F(PictureTest, WarnsInColourAndWordsOnlyWhenThereIsCause)
{
    const auto banner = [&](const Image& image, Layout layout) {
        const ScreenPlan plan(width, height, layout);
        const int above = plan.height - plan.banner.y;
        return image.count({plan.banner.x, plan.banner.y, plan.banner.width, above}, pixelOf(amber), 4);
    };
    for (const auto& [layout, layoutName] : layouts) {
        const int least = static_cast<int>(80 * ScreenPlan(width, height, layout).font);
        EXPECT_LT(banner(studio->take(1.99, layout), layout), least / 10) << layoutName;
        EXPECT_GT(banner(studio->take(2.9, layout), layout), least) << layoutName;
    }
}

// The panel writes the core in the colour of what is good; the target's distance has it as well, before and after.
TEST_F(PictureTest, TellsTheCoreAfterFiring)
{
    for (const auto& [layout, layoutName] : layouts) {
        const ScreenPlan plan(width, height, layout);
        const int before = studio->take(3.7, layout).count(plan.panel, pixelOf(good), 40);
        const int after = studio->take(4.2, layout).count(plan.panel, pixelOf(good), 40);
        EXPECT_GT(after, before + 100) << layoutName;
    }
}

TEST_F(PictureTest, ShowsWhatWasMarkedInBodyAndSlice)
{
    const ScreenPlan plan(width, height);
    const Pixel colour = pixelOf({markColour[0], markColour[1], markColour[2]});
    const Image before = studio->take(0.05, Layout::trainee);
    channel::State state = storyState(studio->scenery, 0.1);
    const auto entry = studio->scenery.entry;
    state.marks = 1;
    for (std::size_t k = 0; k < 3; ++k)
        state.mark[0].place[k] = static_cast<float>(entry[k]);
    studio->picture().update(state, nullptr, {30, 0.02, 1000});
    studio->picture().render(Quality::still);
    const Image after = studio->grab("marked");
    for (const Area& area : {plan.view, plan.slices[0]})
        EXPECT_GT(after.count(area, colour, 60), before.count(area, colour, 60) + 15);
}

TEST_F(PictureTest, EveryPartOfTheInstructorsLayoutHasItsText)
{
    const Image image = studio->take(4.2, Layout::instructor);
    const ScreenPlan plan(width, height, Layout::instructor);
    for (const Area& area : {plan.view, plan.slices[0], plan.slices[1], plan.slices[2]})
        EXPECT_GT(image.count(area, {255, 255, 255}, 30), 60);
    for (const Area& area : {plan.panel, plan.events, plan.legend, plan.forces, plan.distances})
        EXPECT_GT(image.count(area, pixelOf(white), 30), 60);
    EXPECT_GT(image.count(plan.events, pixelOf(amber), 30), 20) << "the warning is among the events";
    EXPECT_GT(image.count(plan.forces, pixelOf(basicColour), 40), 40) << "a curve and its name";
}

// The shell around the artery crosses the slice through the planned line.
TEST_F(PictureTest, DrawsTheWarningDistanceOfAVitalStructure)
{
    const Image image = studio->take(0.05, Layout::trainee);
    const ScreenPlan plan(width, height);
    const Pixel shell = pixelOf({shellColour[0], shellColour[1], shellColour[2]});
    const double pixels = std::min(plan.slices[0].width, plan.slices[0].height) / viewFrame(studio->scenery).extent;
    const double around = 2 * std::acos(-1.0) * (2.5e-3 + studio->scenery.warnDistance[1]) * pixels, thick = 1e-3 * pixels;
    const int drawn = image.count(plan.slices[0], shell, 2);
    EXPECT_GT(drawn, 0.4 * around * thick);
    EXPECT_LT(drawn, 2.0 * around * thick);
}

TEST_F(PictureTest, TheChosenTissueBecomesClearAndComesBack)
{
    const Image before = studio->take(0.05, Layout::trainee);
    const Area view = ScreenPlan(width, height).view;
    Picture& picture = studio->picture();
    picture.selectTissue(-1);  // the last of the legend: the one that there is most of
    picture.changeOpacity(0.05);
    picture.render(Quality::still);
    EXPECT_GT(before.differing(studio->grab(), view), view.width * view.height / 20);
    picture.resetView();
    picture.render(Quality::still);
    EXPECT_EQ(before.differing(studio->grab(), view), 0);
}

// Whatever the number of rays was before, and wherever in the window the view is: a picture without the body stays on the
// screen while the next is computed.
TEST_F(PictureTest, TheBodyIsInEveryPictureWhenMotionBeginsAndStops)
{
    for (const auto& [layout, layoutName] : layouts) {
        const Image whole = studio->take(0.05, layout);
        const Area view = ScreenPlan(width, height, layout).view;
        constexpr Pixel background{15, 18, 26};
        const int body = view.width * view.height - whole.count(view, background, 6);
        ASSERT_GT(body, view.width * view.height / 10);
        Picture& picture = studio->picture();
        int number = 0;
        for (const Quality quality :
             {Quality::moving, Quality::moving, Quality::still, Quality::still, Quality::moving, Quality::still}) {
            picture.render(quality);
            const Image now = studio->grab(layoutName + std::to_string(number));
            const auto late = std::chrono::milliseconds(quality == Quality::moving ? 60 : 0);
            picture.finish(std::chrono::steady_clock::now() - late);
            const int seen = view.width * view.height - now.count(view, background, 6);
            EXPECT_GT(seen, 0.9 * body) << layoutName << " " << number;
            EXPECT_LT(now.differing(whole, view), body / 2) << layoutName << " " << number;
            ++number;
        }
    }
}

TEST_F(PictureTest, WithoutTheCutTheBodyHidesWhatIsInside)
{
    const Image open = studio->take(0.05, Layout::trainee);
    const Area view = ScreenPlan(width, height).view;
    Picture& picture = studio->picture();
    picture.setCut(false);
    picture.render(Quality::still);
    const Image whole = studio->grab();
    picture.setCut(true);
    picture.render(Quality::still);
    constexpr Pixel tumour{140, 64, 191};
    EXPECT_GT(open.count(view, tumour, 40), whole.count(view, tumour, 40) + 500);
    EXPECT_EQ(open.differing(studio->grab(), view), 0);
}

// Under CT a look inside costs a scan: the trainee's picture of a session has the outside alone, whatever is cut or made
// clear. The instructor's has all, and so has a record.
TEST_F(PictureTest, UnderCtTheBodyIsClosedToTheTrainee)
{
    const channel::Scenery scenery = inAScanner(studio->scenery);
    const Area view = ScreenPlan(width, height, Layout::trainee, 1, true).view;
    constexpr Pixel tumour{140, 64, 191}, background{15, 18, 26};
    Picture& picture = studio->picture();
    picture.open(scenery, studio->labels, "story");
    const auto tumourIn = [&](const std::string& name) {
        picture.update(storyState(scenery, 4.2), nullptr, {30, 0.02, 1000});
        picture.render(Quality::still);
        picture.render(Quality::still);
        const Image now = studio->grab(name);
        EXPECT_LT(now.count(view, background, 6), view.width * view.height * 3 / 4) << name << ": there is a body";
        return now.count(view, tumour, 40);
    };
    picture.show(Layout::trainee);
    EXPECT_TRUE(picture.isClosed());
    EXPECT_EQ(tumourIn("ct-closed"), 0);
    for (int i = 0; i < 3; ++i) {
        picture.selectTissue(1);
        picture.changeOpacity(0.05);
    }
    EXPECT_EQ(tumourIn("ct-closed-clear"), 0);
    picture.resetView();
    picture.show(Layout::instructor);
    EXPECT_FALSE(picture.isClosed());
    picture.show(Layout::trainee);
    const Recorded record;
    picture.setRecorded(&record);
    EXPECT_FALSE(picture.isClosed());
    EXPECT_GT(tumourIn("ct-record"), 100);
    picture.setRecorded(nullptr);
}

TEST_F(PictureTest, HelpAndCaptionCoverNothingWhenTheyAreGone)
{
    const Image before = studio->take(0.05, Layout::trainee);
    const Area all{0, 0, width, height};
    Picture& picture = studio->picture();
    picture.setHelp({{"?", "shows the keys"}, {"L", "changes the layout"}});
    picture.setCaption("PAUSED");
    picture.setTimeline(0.5);
    picture.render(Quality::still);
    const Image with = studio->grab();
    EXPECT_GT(with.count(all, pixelOf(amber), 30), before.count(all, pixelOf(amber), 30) + 300);
    picture.setHelp({});
    picture.setCaption("");
    picture.setTimeline(-1);
    picture.render(Quality::still);
    EXPECT_EQ(before.differing(studio->grab(), all), 0);
}

// Another look and another window are seen in the slice and nowhere else, and only where there is an image.
TEST_F(PictureTest, ShowsAnImageInTheSliceOnly)
{
    const Area slice = ScreenPlan(width, height).slices[0], all{0, 0, width, height};
    Picture& picture = studio->picture();
    const auto pictureOf = [&](SliceLook look) {
        picture.show(look);
        picture.render(Quality::still);
        return studio->grab();
    };
    const Image plain = studio->take(0.05, Layout::trainee);
    EXPECT_FALSE(picture.hasImage());
    EXPECT_EQ(plain.differing(pictureOf(SliceLook::image), all), 0);

    channel::Scenery scenery = studio->scenery;
    const auto codes = bodyImage(scenery);
    picture.open(scenery, studio->labels, "story", codes);
    picture.update(storyState(scenery, 0.05), nullptr, {30, 0.02, 1000});
    EXPECT_TRUE(picture.hasImage());
    const Image grey = pictureOf(SliceLook::image), colours = pictureOf(SliceLook::tissue),
                tinted = pictureOf(SliceLook::tinted);
    const int body = slice.width * slice.height / 3;
    for (const Image* other : {&colours, &tinted}) {
        EXPECT_GT(grey.differing(*other, slice), body);
        EXPECT_EQ(grey.differing(*other, all), grey.differing(*other, slice));
    }
    EXPECT_EQ(plain.differing(colours, slice), 0);
    picture.nextWindow();
    EXPECT_GT(grey.differing(pictureOf(SliceLook::image), slice), body);
    picture.nextWindow();
    EXPECT_EQ(grey.differing(pictureOf(SliceLook::image), all), 0) << "the first window again";
    picture.show(SliceLook::tinted);
}

// In a small window the caption of a scan has a place of its own, and the side letters are read on tissue that is white.
TEST_F(PictureTest, WordsOfACtScanLieOnNothingElse)
{
    channel::Scenery scenery = inAScanner(studio->scenery);
    for (channel::TissueSound& sound : scenery.sound)
        sound.density = 3000;
    constexpr int wide = 500, high = 400;
    studio->resize(wide, high);
    Picture& picture = studio->picture();
    // A body without a border: fat all over.
    const std::vector<std::uint8_t> labels(studio->labels.size(), 2);
    picture.open(scenery, labels, "story");
    picture.show(Layout::trainee);
    channel::State state = storyState(scenery, 1.0);
    const auto pictureOf = [&](std::uint32_t scans) {
        state.pictures = scans;
        picture.update(state, nullptr, {30, 0.02, 1000});
        picture.render(Quality::still);
        return studio->grab("ct-" + std::to_string(scans));
    };
    const Image before = pictureOf(0), scanned = pictureOf(1);
    studio->resize(width, height);
    const ScreenPlan plan(wide, high, Layout::trainee, 1, true);
    EXPECT_EQ(scanned.differing(before, plan.health), 0) << "how viewer and simulation keep up";
    EXPECT_EQ(scanned.differing(before, plan.panel), 0);
    const Area& scan = plan.ultrasound;
    EXPECT_GT(scanned.differing(before, scan), scan.width * scan.height / 4);
    // The box of a side letter lets 45 % of the white through.
    const Area left{scan.x, scan.y + scan.height / 4, 20, scan.height / 2};
    EXPECT_GT(scanned.count(left, {115, 115, 115}, 8), 40);
    EXPECT_GT(scanned.count(left, {255, 255, 255}, 4), left.width * left.height / 2);
}

// Moments that nobody looked at: the event at 0.5 s, the scan at 0.6 s.
TEST_F(PictureTest, ARecordsEventsAndScansAreOfTheirOwnTime)
{
    channel::Scenery scenery = inAScanner(studio->scenery);
    Recorded recorded;
    channel::State taken = storyState(scenery, 0.6);
    taken.tick = 600;
    taken.pictures = 1;
    recorded.add({0.5, EventKind::contact, 0, 0});
    recorded.addTaken(taken, {});
    Picture& picture = studio->picture();
    picture.setRecorded(&recorded);
    picture.open(scenery, studio->labels, "story");
    channel::State state = storyState(scenery, 1.4);
    state.tick = 1400;
    state.pictures = 1;
    state.missed = channel::notCounted;
    std::string words;
    for (const auto& [layout, name] : layouts) {
        picture.show(layout);
        picture.update(state, nullptr, {30, 0.02, 1000});
        picture.render(Quality::still);
        for (const Written& one : picture.written())
            words += one.words + "\n";
    }
    picture.setRecorded(nullptr);
    EXPECT_NE(words.find("touches the body\n0.5 s"), std::string::npos) << words;
    EXPECT_NE(words.find("CT scan 1 at 0.6 s"), std::string::npos) << words;
    EXPECT_EQ(words.find("missed"), std::string::npos) << "nobody has counted them: " << words;
}

// Of what is 10 mm before or behind a slice nothing looks as if it was in it.
TEST_F(PictureTest, TheTargetsRingIsBrightInItsOwnPlaneOnly)
{
    const ScreenPlan plan(width, height, Layout::instructor);
    const channel::Scenery& scenery = studio->scenery;
    Picture& picture = studio->picture();
    picture.open(scenery, studio->labels, "story");
    picture.show(Layout::instructor);
    channel::State state = storyState(scenery, 0.05);
    const auto whiteAt = [&](std::size_t slice, glm::dvec3 tip) {
        state.tip = {tip.x, tip.y, tip.z};
        picture.update(state, nullptr, {30, 0.02, 1000});
        picture.render(Quality::still);
        const ViewFrame frame = orthogonalFrames(viewFrame(scenery), tip)[slice];
        const Area& area = plan.slices[slice];
        const glm::dvec3 d = (vec(scenery.aim) - frame.centre) * (std::min(area.width, area.height) / frame.extent);
        const int half = static_cast<int>(0.8 * plan.font);
        const Area around{area.x + area.width / 2 + static_cast<int>(glm::dot(d, frame.right)) - half,
                          area.y + area.height / 2 + static_cast<int>(glm::dot(d, frame.up)) - half, 2 * half, 2 * half};
        return studio->grab().count(around, {255, 255, 255}, 60);
    };
    for (std::size_t slice = 0; slice < 3; ++slice) {
        const glm::dvec3 towards = orthogonalFrames(viewFrame(scenery), {})[slice].towards;
        const glm::dvec3 away = vec(scenery.aim) + glm::dvec3(10e-3);
        EXPECT_EQ(whiteAt(slice, away), 0) << slice;
        EXPECT_GT(whiteAt(slice, away - glm::dot(glm::dvec3(10e-3), towards) * towards), 10) << slice;
    }
}

// The simulation does so too after a picture that took longer than longestSilence: else the drawn hand would be ahead of
// the tip by what the hand did before.
TEST_F(PictureTest, AfterASlowPictureTheHandBeginsWhereTheToolIs)
{
    channel::Scenery scenery = studio->scenery;
    scenery.viewersHand = channel::handIsViewers;
    channel::Publisher publisher("slow-picture", scenery, studio->labels);
    const channel::State state = storyState(scenery, 0.1);
    publisher.setState(state);
    Follower follower("slow-picture", 10);
    MouseHand hand;
    const auto look = [&] {
        follower.poll(studio->picture());
        hand.keep(follower);
    };
    for (int i = 0; i < 1000 && !hand.is(); ++i)
        look();
    ASSERT_TRUE(hand.is());
    hand.press(follower.state());
    hand.move({0, 5e-3, 0});
    look();
    EXPECT_NEAR(glm::distance(hand.target(), vec(state.tip)), 5e-3, 1e-9);
    std::this_thread::sleep_for(std::chrono::duration<double>(1.1 * MouseHand::longestSilence));
    look();
    EXPECT_EQ(hand.target(), vec(state.tip));
    EXPECT_TRUE(hand.held());
}

// under() is the inverse of the projection.
TEST_F(PictureTest, FindsThePointUnderAPixel)
{
    studio->take(0.05, Layout::trainee);
    for (const glm::dvec3 p : {glm::dvec3(0.0), glm::dvec3(0.01, -0.02, 0.005), vec(studio->scenery.entry)}) {
        const glm::dvec2 pixel = studio->project(p);
        EXPECT_LT(glm::distance(studio->picture().under({pixel.x, pixel.y}, p), p), 1e-6);
        EXPECT_TRUE(studio->picture().shows(p));
        for (const double past : {-0.1, 1.1})
            EXPECT_FALSE(studio->picture().shows(studio->picture().under({past * width, pixel.y}, p)));
    }
}

}  // namespace
}  // namespace palpate::render
