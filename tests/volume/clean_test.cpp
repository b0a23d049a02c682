#include "bodies.h"

#include <volume/clean.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

namespace palpate::volume {
namespace {

using namespace bodies;

LabelImage empty(Index3 size, double voxel = 1e-3)
{
    return {size, {Mat3(voxel), Vec3(0.0)}, std::vector<std::uint16_t>(LabelImage{size, {}, {}}.offset({0, 0, size.z}), 0)};
}

void fill(LabelImage& image, Index3 low, Index3 high, std::uint16_t value)
{
    forEachIndex(low, high, [&](Index3 n) { image.values[image.offset(n)] = value; });
}

std::uint64_t count(const LabelImage& image, std::uint16_t value)
{
    return static_cast<std::uint64_t>(std::count(image.values.begin(), image.values.end(), value));
}

std::vector<std::uint8_t> marked(std::initializer_list<std::uint16_t> labels)
{
    std::vector<std::uint8_t> out(65536, 0);
    for (const std::uint16_t v : labels) {
        out[v] = 1;
    }
    return out;
}

SkinLabels skinIs(std::uint16_t label)
{
    return {marked({0}), label, marked({label})};
}

TEST(LargestPiece, IslandsBecomeWhatIsAroundThem)
{
    LabelImage image = empty(Index3(20));
    fill(image, {2, 2, 2}, {17, 17, 17}, 1);     // a block of tissue
    fill(image, {4, 4, 4}, {8, 8, 8}, 7);        // the organ: 125 voxels
    fill(image, {12, 12, 12}, {13, 13, 13}, 7);  // 8 voxels of it inside the tissue
    fill(image, {0, 0, 0}, {0, 0, 0}, 7);        // and one outside
    fill(image, {9, 9, 9}, {9, 9, 9}, 7);        // touches the organ by a corner only
    const std::vector<Relabelled> report = keepLargestPieces(image, marked({7}));
    EXPECT_EQ(count(image, 7), 125U);
    EXPECT_EQ(image.values[image.offset({12, 12, 12})], 1);
    EXPECT_EQ(image.values[image.offset({9, 9, 9})], 1);
    EXPECT_EQ(image.values[image.offset({0, 0, 0})], 0);
    ASSERT_EQ(report.size(), 1U);
    EXPECT_EQ(report[0].value, 7);
    EXPECT_EQ(report[0].voxels, 10U);
    EXPECT_EQ(report[0].pieces, 3U);
}

// Gives neighbours of one value the lower of their pieces; returns whether anything changed.
bool spread(const LabelImage& image, std::vector<std::size_t>& piece)
{
    bool changed = false;
    forEachIndex(Index3(0), image.size - 1, [&](Index3 n) {
        for (int axis = 0; axis < 3; ++axis) {
            Index3 next = n;
            ++next[axis];
            const std::size_t a = image.offset(n);
            const std::size_t b = next[axis] < image.size[axis] ? image.offset(next) : a;
            if (image.values[a] == image.values[b] && piece[a] != piece[b]) {
                piece[a] = piece[b] = std::min(piece[a], piece[b]);
                changed = true;
            }
        }
    });
    return changed;
}

// Pieces of random voxels by an independent method: labels are spread to neighbours until nothing changes.
TEST(LargestPiece, AgreesWithFloodingOnNoise)
{
    std::mt19937 random(5);
    for (int trial = 0; trial < 5; ++trial) {
        LabelImage image = empty({13, 11, 9});
        for (auto& v : image.values) {
            v = static_cast<std::uint16_t>(random() % 3);
        }
        std::vector<std::size_t> piece(image.values.size());
        for (std::size_t i = 0; i < piece.size(); ++i) {
            piece[i] = i;
        }
        while (spread(image, piece)) {
        }
        std::map<std::uint16_t, std::map<std::size_t, std::uint64_t>> sizes;
        for (std::size_t i = 0; i < piece.size(); ++i) {
            ++sizes[image.values[i]][piece[i]];
        }
        LabelImage cleaned = image;
        const auto report = keepLargestPieces(cleaned, marked({1, 2}));
        ASSERT_EQ(report.size(), 2U);
        for (const Relabelled& line : report) {
            const auto& all = sizes[line.value];
            const auto largest =
                std::max_element(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
            EXPECT_EQ(line.pieces, all.size() - 1);
            std::uint64_t kept = 0;
            for (std::size_t i = 0; i < piece.size(); ++i) {
                const bool whole = image.values[i] == line.value && piece[i] == largest->first;
                kept += whole && cleaned.values[i] == line.value ? 1 : 0;
            }
            EXPECT_EQ(kept, largest->second);
        }
    }
}

// A loose piece in a loose piece in air: both become air. What is one piece for each label has nothing loose any more.
TEST(LargestPiece, NoLoosePieceComesOfAnother)
{
    LabelImage image = empty(Index3(40));
    fill(image, {2, 2, 2}, {11, 11, 11}, 1);
    fill(image, {2, 2, 14}, {11, 11, 23}, 2);
    fill(image, {25, 25, 25}, {31, 31, 31}, 2);
    fill(image, {27, 27, 27}, {29, 29, 29}, 1);
    EXPECT_EQ(keepLargestPieces(image, marked({1, 2})).size(), 2U);
    EXPECT_EQ(count(image, 1), 1000U);
    EXPECT_EQ(count(image, 2), 1000U);

    std::mt19937 random(8);
    for (const unsigned labels : {2U, 3U, 5U}) {
        LabelImage noise = empty({23, 19, 17});
        for (auto& v : noise.values) {
            v = static_cast<std::uint16_t>(1 + random() % labels);
        }
        keepLargestPieces(noise, marked({1, 2, 3, 4, 5}));
        EXPECT_TRUE(keepLargestPieces(noise, marked({1, 2, 3, 4, 5})).empty()) << labels;
    }
}

// A ball of radius R with a layer of thickness t. The outside voxel nearest to a place r from the middle is at least R - r
// away, and less than a voxel's diagonal further.
TEST(AddSkin, IsAsThickAsAskedForAtAnySpacing)
{
    const double radius = 15e-3, thickness = 3e-3;
    for (const Vec3 spacing : {Vec3(1e-3), Vec3(0.5e-3, 1e-3, 1.5e-3)}) {
        const Index3 size(glm::ceil(36e-3 / spacing));
        const Affine affine = centred(oblique(spacing, Vec3(0.0), true), size);
        LabelImage image = voxelise(size, affine, [&](Vec3 p) { return glm::length(p) < radius ? 1 : 0; });
        const LabelImage before = image;
        const auto taken = addSkin(image, skinIs(2), thickness).taken;
        ASSERT_EQ(taken.size(), 1U);
        EXPECT_EQ(taken[0].voxels, count(image, 2));
        EXPECT_EQ(count(image, 1) + count(image, 2), count(before, 1));
        forEachIndex(Index3(0), size - 1, [&](Index3 n) {
            const double r = glm::length(affine.toPatient(Vec3(n)));
            if (r < radius - thickness - 1e-9) {
                EXPECT_EQ(image.values[image.offset(n)], 1) << r;
            } else if (r < radius && r > radius - thickness + glm::length(spacing)) {
                EXPECT_EQ(image.values[image.offset(n)], 2) << r;
            }
        });
    }
}

// As many whole voxels as the thickness holds, one at least, along each axis; and it says how thick that is.
TEST(AddSkin, CoversEveryFaceOfCoarseVoxels)
{
    LabelImage image = empty({60, 60, 40});
    image.affine.linear = Mat3(0.7e-3, 0, 0, 0, 0.7e-3, 0, 0, 0, 3e-3);
    fill(image, {10, 10, 10}, {49, 49, 29}, 1);
    addSkin(image, skinIs(2), 1.75e-3);
    EXPECT_EQ(count(image, 1), 36U * 36U * 18U);

    for (const auto& [asked, voxels] : {std::pair(0.3e-3, 1), {1.5e-3, 1}, {2e-3, 2}, {3.9e-3, 3}}) {
        LabelImage cube = empty(Index3(40));
        fill(cube, Index3(10), Index3(29), 1);
        const AddedSkin added = addSkin(cube, skinIs(2), asked);
        const auto inner = static_cast<std::uint64_t>(20 - 2 * voxels);
        EXPECT_EQ(count(cube, 1), inner * inner * inner) << asked;
        EXPECT_NEAR(added.thickness, 1e-3 * voxels, 1e-9) << asked;
    }
    LabelImage small = empty(Index3(9));
    fill(small, Index3(3), Index3(5), 1);
    EXPECT_EQ(addSkin(small, skinIs(2), 5e-3).thickness, 0.0) << "all of it is skin";
}

// Air inside, as in a lung, and the cut at the volume's border get no skin.
TEST(AddSkin, OnlyTheOutsideGetsSkin)
{
    LabelImage image = empty(Index3(30));
    fill(image, {5, 5, 0}, {24, 24, 29}, 1);     // a column that the volume cuts above and below
    fill(image, {12, 12, 12}, {16, 16, 16}, 0);  // a hollow
    addSkin(image, skinIs(2), 2e-3);
    EXPECT_EQ(count(image, 2), 30U * (20 * 20 - 16 * 16));
    EXPECT_EQ(image.values[image.offset({11, 14, 14})], 1);
    EXPECT_EQ(image.values[image.offset({14, 14, 0})], 1);
}

TEST(CloseSkinHoles, SmallHolesAreClosedAndLargeOnesReported)
{
    LabelImage image = empty(Index3(40));
    fill(image, {4, 4, 4}, {35, 35, 35}, 1);
    addSkin(image, skinIs(2), 2e-3);
    const LabelImage whole = image;
    fill(image, {10, 10, 4}, {12, 12, 5}, 1);  // 3 x 3 voxels: 3 x 3 x 1 mm, 4.4 mm across
    fill(image, {20, 20, 4}, {29, 29, 5}, 1);  // 10 x 10: 14.2 mm across
    LabelImage closed = image;
    const ClosedHoles report = closeSkinHoles(closed, skinIs(2), 5e-3);
    EXPECT_EQ(report.closed, 1U);
    EXPECT_EQ(report.left, 1U);
    EXPECT_NEAR(report.largestLeft, 1e-3 * std::sqrt(201.0), 1e-9);
    EXPECT_EQ(count(image, 1) - count(closed, 1), report.taken.at(0).voxels);
    EXPECT_EQ(closed.values[closed.offset({11, 11, 4})], 2);
    EXPECT_EQ(closed.values[closed.offset({25, 25, 4})], 1);
    LabelImage both = image;
    EXPECT_EQ(closeSkinHoles(both, skinIs(2), 20e-3).left, 0U);
    forEachIndex(Index3(0), both.size - 1, [&](Index3 n) {
        if (n.z == 4 || n.z == 5) {
            EXPECT_EQ(both.values[both.offset(n)], whole.values[whole.offset(n)]);
        }
    });
    LabelImage again = whole;
    EXPECT_EQ(closeSkinHoles(again, skinIs(2), 20e-3).closed, 0U);
    EXPECT_EQ(again.values, whole.values);
}

// A hole of 6 mm in the skin of a ball, along an axis and along the diagonal of the voxels: it is filled as deep as the
// skin, whose thickness is known, and hardly anything else.
TEST(CloseSkinHoles, AreFilledAsDeepAsTheSkinIsThick)
{
    const Index3 size(110);
    const Affine affine = centred({Mat3(1e-3), Vec3(0.0)}, size);
    for (const Vec3 along : {Vec3(1, 0, 0), Vec3(1, 1, 1), Vec3(1, 2, 0)}) {
        const Vec3 u = glm::normalize(along);
        const auto inHole = [&](Vec3 p) { return glm::dot(p, u) > 0 && glm::length(p - glm::dot(p, u) * u) < 3e-3; };
        for (const double thickness : {2e-3, 4e-3}) {
            const auto body = [&](Vec3 p) {
                const double depth = 50e-3 - glm::length(p);
                return depth <= 0 ? 0 : depth <= thickness ? 2 : 1;
            };
            const LabelImage whole = voxelise(size, affine, body);
            LabelImage image = voxelise(size, affine, [&](Vec3 p) { return body(p) == 2 && inHole(p) ? 1 : body(p); });
            const auto hole = count(whole, 2) - count(image, 2);
            const ClosedHoles report = closeSkinHoles(image, skinIs(2), 10e-3);
            EXPECT_EQ(report.closed, 1U);
            EXPECT_NEAR(report.thickness, thickness, 0.3e-3);
            std::uint64_t open = 0, beside = 0;
            for (std::size_t i = 0; i < image.values.size(); ++i) {
                open += whole.values[i] == 2 && image.values[i] != 2 ? 1 : 0;
                beside += whole.values[i] != 2 && image.values[i] == 2 ? 1 : 0;
            }
            EXPECT_LT(static_cast<double>(open), 0.15 * static_cast<double>(hole));
            EXPECT_LT(static_cast<double>(beside), 0.25 * static_cast<double>(hole));
        }
    }
}

// Every voxel keeps its value at its place in the patient.
TEST(CropAndPad, VoxelsStayWhereTheyAre)
{
    std::mt19937 random(9);
    LabelImage image = empty({9, 8, 7});
    image.affine = oblique({1e-3, 2e-3, 3e-3}, {0.1, -0.2, 0.3}, true);
    for (auto& v : image.values) {
        v = static_cast<std::uint16_t>(1 + random() % 60000);
    }
    const Index3 low(2, 1, 3), high(6, 7, 5);
    const LabelImage part = cropped(image, low, high);
    EXPECT_EQ(part.size, high - low + 1);
    forEachIndex(Index3(0), part.size - 1, [&](Index3 n) {
        EXPECT_EQ(part.values[part.offset(n)], image.values[image.offset(n + low)]);
        EXPECT_LT(glm::length(part.affine.toPatient(Vec3(n)) - image.affine.toPatient(Vec3(n + low))), 1e-12);
    });
    const Index3 by(1, 2, 3);
    const LabelImage wide = padded(image, by);
    const LabelImage back = cropped(wide, by, by + image.size - 1);
    EXPECT_EQ(back.values, image.values);
    EXPECT_LT(glm::length(back.affine.origin - image.affine.origin), 1e-12);
    EXPECT_EQ(count(wide, 0), wide.values.size() - image.values.size());
}

}  // namespace
}  // namespace palpate::volume
