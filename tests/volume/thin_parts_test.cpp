// Parts of a body that are one or two voxels thick.
#include "bodies.h"

#include <volume/tissue.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::volume {
namespace {

using namespace bodies;

// A block of voxels of these edges [m], 20 x 40 x 20, with a flap of so many layers on it, across `axis`.
struct Flap {
    int axis, layers;
    LabelImage image;
    Index3 low{30, 10, 10}, high{49, 49, 29};  // voxels of the flap

    Flap(Vec3 voxel, int acrossAxis, int ofLayers) : axis(acrossAxis), layers(ofLayers)
    {
        const Index3 size(60, 60, 40);
        image = {size, centred({Mat3(voxel.x, 0, 0, 0, voxel.y, 0, 0, 0, voxel.z), Vec3(0.0)}, size), {}};
        image.values.assign(image.offset({0, 0, size.z}), 0);
        low[axis] = 20;
        high[axis] = 19 + layers;
        fill({10, 10, 10}, {29, 49, 29}, 1);
        fill(low, high, 1);
    }
    void fill(Index3 from, Index3 to, std::uint16_t label)
    {
        forEachIndex(from, to, [&](Index3 n) { image.values[image.offset(n)] = label; });
    }
    Tissue tissue() const { return Tissue::fromLabels(image, table(), names(), {}); }
    double middle() const { return image.affine.toPatient(0.5 * Vec3(low + high))[axis]; }  // [m]
};

// The faces of a flap are those of its voxels, from near its root to near its edge. The blur of the surface leaves nothing
// of a single layer: it was a sheet without thickness. A slice is thick enough for a field of longer steps than the other
// edges.
TEST(ThinParts, AreAsThickAsTheirVoxels)
{
    for (const Vec3 voxel : {Vec3(1e-3), Vec3(3e-3), Vec3(0.8e-3, 0.8e-3, 3e-3), Vec3(0.7e-3, 0.7e-3, 3e-3)}) {
        for (const int layers : {1, 2}) {
            const Flap flap(voxel, voxel.z > voxel.x ? 2 : 1, layers);
            const Tissue tissue = flap.tissue();
            const double edge = std::max(std::min(voxel.x, voxel.z), 0.75e-3), across = voxel[flap.axis];
            const DistanceField field = tissue.distanceToBody(coveringGrid(tissue.box(), edge, 4.0 * edge));
            Vec3 out(0.0);
            out[flap.axis] = 1.0;
            for (double along = 31.5; along < 46.0; along += 0.6) {
                Vec3 p = flap.image.affine.toPatient({along, 0.6 * along, 0.4 * along});
                for (const double side : {-1.0, 1.0}) {
                    p[flap.axis] = flap.middle() + side * 0.5 * layers * across;
                    EXPECT_NEAR(field.at(p), 0.0, 0.05 * across) << voxel.x << " " << layers << " " << along;
                    EXPECT_GT(glm::dot(field.normal(p), side * out), 0.99) << voxel.x << " " << layers << " " << along;
                }
                p[flap.axis] = flap.middle();
                EXPECT_LT(field.at(p), -0.3 * across) << voxel.x << " " << layers << " " << along;
            }
        }
    }
}

// They leave the rest of the body's surface where it is: in the corner under the flap, and all around.
TEST(ThinParts, LeaveTheRestAsItIs)
{
    const Vec3 voxel(1e-3);
    const Flap flap(voxel, 1, 1);
    Flap without = flap;
    without.fill(flap.low, flap.high, 0);
    const Tissue tissue = flap.tissue(), rest = without.tissue();
    const NodeGrid grid = coveringGrid(tissue.box(), 1e-3, 4e-3);
    const DistanceField with = tissue.distanceToBody(grid), plain = rest.distanceToBody(grid);
    const double face = flap.image.affine.toPatient(Vec3(29.5, 0.0, 0.0)).x;
    for (std::size_t i = 0; i < with.values.size(); ++i) {
        const Vec3 p = grid.position(grid.node(i));
        if (p.x < face - 3e-3) {
            ASSERT_NEAR(with.values[i], plain.values[i], 0.03e-3) << p.x << " " << p.y << " " << p.z;
        }
        if (plain.values[i] < 2e-3F) {
            ASSERT_LE(with.values[i], plain.values[i] + 0.1e-3F) << p.x << " " << p.y << " " << p.z;
        }
    }
}

// Specks of a segmentation beside the body are none of it.
TEST(ThinParts, AreNoSpecks)
{
    Flap speckled(Vec3(1e-3), 1, 1);
    speckled.fill(speckled.low, speckled.high, 0);
    speckled.fill({40, 20, 20}, {46, 20, 26}, 1);  // 49 voxels
    const Tissue tissue = speckled.tissue();
    const DistanceField field = tissue.distanceToBody(coveringGrid(tissue.box(), 1e-3, 4e-3));
    EXPECT_GE(field.at(speckled.image.affine.toPatient(Vec3(43, 20, 23))), 0.0);
}

// A cell has the share of a plate that lies in it. One that lies outside has nothing, though samples between voxels give it
// some: plates of two layers of 3 mm were up to 36 % too stiff, of one layer up to 206 %.
TEST(ThinParts, FillTheCellsThatTheyAreIn)
{
    for (const auto& [voxel, layers] : {std::pair(3e-3, 1), {3e-3, 2}, {2e-3, 1}, {2e-3, 2}, {1e-3, 1}, {1e-3, 2}}) {
        const Index3 size(static_cast<int>(60e-3 / voxel));
        LabelImage image{size, centred({Mat3(voxel), Vec3(0.0)}, size), {}};
        image.values.assign(image.offset({0, 0, size.z}), 0);
        forEachIndex({0, 8, 0}, {size.x - 1, 7 + layers, size.z - 1}, [&](Index3 n) { image.values[image.offset(n)] = 1; });
        const Tissue tissue = Tissue::fromLabels(image, table(), names(), {});
        const DistanceField surface = tissue.distanceToBody({size, image.affine.origin, voxel});
        const double whole = tissue.table().rows[1].youngsModulus, face = image.affine.origin.y + 7.5 * voxel;
        for (const double spacing : {1.5e-3, 2e-3, 4e-3}) {
            for (double shift = 0.0; shift < spacing; shift += 0.25e-3) {
                const NodeGrid cells{{5, 12, 5}, Vec3(0.0, face + shift - 4.5 * spacing, 0.0), spacing};
                const auto material = tissue.materialOn(cells, surface);
                for (int j = 0; j < cells.size.y; ++j) {
                    const double low = cells.position({0, j, 0}).y - 0.5 * spacing - face;
                    const double share =
                        std::max(0.0, std::min(low + spacing, layers * voxel) - std::max(low, 0.0)) / spacing;
                    const double found = static_cast<double>(material[cells.offset({0, j, 0})].youngsModulus) / whole;
                    // A sliver counts as a quarter.
                    const double bound = share > 0.0 && share < 0.25 ? 0.2 : share > 0.0 ? 0.07 : 0.01;
                    EXPECT_NEAR(found, share, bound)
                        << voxel << " x " << layers << " " << spacing << " " << shift << " " << j;
                }
            }
        }
    }
}

}  // namespace
}  // namespace palpate::volume
