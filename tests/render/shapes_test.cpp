#include <channel/needle_shape.h>
#include <render/concealment.h>
#include <render/events.h>
#include <render/recorded.h>
#include <render/screen_plan.h>
#include <render/shift_field.h>
#include <render/slice_picture.h>
#include <render/tool_picture.h>
#include <render/traces.h>
#include <tests/render/body.h>

#include <gtest/gtest.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

namespace palpate::render {
namespace {

TEST(NeedleShape, IsStraightWithoutABend)
{
    const channel::Scenery scenery = bodyScenery();
    const channel::State state = storyState(scenery, 1.5);
    const channel::NeedleShape shape = needleShape(scenery, state);
    EXPECT_NEAR(glm::distance(shape.front(), shape.back()), scenery.toolLength, 1e-12);
    for (const glm::dvec3& p : shape)
        EXPECT_NEAR(glm::length(glm::cross(p - shape.back(), vec(state.axis))), 0, 1e-12);
}

// Off the line of the shaft outside by bend (s / inserted)^2: constant second differences, and no kink at the entry.
TEST(NeedleShape, BendsWithConstantCurvatureFromTheEntryOn)
{
    const channel::Scenery scenery = bodyScenery();
    channel::State state = storyState(scenery, 3.4);
    state.inserted = 0.04;
    const glm::dvec3 aside = glm::normalize(vec(state.bend));
    const channel::NeedleShape shape = needleShape(scenery, state);
    EXPECT_NEAR(glm::distance(shape.back(), vec(state.tip)), 0, 1e-12);
    const auto off = [&](std::size_t i) { return glm::dot(shape[i] - shape[0], aside); };
    EXPECT_NEAR(off(1), 0, 1e-12);
    const double second = off(1) - 2 * off(2) + off(3);
    EXPECT_GT(second, 0);
    for (std::size_t i = 2; i + 1 < shape.size(); ++i)
        EXPECT_NEAR(off(i - 1) - 2 * off(i) + off(i + 1), second, 1e-12);
    EXPECT_NEAR(off(shape.size() - 1), glm::length(vec(state.bend)), 1e-12);
}

// What the ray caster looks up, decoded and interpolated as a texture is, against the fixed point.
TEST(ShiftField, LooksUpTheRestPointOfWhatIsSeen)
{
    const channel::Scenery scenery = bodyScenery();
    Deformation deformation(scenery, bodyLabels(scenery));
    auto displaced = std::make_unique<channel::Displaced>();
    storyDisplaced(scenery, 1.99, *displaced);
    deformation.apply(*displaced);
    ShiftField field;
    sample(deformation, field);
    ASSERT_GT(field.size.x, 8);
    const auto texel = [&](glm::ivec3 n) {
        const ShiftField::Texel& t =
            field.texels[static_cast<std::size_t>((n.z * field.size.y + n.y) * field.size.x + n.x)];
        return field.largest / 127 * (glm::dvec3(t[0], t[1], t[2]) - 128.0);
    };
    std::mt19937 random(3);
    std::uniform_real_distribution<double> fraction(0, 1);
    std::vector<double> errors;
    for (int i = 0; i < 20000; ++i) {
        const glm::dvec3 g =
            glm::dvec3(fraction(random), fraction(random), fraction(random)) * (glm::dvec3(field.size) - 1.001);
        const glm::dvec3 x = field.origin + field.spacing * g;
        glm::vec3 start(0);
        if ((deformation.restLabel(deformation.rest(x, start)) & channel::rowBits) == 0)
            continue;
        const glm::ivec3 low(g);
        glm::dvec3 shift(0.0);
        for (int k = 0; k < 8; ++k) {
            const glm::ivec3 corner(k & 1, k / 2 & 1, k / 4);
            const glm::dvec3 part = glm::abs(g - glm::dvec3(low) - 1.0 + glm::dvec3(corner));
            shift += part.x * part.y * part.z * texel(low + corner);
        }
        errors.push_back(glm::distance(x + shift, deformation.rest(x, start)));
    }
    std::sort(errors.begin(), errors.end());
    ASSERT_GT(errors.size(), 1000U);
    EXPECT_LT(errors[errors.size() * 98 / 100], 0.3e-3);
    EXPECT_LT(errors.back(), 1e-3) << "a voxel";
    EXPECT_GT(field.largest, 4e-3);
}

TEST(ShiftField, IsEmptyAtRest)
{
    const channel::Scenery scenery = bodyScenery(40, 2.6e-3);
    const Deformation deformation(scenery, bodyLabels(scenery));
    ShiftField field;
    sample(deformation, field);
    EXPECT_EQ(field.size, glm::ivec3(0));
}

TEST(Deformation, TheWarningShellMovesWithTheTissue)
{
    channel::Scenery scenery = bodyScenery();
    const std::vector<std::uint8_t> labels = bodyLabels(scenery);
    Deformation deformation(scenery, labels);
    auto displaced = std::make_unique<channel::Displaced>();
    waveDisplaced(scenery, 0.3, 2e-3, *displaced);
    deformation.apply(*displaced);
    int shells = 0;
    for (std::size_t i = 0; i < labels.size(); i += 7) {
        if ((labels[i] & channel::shellBit) == 0)
            continue;
        const auto n = static_cast<int>(i), side = scenery.labels.size[0];
        const glm::dvec3 rest =
            vec(scenery.labels.origin) + scenery.labels.spacing * glm::dvec3(n % side, n / side % side, n / side / side);
        glm::vec3 shift(0);
        shells +=
            (deformation.restLabel(deformation.rest(deformation.seen(rest), shift)) & channel::shellBit) != 0 ? 1 : -1;
    }
    EXPECT_GT(shells, 100);
}

TEST(Events, TellTheStoryInOrder)
{
    const channel::Scenery scenery = bodyScenery();
    History history;
    for (int ms = 0; ms < 5100; ms += 5)
        history.add(storyState(scenery, 1e-3 * ms));
    std::vector<EventKind> kinds;
    for (const Event& event : history.events)
        kinds.push_back(event.kind);
    EXPECT_EQ(kinds, (std::vector{EventKind::contact, EventKind::inserted, EventKind::near, EventKind::fired,
                                  EventKind::finished}));
    EXPECT_EQ(words(history.events[2], scenery), "near artery");
    EXPECT_EQ(words(history.events[3], scenery), "core: 83 % target");
}

TEST(Events, AMarkIsOneOfThem)
{
    channel::State before, now;
    now.marks = 2;
    const auto events = eventsBetween(before, now);
    ASSERT_EQ(events.size(), 1U);
    EXPECT_EQ(words(events[0], bodyScenery()), "mark 2");
    const auto back = eventsBetween(now, before);
    ASSERT_EQ(back.size(), 1U);
    EXPECT_EQ(words(back[0], bodyScenery()), "mark 2 taken back");
}

// On the body, not at the middle of the fingertip's round end, which is a radius above it.
TEST(Marks, AreWhereTheFrontOfTheFingertipWas)
{
    channel::Scenery scenery;
    scenery.toolRadius = 6e-3;
    channel::Mark mark;
    mark.place = {0, -6e-3F, 0};
    scenery.tool = channel::ToolKind::capsule;
    EXPECT_LT(glm::length(markedPlace(scenery, mark)), 1e-9);
    scenery.tool = channel::ToolKind::needle;
    EXPECT_NEAR(markedPlace(scenery, mark).y, -6e-3, 1e-9);
}

// The planned line of a scene whose lump lies anywhere leads past it.
TEST(Concealment, TakesTheLineOutOfAPalpationWhereverItIsShown)
{
    channel::Scenery scenery = bodyScenery();
    conceal({}, scenery);
    EXPECT_NE(scenery.entry, scenery.aim);
    scenery.task = channel::Task::find;
    conceal({}, scenery);
    EXPECT_EQ(scenery.entry, scenery.aim);
}

TEST(History, KeepsPeaksThatNoPictureShows)
{
    History history;
    for (std::uint64_t tick = 1; tick < 20'000; ++tick) {
        channel::State state;
        state.tick = tick;
        state.time = 1e-3 * static_cast<double>(tick);
        state.total = {tick == 15'007 ? 7.0 : 1.0, 0, 0};
        state.distance[0] = tick == 15'013 ? -1e-3 : 1e-2;
        history.add(state);
    }
    double peak = 0, nearest = 1;
    for (const History::Moment& m : history.moments) {
        peak = std::max(peak, m.total);
        nearest = std::min(nearest, static_cast<double>(m.distance[0]));
    }
    EXPECT_EQ(peak, 7.0);
    EXPECT_NEAR(nearest, -1e-3, 1e-9);
    EXPECT_LT(history.moments.size(), 600U);
    EXPECT_GE(history.moments.front().time, history.moments.back().time - traceSeconds - 0.1);
}

// A window may be so narrow that several moments share a pixel column, and moves on by fractions of one.
TEST(History, EveryPeakIsInItsColumn)
{
    for (int peak = 0; peak < 100; ++peak) {
        History history;
        channel::State state;
        for (state.tick = 0; state.tick < 2000; ++state.tick) {
            state.time = 1e-3 * static_cast<double>(state.tick);
            const bool isPeak = static_cast<int>(state.tick / 20) == peak;
            state.total = {isPeak ? 3.0 : 1.0, 0, 0};
            state.distance[0] = isPeak ? 0.002 : 0.010;
            history.add(state);
        }
        const auto force = history.columns(
            13.0, [](const auto& m) { return m.total; }, false);
        const auto distance = history.columns(
            13.0, [](const auto& m) { return static_cast<double>(m.distance[0]); }, true);
        ASSERT_EQ(force.size(), 26U);
        const auto larger = [](const History::Point& a, const History::Point& b) { return a.value < b.value; };
        const History::Point most = *std::ranges::max_element(force, larger);
        EXPECT_DOUBLE_EQ(most.value, 3.0);
        EXPECT_NEAR(most.time, 0.02 * peak, 0.021);
        EXPECT_NEAR(std::ranges::min_element(distance, larger)->value, 0.002, 1e-9) << peak;
    }
}

// A debrief jumps from event to event: what lies between them is drawn, though no picture showed it, and nothing that is
// still to come.
TEST(Recorded, TracesHoldWhatWasNotLookedAt)
{
    Recorded recorded;
    channel::State state;
    for (state.tick = 0; state.tick < 20'000; ++state.tick) {
        state.time = 1e-3 * static_cast<double>(state.tick);
        state.total = {state.tick == 12'007 ? 7.0 : 1.0, 0, 0};
        state.distance[0] = 0.01;
        recorded.addTick(state);
    }
    const auto peak = [](const std::deque<History::Moment>& moments) {
        return std::ranges::max(moments, {}, &History::Moment::total).total;
    };
    auto moments = recorded.momentsUntil(15.0);
    EXPECT_EQ(peak(moments), 7.0);
    EXPECT_NEAR(moments.front().time, 15.0 - traceSeconds, 0.021);
    EXPECT_NEAR(moments.back().time, 15.0, 0.021);
    EXPECT_EQ(peak(recorded.momentsUntil(11.9)), 1.0);
    EXPECT_TRUE(recorded.momentsUntil(-1.0).empty());
    conceal({.plan = true, .tissues = {}}, moments.back());
    EXPECT_TRUE(std::isinf(moments.back().distance[0]));
}

TEST(History, ForgetsWhatIsLaterThanAJumpBack)
{
    const channel::Scenery scenery = bodyScenery();
    History history;
    for (int ms = 0; ms < 4500; ms += 5)
        history.add(storyState(scenery, 1e-3 * ms));
    history.add(storyState(scenery, 1.5));
    EXPECT_EQ(history.moments.back().time, 1.5);
    ASSERT_EQ(history.events.size(), 1U);
    EXPECT_EQ(history.events.back().kind, EventKind::contact);
}

// Whatever the window: every part lies inside it and no two cover each other.
TEST(ScreenPlan, PartsFitTheWindowAndDoNotOverlap)
{
    std::mt19937 random(5);
    std::uniform_int_distribution<int> side(320, 4000);
    for (int i = 0; i < 500; ++i) {
        const Layout layout = i % 2 == 0 ? Layout::trainee : Layout::instructor;
        const ScreenPlan plan(side(random), side(random), layout, 1 + i % 3);
        std::vector<Area> parts{plan.view, plan.panel, plan.slices[0], plan.slices[1], plan.slices[2]};
        if (layout == Layout::instructor)
            parts.insert(parts.end(), {plan.events, plan.legend, plan.forces, plan.distances});
        for (std::size_t a = 0; a < parts.size(); ++a) {
            const Area& p = parts[a];
            if (p.empty())
                continue;
            EXPECT_TRUE(p.x >= 0 && p.y >= 0 && p.x + p.width <= plan.width && p.y + p.height <= plan.height)
                << plan.width << " x " << plan.height << " part " << a;
            for (std::size_t b = 0; b < a; ++b) {
                const Area& q = parts[b];
                EXPECT_TRUE(q.empty() || p.x + p.width <= q.x || q.x + q.width <= p.x || p.y + p.height <= q.y ||
                            q.y + q.height <= p.y)
                    << plan.width << " x " << plan.height << " parts " << b << " and " << a;
            }
        }
        EXPECT_GE(plan.view.width + 1, plan.width / 4);
        EXPECT_GE(plan.font, 10.0 * (1 + i % 3));
    }
}

// Every corner is as far from the segment as the stick is thick, and the outline is as long and encloses as much as one of
// 2 l + 2 pi r and 2 l r + pi r^2 does: to what 48 corners miss of a circle. Seen from its end it is a circle.
TEST(StickOutline, IsAsFarFromTheStickAllAround)
{
    constexpr double radius = 12, pi = 3.14159265358979;
    for (const Point2 to : {Point2{130, 40}, {-30, 250}, {40, 40}, {40, -20}}) {
        const Point2 from{40, 40};
        const auto corners = stickOutline(from, to, radius);
        const glm::dvec2 a(from[0], from[1]), b(to[0], to[1]);
        const double along = glm::distance(a, b);
        double length = 0, area = 0;
        for (std::size_t i = 0; i < corners.size(); ++i) {
            const Point2 &c = corners[i], &next = corners[(i + 1) % corners.size()];
            const glm::dvec2 p(c[0], c[1]), q(next[0], next[1]);
            const double t = along > 0 ? std::clamp(glm::dot(p - a, b - a) / (along * along), 0.0, 1.0) : 0.0;
            EXPECT_NEAR(glm::distance(p, glm::mix(a, b, t)), radius, 1e-9);
            length += glm::distance(p, q);
            area += 0.5 * (p.x * q.y - p.y * q.x);
        }
        EXPECT_NEAR(length, 2 * along + 2 * pi * radius, 0.01 * pi * radius);
        EXPECT_NEAR(area, 2 * along * radius + pi * radius * radius, 0.01 * pi * radius * radius);
    }
}

}  // namespace
}  // namespace palpate::render
