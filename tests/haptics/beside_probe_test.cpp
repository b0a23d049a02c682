// A needle beside a probe that presses, where the skin lies deeper than at rest.
#include "models.h"

#include <haptics/simulation.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::haptics {
namespace {

const std::string needleBesideTheProbe = R"(name = "block"
[volume]
phantom = "block"
voxel_mm = 2.0
parameters = {width_mm = 80, thickness_mm = 40, tumours = 0}
[tool]
kind = "needle"
radius_mm = 1.05
[dffb]
mode = "off"
[target]
structure = "fat"
entry_mm = [0, 0, 9]
aim_mm = [0, 25, 9]
[model]
setting = "fast"
[probe]
kind = "linear"
face_mm = [0, 0, 0]
direction = [0, 1, 0]
lateral = [1, 0, 0]
)";

class BesideTheProbe : public testing::Test {
protected:
    static constexpr double beside = 9e-3;  // [m]

    BesideTheProbe() : model_(tests::modelOf(needleBesideTheProbe)), simulation_(model_)
    {
        sample_.axis = {0, 1, 0};
        sample_.position = {0, -20e-3, beside};
        sample_.buttons = buttonDeadMan;
        for (int i = 0; i < 1000; ++i) {
            sample_.probe.press = std::min(8e-3, 10e-6 * (i + 1));
            simulation_.tick(sample_);
        }
        skin_ = displaced({0, 0, beside}).y;
    }
    Vec3 displaced(Vec3 rest) const { return occupancy::displacementAt(body(), rest); }
    occupancy::Body body() const { return simulation_.shape().body(model_.surface); }
    void wait()
    {
        for (int i = 0; i < 500; ++i) {
            simulation_.tick(sample_);
        }
    }
    // On to `depth` at 20 mm/s, and what the last tick said.
    const TickRecord& advance(double depth)
    {
        while (sample_.position.y < depth) {
            sample_.position.y += 20e-6;
            simulation_.tick(sample_);
        }
        return simulation_.record();
    }

    SessionModel model_;
    Simulation simulation_;
    DeviceSample sample_;
    double skin_ = 0;  // depth, with the probe pressed [m]
};

TEST_F(BesideTheProbe, ANeedleTouchesTheSkinWhereThatHasIt)
{
    ASSERT_GT(skin_, 2e-3);
    while (simulation_.record().phase == Phase::free && sample_.position.y < 10e-3) {
        advance(sample_.position.y + 10e-6);
    }
    EXPECT_NEAR(sample_.position.y, skin_, 0.3e-3);
    EXPECT_LT(glm::length(simulation_.record().tissueForce), 0.02);
    const double probe = glm::length(simulation_.record().probeForce);
    const double touched = sample_.position.y;
    double last = 0.0;
    while (sample_.position.y < touched + 0.5e-3) {
        const TickRecord& r = advance(sample_.position.y + 10e-6);
        ASSERT_EQ(r.phase, Phase::contact);
        EXPECT_NEAR(glm::length(r.probeForce), probe, 0.02 * probe);
        EXPECT_LT(glm::length(r.tissueForce) - last, 0.01) << "a jump";
        last = glm::length(r.tissueForce);
    }
    EXPECT_GT(last, 0.0);
}

// What the needle has reached is the tissue that was there before it came: it drags none back to where that lies at rest.
// Without the probe it is as far, and drags as much, where its tip is in the same tissue.
TEST_F(BesideTheProbe, ANeedleReachesTheTissueThatIsThere)
{
    const Vec3 tip(0, 20e-3, beside), aside(0, 20e-3, beside + 8e-3);
    const Vec3 before = displaced(aside), there = occupancy::exactRestPoint(body(), tip);
    EXPECT_GT(tip.y - there.y, 1e-3);
    advance(tip.y);
    wait();
    const TickRecord r = simulation_.record();
    EXPECT_EQ(r.phase, Phase::inserted);
    const Vec3 dragged = displaced(aside) - before;
    // The probe goes, and the tissue comes back with all that the needle is in.
    for (int i = 0; i < 800; ++i) {
        sample_.probe.press = 8e-3 - 10e-6 * (i + 1);
        simulation_.tick(sample_);
    }
    wait();
    const Vec3 left = displaced(aside);

    Simulation alone(model_);
    sample_.position = {0, -20e-3, beside};
    while (sample_.position.y < there.y) {
        sample_.position.y += 20e-6;
        alone.tick(sample_);
    }
    for (int i = 0; i < 500; ++i) {
        alone.tick(sample_);
    }
    const Vec3 expected = occupancy::displacementAt(alone.shape().body(model_.surface), aside);
    EXPECT_NEAR(r.inserted, alone.record().inserted, 0.4e-3);
    EXPECT_NEAR(glm::length(r.tissueForce), glm::length(alone.record().tissueForce), 0.02);
    EXPECT_LT(glm::distance(dragged, expected), 0.5e-3) << dragged.y << " " << expected.y << " " << left.y;
    EXPECT_LT(glm::distance(left, expected), 0.5e-3);
}

}  // namespace
}  // namespace palpate::haptics
