#include <session/deformed_state.h>

#include <session/devices.h>
#include <session/open.h>
#include <session/session.h>
#include <tests/folder.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>

namespace palpate::session {
namespace {

// A quarter of a spacing off the outermost nodes is still tissue. Programs that mix a node without tissue into it find the
// same displacement there as we do, who leave that node out: u = 3/4 of the tissue's and 1/4 of the node's beyond.
TEST(DeformedState, DisplacementsGoOnOffTheTissue)
{
    const tests::Folder folder;
    const std::string file = folder / "s.db";
    SceneChanges changes;
    changes.setting = "fast";
    {
        const haptics::SessionModel model = openSession("near-vessel", changes);
        const haptics::SessionInfo info = describeSession(model, "near-vessel", "hand");
        haptics::Recorder recorder(file, info);
        Session session(model, info);
        session.run(*openDevice(model, {}, nullptr), {.servo = {.paced = false, .seconds = 4.0}, .recorder = &recorder});
    }
    const DeformedState state(file, 3.5, {});
    const chainmail::Lattice& lattice = state.model().lattice;
    const std::vector<Vec3f> u = state.displacement();
    double largest = 0.0, apart = 0.0;
    for (const chainmail::Node n : state.shape().moved()) {
        ASSERT_EQ(u[n], 1e3F * state.shape().u()[n]);
        largest = std::max(largest, static_cast<double>(glm::length(u[n])));
        for (int side = 0; side < 6; ++side) {
            const chainmail::Node beyond = lattice.beside(n, side);
            if (!lattice.isNode(beyond)) {
                apart = std::max(apart, 0.25 * static_cast<double>(glm::length(u[beyond] - u[n])));
            }
        }
    }
    EXPECT_GT(largest, 0.3);
    EXPECT_LT(apart, 0.05 * largest);
}

}  // namespace
}  // namespace palpate::session
