#include <render/deformation.h>
#include <render/view_frame.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <array>
#include <random>

namespace palpate::render {
namespace {

channel::Scenery planned(glm::dvec3 entry, glm::dvec3 aim)
{
    channel::Scenery scenery;
    scenery.labels.size = {10, 10, 10};
    scenery.labels.spacing = 0.01;
    scenery.entry = {entry.x, entry.y, entry.z};
    scenery.aim = {aim.x, aim.y, aim.z};
    return scenery;
}

void expectRightHanded(const ViewFrame& f)
{
    EXPECT_NEAR(glm::distance(glm::cross(f.right, f.up), f.towards), 0, 1e-12);
    EXPECT_NEAR(glm::length(f.right), 1, 1e-12);
    EXPECT_NEAR(glm::length(f.up), 1, 1e-12);
    EXPECT_NEAR(glm::dot(f.right, f.up), 0, 1e-12);
}

// Radiologists look at an axial slice from the feet: patient left is on the right, front is on top.
TEST(ViewFrame, ALineFromTheFrontGivesTheRadiologistsAxialSlice)
{
    const ViewFrame f = viewFrame(planned({0, -0.05, 0}, {0, 0, 0}));
    EXPECT_EQ(side(f.right), "L");
    EXPECT_EQ(side(-f.right), "R");
    EXPECT_EQ(side(f.up), "A");
    EXPECT_EQ(side(f.towards), "I");
}

TEST(ViewFrame, ALineFromTheHeadGivesASagittalSliceWithTheFrontOnTheLeft)
{
    const ViewFrame f = viewFrame(planned({0, 0, 0.05}, {0, 0, 0}));
    EXPECT_EQ(side(f.up), "S");
    EXPECT_EQ(side(-f.right), "A");
}

TEST(ViewFrame, HoldsThePlannedLineAndTheToolForAnyDirection)
{
    std::mt19937 random(1);
    std::normal_distribution<double> normal;
    const auto direction = [&] { return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random))); };
    for (int i = 0; i < 500; ++i) {
        const glm::dvec3 line = direction(), tip = 0.05 * direction(), axis = glm::normalize(line + 0.4 * direction());
        const ViewFrame plan = viewFrame(planned({0, 0, 0}, 0.04 * line));
        expectRightHanded(plan);
        EXPECT_NEAR(glm::dot(line, plan.towards), 0, 1e-9);
        const ViewFrame tool = through(plan, tip, axis);
        expectRightHanded(tool);
        EXPECT_NEAR(glm::dot(axis, tool.towards), 0, 1e-9);
        EXPECT_NEAR(glm::dot(tip - tool.centre, tool.towards), 0, 1e-12);
    }
}

// Axial from the feet, sagittal from the left, coronal from the front; the point lies in all three.
TEST(ViewFrame, OrthogonalFramesAreTheRadiologists)
{
    const glm::dvec3 tip(0.01, -0.02, 0.03);
    const auto frames = orthogonalFrames(viewFrame(planned({0.01, -0.05, 0.02}, {0, 0, 0})), tip);
    const std::array<std::array<const char*, 3>, 3> sides{{{"L", "A", "I"}, {"P", "S", "L"}, {"L", "S", "A"}}};
    for (std::size_t i = 0; i < frames.size(); ++i) {
        expectRightHanded(frames[i]);
        EXPECT_EQ(side(frames[i].right), sides[i][0]);
        EXPECT_EQ(side(frames[i].up), sides[i][1]);
        EXPECT_EQ(side(frames[i].towards), sides[i][2]);
        EXPECT_NEAR(glm::dot(tip - frames[i].centre, frames[i].towards), 0, 1e-12);
    }
}

TEST(ViewFrame, AnObliqueSideHasTwoLetters)
{
    EXPECT_EQ(side(glm::normalize(glm::dvec3(1, 0.8, 0))), "LP");
    EXPECT_EQ(side(glm::normalize(glm::dvec3(-1, 0.1, -0.2))), "R");
    EXPECT_EQ(side({0, 0, -1}), "I");
}

}  // namespace
}  // namespace palpate::render
