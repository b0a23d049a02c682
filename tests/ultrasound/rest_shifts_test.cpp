#include <channel/deformation.h>
#include <ultrasound/medium.h>
#include <ultrasound/rest_shifts.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

namespace palpate::ultrasound {
namespace {

constexpr int side = 41, nodes = 21;  // of 1 mm and 2 mm

// A box of tissue whose nodes are displaced by u(X).
struct Box {
    explicit Box(const std::function<glm::dvec3(glm::dvec3)>& u)
    {
        scenery.labels = {{side, side, side}, 0, {0, 0, 0}, 1e-3};
        scenery.lattice = {{nodes, nodes, nodes}, 0, {0, 0, 0}, 2e-3};
        labels.assign(static_cast<std::size_t>(side) * side * side, 1);
        body = std::make_unique<channel::Deformation>(scenery, labels);
        medium = std::make_unique<Medium>(scenery, labels, labels);
        const auto out = std::make_unique<channel::Displaced>();
        for (std::uint32_t i = 0; i < nodes * nodes * nodes; ++i) {
            const glm::dvec3 d = u(2e-3 * glm::dvec3(i % nodes, i / nodes % nodes, i / nodes / nodes));
            out->nodes[out->count++] = {i, {static_cast<float>(d.x), static_cast<float>(d.y), static_cast<float>(d.z)}};
        }
        body->apply(*out);
    }

    // The furthest that a net of every fourth column leaves the exact rest point by [mm].
    double worst() const
    {
        const Pose pose = poseOf({20e-3, 20e-3, 5e-3}, {0, 0, 1}, {1, 0, 0});
        const Beam beam(linearProbe(), settingsOf(linearProbe()));
        const View view(beam, pose, *body, *medium);
        constexpr int columns = 102, rows = 30;  // 0.2 mm and 0.8 mm apart
        const auto point = [](int column, int row) { return glm::vec3(0.2e-3 * column - 10e-3, 0.3e-3, 0.8e-3 * row); };
        RestShifts net;
        net.solve(view, columns, 4, rows, point);
        double most = 0;
        for (int r = 0; r < rows; ++r)
            for (int c = 0; c < columns; ++c) {
                glm::vec3 shift(0);
                view.follow(point(c, r), shift);
                const glm::vec3 exact = view.voxel(point(c, r), shift);
                most = std::max(most, static_cast<double>(glm::distance(net.voxel(view, point(c, r), c, r), exact)));
            }
        return most;
    }

    channel::Scenery scenery;
    std::vector<std::uint8_t> labels;
    std::unique_ptr<channel::Deformation> body;
    std::unique_ptr<Medium> medium;
};

// Newton's method stops at a hundredth of a millimetre; nothing else is between an affine map and its net.
TEST(RestShifts, AnAffineMapIsExact)
{
    EXPECT_EQ(Box([](glm::dvec3) { return glm::dvec3(0); }).worst(), 0);
    EXPECT_LT(Box([](glm::dvec3 x) { return glm::dvec3(0.1 * x.x + 0.05 * x.z, 0, 0.08 * x.z - 0.03 * x.x); }).worst(),
              0.03);
}

// Between two solved points h apart a linear rule misses at most h^2 / 8 of the second derivative; within a cell of the
// lattice that of the inverse is small, at its faces the slope jumps by a spacing's fraction of it: h / 4 of the jump.
TEST(RestShifts, AWaveIsWithinItsCurvature)
{
    constexpr double amplitude = 1.5e-3, length = 20e-3, k = 6.2831853 / length;
    const Box box([&](glm::dvec3 x) { return glm::dvec3(0, 0, amplitude * std::sin(k * x.x)); });
    constexpr double apart = 0.8e-3, spacing = 2e-3, jump = amplitude * k * k * spacing;
    EXPECT_LT(box.worst(), 1e3 * (apart / 4 * jump) + 0.03);
}

// Tissue that is torn apart by a slit: points of both sides are never mixed.
TEST(RestShifts, SidesOfASlitAreSolvedByThemselves)
{
    const Box box([](glm::dvec3 x) { return glm::dvec3(0, 0, x.x < 20.5e-3 ? 0.0 : 3e-3); });
    EXPECT_LT(box.worst(), RestShifts::apart / 4 * 2 + 0.03);
}

// A probe may be anywhere, and no place is an index before it is known to be one.
TEST(Medium, FarAwayNothingIsKnown)
{
    channel::Scenery scenery;
    scenery.fine = {{side, side, side}, 0, {0, 0, 0}, 1e-3};
    const std::vector<std::uint8_t> labels(static_cast<std::size_t>(side) * side * side, 1);
    const Medium medium(scenery, {}, labels);
    constexpr float far = 1e12F;
    for (const float x : {-far, -1.0F, 41.0F, 70000.0F, 3e9F, far, std::numeric_limits<float>::infinity(),
                          std::numeric_limits<float>::quiet_NaN()}) {
        for (int axis = 0; axis < 3; ++axis) {
            glm::vec3 v(20.0F);
            v[axis] = x;
            EXPECT_EQ(medium.label(v), unknown) << x;
            EXPECT_EQ(medium.impedanceAt(v).slope, glm::vec3(0)) << x;
        }
    }
    EXPECT_EQ(medium.label(glm::vec3(20.0F)), 1 | pureBit);
}

}  // namespace
}  // namespace palpate::ultrasound
