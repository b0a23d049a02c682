#include "slabs.h"

#include <haptics/biopsy.h>

#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include <cmath>
#include <numbers>

namespace palpate::haptics {
namespace {

using tests::LoneNeedle;
using tests::rowOf;

// Fat with a plate of tumour from 20 to 28 mm; tip at y, the notch lies from y + 2 mm to y + 22 mm.
const SessionModel& plate()
{
    static const auto model = tests::boxOf(tests::layers({{"fat", 20e-3}, {"idc_high_grade", 8e-3}, {"fat", 1}}),
                                           "idc_high_grade", tests::chainmailOnly);
    return model;
}

std::size_t row(const SessionModel& model, const char* name)
{
    return *model.tissue->table().find(name);
}

double notchVolume(const SessionModel& model)
{
    const auto& t = model.scene.tool;
    return std::numbers::pi * t.notchRadius * t.notchRadius * t.notchLength;
}

// The notch crosses the plate: 8 of its 20 mm, in three pieces, as fat and carcinoma part at both faces.
TEST(Biopsy, CoreThroughAPlateInClosedForm)
{
    const LoneNeedle needle(plate());
    const auto core = takeCore(plate(), needle.reader, needle.body, {}, {0, 12e-3, 0}, {0, 1, 0});
    EXPECT_NEAR(core.targetLength, 8e-3, 0.25e-3);
    EXPECT_NEAR(core.fraction[row(plate(), "idc_high_grade")], 0.4, 0.0126);
    EXPECT_NEAR(core.fraction[row(plate(), "fat")], 0.6, 0.0126);
    EXPECT_NEAR(core.targetFraction, 0.4, 0.0126);
    EXPECT_NEAR(core.volume, notchVolume(plate()), 1e-15);
    EXPECT_EQ(core.fragments, 3U);
}

// Slanted by 60 degrees the notch has twice the length in the plate.
TEST(Biopsy, SlantedCoreIsLongerInTheLesion)
{
    const LoneNeedle needle(plate());
    const Vec3 axis(std::sin(std::numbers::pi / 3), std::cos(std::numbers::pi / 3), 0);
    const Vec3 middle(0, 24e-3, 0);
    const auto core = takeCore(plate(), needle.reader, needle.body, {}, middle - 12e-3 * axis, axis);
    EXPECT_NEAR(core.targetLength, 16e-3, 1e-3);
}

// Within one tissue, and across fat and gland, which are equally stiff, a core stays whole.
TEST(Biopsy, CoreBreaksOnlyWhereSoftMeetsStiff)
{
    const auto model = tests::boxOf(tests::layers({{"fat", 20e-3}, {"gland", 10e-3}, {"idc_high_grade", 1}}), "gland",
                                    tests::chainmailOnly);
    const LoneNeedle needle(model);
    EXPECT_EQ(takeCore(model, needle.reader, needle.body, {}, {0, 6e-3, 0}, {0, 1, 0}).fragments, 1U);
    EXPECT_EQ(takeCore(model, needle.reader, needle.body, {}, {0, 18e-3, 0}, {0, 1, 0}).fragments, 2U);
    // Half in the air: one piece.
    const auto half = takeCore(model, needle.reader, needle.body, {}, {0, -12e-3, 0}, {0, 1, 0});
    EXPECT_EQ(half.fragments, 1U);
    EXPECT_NEAR(half.volume, 0.5 * notchVolume(model), 0.02 * notchVolume(model));
}

// What was taken is gone: the same line again gives nothing; half a radius beside it what two circles at that distance do
// not share, 1 - (2 acos(1/4) - sqrt(15) / 8) / pi = 0.315; beyond two radii all.
TEST(Biopsy, SecondPassFindsWhatTheFirstHasLeft)
{
    const LoneNeedle needle(plate());
    const double radius = plate().scene.tool.notchRadius;
    const auto pass = [&](const Cuts& cuts, double aside) {
        return takeCore(plate(), needle.reader, needle.body, cuts, {aside, 12e-3, 0}, {0, 1, 0});
    };
    Cuts cuts;
    const auto first = pass(cuts, 0.0);
    removeCore(plate(), needle.body, first, {0, 12e-3, 0}, cuts);
    const auto again = pass(cuts, 0.0);
    EXPECT_EQ(again.volume, 0.0);
    EXPECT_EQ(again.targetLength, 0.0);
    EXPECT_EQ(again.fragments, 0U);
    const double left = 1.0 - (2.0 * std::acos(0.25) - std::sqrt(15.0) / 8.0) / std::numbers::pi;
    // Rings of equal area, three of them, stand for the radius.
    EXPECT_NEAR(pass(cuts, 0.5 * radius).volume / first.volume, left, 0.02);
    EXPECT_EQ(pass(cuts, 2.1 * radius).volume, first.volume);
    // A pass that starts in the hole and goes 10 mm further: half of it, in what pieces are left.
    const auto further = takeCore(plate(), needle.reader, needle.body, cuts, {0, 22e-3, 0}, {0, 1, 0});
    EXPECT_NEAR(further.volume, 0.5 * first.volume, 0.02 * first.volume);
    EXPECT_EQ(further.fragments, 1U);
}

// The needle feels the hole: where the core was there is neither cutting nor friction, and behind it all is as before.
TEST(Biopsy, NeedleFeelsTheHole)
{
    const auto model =
        tests::boxOf(tests::layers({{"fat", 50e-3}, {"idc_high_grade", 1}}), "idc_high_grade", tests::chainmailOnly);
    LoneNeedle whole(model), holed(model);
    const auto core = takeCore(model, holed.reader, holed.body, {}, {0, 8e-3, 0}, {0, 1, 0});
    removeCore(model, holed.body, core, {0, 8e-3, 0}, holed.tip.needle.cuts);
    const auto& fat = rowOf(model, "fat");
    double inHole = 0, behind = 0, before = 0;
    const auto run = [&](LoneNeedle& needle) {
        needle.go({0, -2e-3, 0}, {0, 42e-3, 0}, 0.02, [&](Vec3 p, Vec3 force) {
            const double d = p.y;
            before = d < 9e-3 ? -force.y : before;
            inHole = d < 25e-3 ? -force.y : inHole;
            behind = -force.y;
        });
    };
    run(holed);
    EXPECT_LT(inHole, fat.frictionPerMetre * 11e-3);
    EXPECT_NEAR(behind, fat.cuttingForce + fat.frictionPerMetre * (holed.tip.needle.inserted - 20e-3), 0.03);
    run(whole);
    EXPECT_NEAR(behind, fat.cuttingForce + fat.frictionPerMetre * whole.tip.needle.inserted, 0.03);
}

// Liver behind a rib that lies 18 to 26 mm deep.
const SessionModel& ribbed()
{
    static const auto model =
        tests::boxOf(tests::layers({{"fat", 18e-3}, {"rib", 8e-3}, {"liver", 1}}), "liver", tests::chainmailOnly);
    return model;
}

// Bone ends the throw where it begins, and the core is what the notch has passed until then: nothing from behind it.
TEST(Biopsy, AThrowEndsAtBoneAndBringsNothingFromBehindIt)
{
    const LoneNeedle needle(ribbed());
    const auto rib = static_cast<std::uint8_t>(row(ribbed(), "rib"));
    for (const double depth : {8e-3, 13e-3}) {
        const Vec3 tip(0, depth, 0);
        const Throw thrown = throwOf(ribbed(), needle.reader, needle.body, tip, tip, {0, 1, 0});
        EXPECT_EQ(thrown.bone, rib);
        EXPECT_FALSE(thrown.isBlocked());
        EXPECT_NEAR(thrown.length, 18e-3 - depth, 0.02e-3);
        const auto core = takeCore(ribbed(), needle.reader, needle.body, {}, tip, {0, 1, 0}, thrown.length);
        EXPECT_NEAR(glm::distance(core.notchStart, tip), 0.0, 1e-12);
        EXPECT_DOUBLE_EQ(core.notchEnd.y, depth + thrown.length);
        EXPECT_EQ(core.targetFraction, 0.0);
        EXPECT_DOUBLE_EQ(core.fraction[row(ribbed(), "fat")], 1.0);
        EXPECT_NEAR(core.volume, notchVolume(ribbed()) * thrown.length / ribbed().scene.tool.notchLength, 1e-15);
    }
    // Aslant the way to the rib is twice as long.
    const Vec3 axis(std::sin(std::numbers::pi / 3), std::cos(std::numbers::pi / 3), 0);
    EXPECT_NEAR(throwOf(ribbed(), needle.reader, needle.body, {0, 8e-3, 0}, {0, 8e-3, 0}, axis).length, 20e-3, 0.04e-3);
    // Without bone it is whole, and bone behind the tip does not matter.
    const LoneNeedle soft(plate());
    EXPECT_EQ(throwOf(plate(), soft.reader, soft.body, {}, {}, {0, 1, 0}).length, plate().scene.tool.throwLength);
    EXPECT_EQ(throwOf(ribbed(), needle.reader, needle.body, {0, 28e-3, 0}, {0, 28e-3, 0}, {0, 1, 0}).bone, 0);
}

// A tip that is in bone, or touches it, or is pressed into it and through it, is blocked: where the proxy is counts.
TEST(Biopsy, ATipAtBoneIsBlocked)
{
    const LoneNeedle needle(ribbed());
    const auto blocked = [&](double proxy, double tip) {
        return throwOf(ribbed(), needle.reader, needle.body, {0, proxy, 0}, {0, tip, 0}, {0, 1, 0}).isBlocked();
    };
    EXPECT_TRUE(blocked(17.8e-3, 17.8e-3));
    EXPECT_TRUE(blocked(22e-3, 22e-3));
    EXPECT_TRUE(blocked(17.8e-3, 28e-3));
    EXPECT_TRUE(blocked(10e-3, 28e-3));
    EXPECT_FALSE(blocked(16.8e-3, 16.8e-3));
    EXPECT_FALSE(blocked(28e-3, 28e-3));
}

}  // namespace
}  // namespace palpate::haptics
