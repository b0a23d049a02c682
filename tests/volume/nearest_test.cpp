#include <volume/distance.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace palpate::volume {
namespace {

// A few balls in the middle of a grid, as fractions of its nodes' cells: hard edges, smoothed once.
std::vector<float> fractionOfBalls(const NodeGrid& grid, std::mt19937& random)
{
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    std::vector<std::pair<Vec3, double>> balls;
    for (int i = 0; i < 4; ++i) {
        balls.emplace_back(0.5 * Vec3(grid.size) + 9.0 * (Vec3(unit(random), unit(random), unit(random)) - 0.5),
                           1.5 + 4.5 * unit(random));
    }
    std::vector<float> fraction(grid.count());
    for (std::size_t i = 0; i < fraction.size(); ++i) {
        const Vec3 at(grid.node(i));
        const auto holds = [&](const auto& ball) { return glm::length(at - ball.first) < ball.second; };
        fraction[i] = std::ranges::any_of(balls, holds) ? 1.0F : 0.0F;
    }
    for (int axis = 0; axis < 3; ++axis) {
        Index3 step(0);
        step[axis] = 1;
        const std::vector<float> before = fraction;
        for (std::size_t i = 0; i < fraction.size(); ++i) {
            const Index3 low = glm::max(grid.node(i) - step, Index3(0));
            const Index3 high = glm::min(grid.node(i) + step, grid.size - 1);
            fraction[i] = 0.25F * (before[grid.offset(low)] + before[grid.offset(high)]) + 0.5F * before[i];
        }
    }
    return fraction;
}

BlurredSurface surfaceOf(const NodeGrid& grid, const std::vector<float>& fraction)
{
    return blurredSurface(grid, fraction, Blur{Vec3(1.0), Vec3(1.0), Index3(1), 0.8});
}

// The two sweeps as they are described, node by node; then the neighbours' answers.
class PlainSweeps {
public:
    PlainSweeps(Index3 size, const std::vector<SurfacePoint>& points) : grid_{size, Vec3(0.0), 1.0}, points_(points) {}

    std::vector<std::int32_t> nearest(const std::vector<std::int32_t>& entered) const
    {
        const std::vector<std::int32_t> up = sweep(entered, 1);
        const std::vector<std::int32_t> down = sweep(entered, -1);
        std::vector<std::int32_t> best(entered.size(), -1);
        for (std::size_t i = 0; i < best.size(); ++i) {
            const Index3 n = grid_.node(i);
            for (const Index3& step : {Index3(0), Index3(-1, 0, 0), Index3(1, 0, 0), Index3(0, -1, 0), Index3(0, 1, 0),
                                       Index3(0, 0, -1), Index3(0, 0, 1)}) {
                if (grid_.contains(n + step)) {
                    take(best, n, up[grid_.offset(n + step)]);
                    take(best, n, down[grid_.offset(n + step)]);
                }
            }
        }
        return best;
    }

private:
    float squared(Index3 n, std::int32_t point) const
    {
        const Vec3f away = Vec3f(n) - points_[static_cast<std::size_t>(point)].at;
        return glm::dot(away, away);
    }
    void take(std::vector<std::int32_t>& answers, Index3 n, std::int32_t point) const
    {
        std::int32_t& own = answers[grid_.offset(n)];
        if (point >= 0 && (own < 0 || squared(n, point) < squared(n, own))) {
            own = point;
        }
    }
    void takeFrom(std::vector<std::int32_t>& answers, Index3 n, Index3 step) const
    {
        if (grid_.contains(n + step)) {
            take(answers, n, answers[grid_.offset(n + step)]);
        }
    }
    void row(std::vector<std::int32_t>& answers, int y, int z, int from) const
    {
        for (int x = 0; x < grid_.size.x; ++x) {
            takeFrom(answers, {x, y, z}, {0, from, 0});
        }
        for (int x = 0; x < grid_.size.x; ++x) {
            takeFrom(answers, {x, y, z}, {-1, 0, 0});
        }
        for (int x = grid_.size.x - 1; x >= 0; --x) {
            takeFrom(answers, {x, y, z}, {1, 0, 0});
        }
    }
    std::vector<std::int32_t> sweep(std::vector<std::int32_t> answers, int way) const
    {
        for (int k = 0; k < grid_.size.z; ++k) {
            const int z = way > 0 ? k : grid_.size.z - 1 - k;
            forEachIndex({0, 0, z}, {grid_.size.x - 1, grid_.size.y - 1, z}, [&](Index3 n) {
                takeFrom(answers, n, {0, 0, -way});
            });
            for (int y = 0; y < grid_.size.y; ++y) {
                row(answers, y, z, -1);
            }
            for (int y = grid_.size.y - 2; y >= 0; --y) {
                row(answers, y, z, 1);
            }
        }
        return answers;
    }

