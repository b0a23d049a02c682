// OpenVDB files of other programs.
#include <tests/error_of.h>
#include <volume/grids.h>
#include <volume/import.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <unistd.h>
#include <glm/geometric.hpp>

#include <filesystem>

namespace palpate::volume {
namespace {

std::filesystem::path written(const openvdb::GridPtrVec& grids)
{
    const auto file = std::filesystem::temp_directory_path() / fmt::format("palpate-foreign-{}.vdb", ::getpid());
    openvdb::io::File(file.string()).write(grids);
    return file;
}

std::string reason(const std::filesystem::path& file)
{
    return tests::errorOf([&] { importLabels(file); });
}

// Label (x + 2 y + 3 z) % 5 in a block that begins at (-2, 1, 3), voxels of 0.5: world units are millimetres.
TEST(ForeignVdb, LabelsComeInWhereTheGridHasThem)
{
    openvdb::initialize();
    const auto grid = openvdb::Int32Grid::create(0);
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.5));
    const auto label = [](int x, int y, int z) { return (x + 2 * y + 3 * z) % 5; };
    forEachIndex(Index3(0), Index3(5, 6, 7), [&](Index3 n) {
        grid->tree().setValueOn(openvdb::Coord(n.x - 2, n.y + 1, n.z + 3), label(n.x, n.y, n.z));
    });
    const ImportedLabels labels = importLabels(written({grid}));
    ASSERT_EQ(labels.image.size, Index3(6, 7, 8));
    forEachIndex(Index3(0), Index3(5, 6, 7),
                 [&](Index3 n) { ASSERT_EQ(labels.image.values[labels.image.offset(n)], label(n.x, n.y, n.z)); });
    EXPECT_NEAR(glm::length(labels.image.affine.toPatient({2, 0, 1}) - 0.5e-3 * Vec3(0, 1, 4)), 0, 1e-12);
    EXPECT_EQ(labels.warnings.size(), 3U);  // unit and frame are assumed, and 3 mm are little for a body
    EXPECT_NE(reason(written({grid, openvdb::FloatGrid::create()})).find("holds 2 grids"), std::string::npos);
    EXPECT_NE(reason(written({openvdb::BoolGrid::create()})).find("not labels"), std::string::npos);
    EXPECT_NE(reason(written({openvdb::FloatGrid::create()})).find("no voxel is set"), std::string::npos);
    std::filesystem::remove(written({grid}));
}

}  // namespace
}  // namespace palpate::volume
