#include "elastic_bodies.h"

#include <chainmail/loose_pieces.h>

#include <gtest/gtest.h>

namespace palpate::chainmail {
namespace {

// Three blocks with air between them: one on bone, one loose, and a crumb. The loose one is held by its hindmost layer
// alone.
TEST(LoosePieces, LieOnTheirBacks)
{
    const volume::NodeGrid cells{Index3(40, 20, 12), Vec3(0.0), 2e-3};
    const auto blockOf = [](Index3 c) {
        return c.z < 2 || c.z > 9 || c.y < 3 || c.y > 16 ? -1 : c.x < 12 ? 0 : c.x < 14 ? -1 : c.x < 30 ? 1 : -1;
    };
    std::vector<volume::CellMaterial> materials(cells.count());
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const Index3 c = cells.node(i);
        const bool isCrumb = c.x >= 34 && c.x < 37 && c.y == 10 && c.z == 6;
        const bool isBone = blockOf(c) == 0 && c.y > 14;
        materials[i] = isCrumb || blockOf(c) >= 0 ? tests::tissue(5e3, 0.45, isBone) : volume::CellMaterial{};
    }
    auto held = materials;
    EXPECT_EQ(holdLoosePieces(cells, held, {}), 1);
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const Index3 c = cells.node(i);
        EXPECT_EQ(held[i].fixed, blockOf(c) == 1 && c.y == 16 ? 1.0F : materials[i].fixed);
    }
    // What lies behind a support is held already.
    const volume::Support support{{0, 30e-3, 0}, {0, -1, 0}};
    held = materials;
    EXPECT_EQ(holdLoosePieces(cells, held, support), 0);
}

}  // namespace
}  // namespace palpate::chainmail