    NodeGrid grid_;
    const std::vector<SurfacePoint>& points_;
};

// Many points are equally far from a node where they lie on nodes: the first one found counts, on every path.
TEST(Nearest, IsThatOfTwoPlainSweepsToTheSamePoint)
{
    std::mt19937 random(8);
    std::uniform_real_distribution<float> inCell(-0.5F, 0.5F);
    for (const int count : {1, 2, 7, 60, 900}) {
        for (const float apart : {0.0F, 1.0F}) {
            const NodeGrid grid{{17, 23, 19}, Vec3(0.0), 1.0};
            std::vector<std::int32_t> nearest(grid.count(), -1);
            std::vector<SurfacePoint> points;
            for (int i = 0; i < count; ++i) {
                const std::size_t at = random() % grid.count();
                if (nearest[at] < 0) {
                    nearest[at] = static_cast<std::int32_t>(points.size());
                    const Vec3f off(inCell(random), inCell(random), inCell(random));
                    points.push_back({Vec3f(grid.node(at)) + apart * off, Vec3f(0.0F)});
                }
            }
            const std::vector<std::int32_t> expected = PlainSweeps(grid.size, points).nearest(nearest);
            spreadNearest(grid.size, points, nearest);
            EXPECT_EQ(nearest, expected) << count << " points, " << apart;
        }
    }
}

// To the bit, as forces are compared by their bits.
TEST(EnclosedVolume, AroundASmallSurfaceIsThatOfAllDistances)
{
    std::mt19937 random(21);
    const NodeGrid grid{{58, 61, 55}, Vec3(0.0), 1e-3};
    for (int i = 0; i < 25; ++i) {
        const std::vector<float> fraction = fractionOfBalls(grid, random);
        const BlurredSurface surface = surfaceOf(grid, fraction);
        const Enclosed enclosed = enclosedBy(grid, fraction, surface);
        EXPECT_TRUE(enclosed.distance.empty()) << "all nodes were computed";
        EXPECT_EQ(enclosed.volume, enclosedVolume(grid, signedDistance(grid, fraction, surface, 1.0F)));
        EXPECT_GT(enclosed.volume, 0.0);
    }
}

// Also where tissue fills the grid up to its border beyond the nodes around the surface: around a hole it does.
TEST(EnclosedVolume, AroundASmallHoleIsThatOfAllDistances)
{
    std::mt19937 random(22);
    const NodeGrid grid{{58, 61, 55}, Vec3(0.0), 1e-3};
    std::vector<float> fraction = fractionOfBalls(grid, random);
    std::ranges::transform(fraction, fraction.begin(), [](float f) { return 1.0F - f; });
    const BlurredSurface surface = surfaceOf(grid, fraction);
    const Enclosed enclosed = enclosedBy(grid, fraction, surface);
    EXPECT_EQ(enclosed.distance, signedDistance(grid, fraction, surface, 1.0F));
    EXPECT_EQ(enclosed.volume, enclosedVolume(grid, enclosed.distance));
}

}  // namespace
}  // namespace palpate::volume
