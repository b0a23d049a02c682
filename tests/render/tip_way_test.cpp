#include <render/tip_way.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

namespace palpate::render {
namespace {

// Two insertions of `length` [m] at 20 mm/s along z, at 0 and 30 mm from the z axis, each followed by a second outside.
TipWay twoInsertions(double length)
{
    TipWay way;
    channel::State state;
    for (int insertion = 0; insertion < 2; ++insertion) {
        for (double deep = 0; deep < length; deep += 20e-6) {
            state.time += 1e-3;
            state.phase = channel::Phase::inserted;
            state.tip = {0.03 * insertion, 0, deep};
            way.add(state);
        }
        for (int tick = 0; tick < 1000; ++tick) {
            state.time += 1e-3;
            state.phase = channel::Phase::free;
            state.tip = {0, 0.1, 0};
            way.add(state);
        }
    }
    return way;
}

TEST(TipWay, IsThatOfTheLastInsertionUpToATime)
{
    const TipWay way = twoInsertions(0.04);  // 2 s, 1 s outside, 2 s, 1 s
    EXPECT_TRUE(way.until(0.0).empty());
    for (const double time : {0.5, 1.0, 1.9, 3.5, 4.9}) {
        const auto points = way.until(time);
        ASSERT_FALSE(points.empty()) << time;
        const bool isSecond = time > 3;
        EXPECT_EQ(points.front(), glm::dvec3(isSecond ? 0.03 : 0.0, 0, 0)) << time;
        EXPECT_NEAR(points.back().z, 0.02 * (time - (isSecond ? 3 : 0)), 0.4e-3) << time;
        for (std::size_t i = 1; i < points.size(); ++i) {
            EXPECT_NEAR(glm::distance(points[i - 1], points[i]), 0.3e-3, 0.03e-3) << time;
        }
    }
    EXPECT_NEAR(way.until(2.5).back().z, 0.04, 0.4e-3) << "outside the last way stays";
    EXPECT_EQ(way.until(2.5).front(), glm::dvec3(0.0));
    EXPECT_EQ(way.until().front().x, 0.03);
}

TEST(TipWay, NeverEndsBeforeTheTipDoes)
{
    const TipWay way = twoInsertions(1.5);
    const auto points = way.until();
    EXPECT_LE(points.size(), 2000U);
    EXPECT_GT(points.size(), 900U);
    EXPECT_EQ(points.front(), glm::dvec3(0.03, 0, 0));
    EXPECT_NEAR(points.back().z, 1.5, 2e-3);
}

}  // namespace
}  // namespace palpate::render
