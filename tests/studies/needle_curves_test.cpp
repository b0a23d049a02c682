#include <studies/needle/needle_curves.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace palpate::studies {
namespace {

const LayeredNeedle& layered()
{
    static const auto needle = layeredNeedle(datasets::ModelLevel::chainmail, 40e-3);
    return needle;
}

const NeedleCurve& volume()
{
    return layered().curves.at(0);
}

const NeedleCurve& layersOfTheThesis()
{
    return layered().curves.at(1);
}

// Force of the way in at a depth [N].
double forceAt(const NeedleCurve& curve, double depth)
{
    const auto end = curve.depth.begin() + static_cast<std::ptrdiff_t>(curve.turn);
    const auto at = std::lower_bound(curve.depth.begin(), end, depth) - curve.depth.begin();
    return curve.force[static_cast<std::size_t>(at)];
}

// In the volume every tissue that lies on the line is broken into once, in its order, each boundary deeper than it lies at
// rest; on the way out the shaft is held.
TEST(NeedleCurves, VolumeShowsEveryBoundary)
{
    const auto& on = layered().boundaries;
    const auto& found = volume().punctures;
    ASSERT_EQ(on.size(), 6U);
    ASSERT_EQ(found.size(), on.size());
    for (std::size_t i = 0; i < on.size(); ++i) {
        EXPECT_EQ(found[i].tissue, on[i].tissue);
        EXPECT_GE(found[i].depth, on[i].depth - 0.5e-3) << on[i].tissue;
        EXPECT_LE(found[i].depth, on[i].depth + 12e-3) << on[i].tissue;
    }
    const auto out = volume().force.begin() + static_cast<std::ptrdiff_t>(volume().turn);
    EXPECT_LT(*std::min_element(out, volume().force.end()), -0.3);
}

// The thesis's layers: each takes K times the depth below its own surface until it gives way, then its force stays as it
// was until the next is touched, with no force at first. A layer that was removed is not there a second time.
TEST(NeedleCurves, LayersAreRemovedOneByOne)
{
    const auto& on = layered().boundaries;
    const auto& curve = layersOfTheThesis();
    const double skin = forceAt(curve, 3e-3), tumour = forceAt(curve, on[3].depth + 3e-3);
    EXPECT_NEAR(skin, layerStiffness * 3e-3, 0.1 * skin);
    EXPECT_NEAR(tumour, layerStiffness * 3e-3, 0.1 * tumour);
    for (const std::size_t touched : {2U, 3U, 5U}) {
        EXPECT_LT(forceAt(curve, on[touched].depth + 0.3e-3), 0.15) << on[touched].tissue;
        EXPECT_GT(forceAt(curve, on[touched].depth + 1.5e-3), 0.3) << on[touched].tissue;
    }
    // Behind the tumour lies gland again.
    ASSERT_EQ(on[4].tissue, on[2].tissue);
    EXPECT_EQ(forceAt(curve, on[4].depth + 0.5e-3), forceAt(curve, on[4].depth - 0.5e-3));
    const auto out = curve.force.begin() + static_cast<std::ptrdiff_t>(curve.turn);
    EXPECT_GT(*std::min_element(out, curve.force.end()), 0.0);
}

// A fall counts once, at its peak; a slow one does not count.
TEST(NeedleCurves, FallsAreFoundAtTheirPeaks)
{
    NeedleCurve curve;
    for (int i = 0; i < 4000; ++i) {
        const double depth = 1e-5 * i;
        curve.depth.push_back(depth);
        // 10 mm up to 1 N, down in half a millimetre, up again, and slowly down.
        curve.force.push_back(depth < 10e-3     ? 100 * depth
                              : depth < 10.5e-3 ? 1 - 1000 * (depth - 10e-3)
                              : depth < 20e-3   ? 0.5 + 50 * (depth - 10.5e-3)
                                                : 0.975 - 20 * (depth - 20e-3));
    }
    curve.turn = curve.depth.size();
    const auto falls = fallsOf(curve, 0.1);
    ASSERT_EQ(falls.size(), 1U);
    EXPECT_NEAR(falls[0], 10e-3, 0.02e-3);
}

// Pressing beside a vessel carries it 5 mm along; the warning comes with the distance to where it is now, later than by
// where it was.
TEST(NeedleCurves, WarningFollowsTheVessel)
{
    const Onset onset = warningOnset(20e-3);
    EXPECT_GT(onset.points.back().moved, 5e-3);
    EXPECT_NEAR(onset.warnedAt, onset.deformedOnset, 0.05e-3);
    EXPECT_GT(onset.warnedAt, onset.restOnset + 3e-3);
}

}  // namespace
}  // namespace palpate::studies
