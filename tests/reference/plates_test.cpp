// Thin plates of one tissue in another: what the smoothing of labels must not take from them.
#include <datasets/tables.h>
#include <reference/label_pieces.h>
#include <reference/smooth_labels.h>
#include <reference/volume_mesh.h>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace palpate::reference {
namespace {

// A block of fat in which `gland` says where there is gland, by the number of a voxel.
volume::Tissue blockWith(Index3 size, Vec3 voxel, const std::function<bool(Index3)>& gland)
{
    volume::LabelImage image;
    image.size = size;
    image.affine.linear = Mat3(Vec3(voxel.x, 0, 0), Vec3(0, voxel.y, 0), Vec3(0, 0, voxel.z));
    volume::forEachIndex(Index3(0), size - 1, [&](Index3 n) { image.values.push_back(gland(n) ? 2 : 1); });
    const std::vector<volume::LabelName> names{{1, "fat", "fat"}, {2, "gland", "gland"}};
    return volume::Tissue::fromLabels(image, datasets::defaultTissues(), names, {});
}

// A plate from side to side in voxels of 1 mm, `thick` voxels thick, whose normal leans by `degrees` from y.
volume::Tissue plate(int thick, double degrees)
{
    const double slope = std::tan(degrees * std::numbers::pi / 180.0);
    return blockWith({24, 20, 24}, Vec3(1e-3), [&](Index3 n) {
        const int low = 10 + static_cast<int>(std::floor(slope * (n.x - 12) + 0.25 * slope * n.z));
        return n.y >= low && n.y < low + thick;
    });
}

// Volume of each region, on a grid so fine along y that a fiftieth of a voxel shows.
std::vector<double> fineVolumes(const SmoothLabels& labels)
{
    constexpr int fine = 50;
    std::vector<double> volume(labels.rows.size(), 0.0);
    volume::forEachIndex(Index3(0), labels.size * Index3(1, fine, 1) - 1, [&](Index3 n) {
        const Vec3 at = (Vec3(n) + 0.5) / Vec3(1, fine, 1) - 0.5 + Vec3(labels.low);
        if (const int region = regionAt(labels, labels.affine.toPatient(at)); region >= 0) {
            volume[static_cast<std::size_t>(region)] += labels.affine.voxelVolume() / fine;
        }
    });
    return volume;
}

TEST(Plates, OfOneToThreeVoxelsKeepTheirVolumeInSmoothLabels)
{
    for (const double degrees : {0.0, 5.0}) {
        for (int thick = 1; thick <= 3; ++thick) {
            const SmoothLabels labels = smoothLabels(plate(thick, degrees), Keep::all);
            const auto volume = fineVolumes(labels);
            for (std::size_t r = 0; r < volume.size(); ++r) {
                EXPECT_NEAR(volume[r] / labels.volume[r], 1.0, 0.02) << thick << " voxels, " << degrees << " degrees";
            }
        }
    }
}

// A plate asked to be thicker by less than the distance of two points becomes so, and not by a whole layer of points.
TEST(Plates, TakeAnyVolumeThatIsWanted)
{
    for (const double factor : {0.9, 0.98, 1.03, 1.1}) {
        SmoothLabels labels = smoothLabels(plate(2, 0.0), Keep::all);
        ASSERT_EQ(labels.rows.size(), 2U);
        std::vector<double> wanted = labels.volume;
        const std::size_t thin = wanted[0] < wanted[1] ? 0 : 1;
        wanted[1 - thin] -= (factor - 1.0) * wanted[thin];
        wanted[thin] *= factor;
        fitVolumes(labels, wanted);
        EXPECT_NEAR(fineVolumes(labels)[thin] / wanted[thin], 1.0, 0.01) << factor;
    }
}

TEST(Plates, OfOneToThreeVoxelsKeepTheirVolumeInMeshes)
{
    VolumeMeshOptions options;
    options.size = 3e-3;
    options.largest = 7.5e-3;
    options.tetgen.program = PALPATE_BIN_DIR "/palpate-mesh";
    for (const double degrees : {0.0, 5.0}) {
        for (int thick = 1; thick <= 3; ++thick) {
            const VolumeMesh made = meshVolume(plate(thick, degrees), options);
            for (const TissueQuality& t : made.quality.tissues) {
                EXPECT_LT(std::abs(t.percent()), 2.0) << thick << " voxels, " << degrees << " degrees, row " << int{t.row};
            }
            EXPECT_GT(made.quality.minDihedral, 5.0) << thick << " voxels, " << degrees << " degrees";
            EXPECT_EQ(made.quality.flipped + made.quality.overShared, 0U);
        }
    }
}

// Of 40 x 40 voxels of 1 x 1 x 5 mm, one layer: V = 8000, two faces of 1600 and four of 200 mm^2, so 2 V / S = 4 mm. Three
// layers below and above have V = 24000, two faces of 1600 and four of 600 mm^2 each: both pieces together 8.57 mm.
TEST(Plates, OfLongVoxelsAreAsThickAsTheirVolumeAndSurfaceSay)
{
    const auto tissue = blockWith({40, 40, 7}, Vec3(1e-3, 1e-3, 5e-3), [](Index3 n) { return n.z == 3; });
    const auto thick = thicknesses(smoothLabels(tissue, Keep::all));
    ASSERT_EQ(thick.size(), 2U);
    EXPECT_NEAR(thick[0], 2.0 * 24000.0 / 5600.0 * 1e-3, 1e-6);
    EXPECT_NEAR(thick[1], 4e-3, 1e-6);
}

}  // namespace
}  // namespace palpate::reference
