// Balls that are led sideways deeper than the cells bear: held back, and felt evenly.
#include "led_tool.h"

#include <gtest/gtest.h>

namespace palpate::chainmail {
namespace {

// A ball of so many cells, pressed so many radii deep, then led sideways by as much as it is deep. Bounds, in the force:
// its largest change in a call, and by how much it may differ from where the way began.
struct DeepDrag {
    double cells, radii, speed, step, range;
};

void dragDeep(const ElasticBody& body, const DeepDrag& drag)
{
    const double radius = drag.cells * 2e-3, depth = drag.radii * radius;
    Way way(body, middle - Vec3(0.5 * depth, 0.0, 0.37e-3), radius, 0.0, asInASession);
    way.speed = drag.speed;
    way.to(depth);
    for (int i = 0; i < 50; ++i) {
        way.tick(depth, 0.0);
    }
    const double force = way.force();
    way.step = 0.0;
    double least = force, most = force;
    for (double along = 0.0; along < depth; along += drag.speed) {
        way.tick(depth, along);
        least = std::min(least, way.force());
        most = std::max(most, way.force());
    }
    EXPECT_LT(way.step, drag.step * force) << drag.cells << " cells, " << drag.speed * 1e6 << " mm/s";
    EXPECT_GT(least, (1.0 - drag.range) * force) << drag.cells << " cells, " << drag.speed * 1e6 << " mm/s";
    EXPECT_LT(most, (1.0 + drag.range) * force) << drag.cells << " cells, " << drag.speed * 1e6 << " mm/s";
    EXPECT_LE(way.pull, 0.0);
}

// A ball is felt from cell to cell, the more so the fewer it has. With one limit of the stretch for any number of cells, a
// ball of one cell lost the tissue, and on `block` one of two cells felt nine times its force.
TEST(DeepDrags, BallsOfFewCellsKeepTheTissueBeforeThem)
{
    const ElasticBody body = softBlock(0.49);
    for (const double speed : {20e-6, 100e-6}) {
        for (const double radii : {2.4, 3.0}) {
            dragDeep(body, {1.0, radii, speed, 0.3, 0.5});
            for (const double cells : {1.5, 2.0, 2.5, 4.0}) {
                dragDeep(body, {cells, radii, speed, 0.1, 0.2});
            }
        }
    }
}

// A plate of five cells on a floor, pressed almost flat. Held back in proportion to what was left of its limit, the ball
// swung around it, and single calls changed the force by a quarter.
TEST(DeepDrags, APlateThatIsPressedFlatIsFeltEvenly)
{
    auto block = tests::heldBlock({40, 6, 40}, 2e-3, 3250.0, 0.49);
    block.air = 2;
    const ElasticBody body = tests::bodyOf(block);
    for (const double radii : {0.8, 0.85, 0.95}) {
        dragDeep(body, {5.0, radii, 20e-6, 0.03, 0.2});
    }
    for (const double radii : {0.4, 0.45}) {
        dragDeep(body, {10.0, radii, 20e-6, 0.03, 0.2});
    }
}

}  // namespace
}  // namespace palpate::chainmail
