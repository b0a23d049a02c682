#include <channel/deformation.h>
#include <haptics/probe.h>
#include <ultrasound/check_bodies.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

namespace palpate::ultrasound {
namespace {

// What is as far as bodies, pictures and needles reach.

// A block of tissue on display voxels, with its face at y = 0 and the needle's line along y.
struct Block {
    Block(glm::ivec3 size, double spacing, double aimDepth)
    {
        const glm::dvec3 origin(-0.5 * (size.x - 1) * spacing, -4 * spacing, -0.5 * (size.z - 1) * spacing);
        scenery.labels = {{size.x, size.y, size.z}, 0, {origin.x, origin.y, origin.z}, spacing};
        scenery.lattice = {{2, 2, 2}, 0, {origin.x, origin.y, origin.z}, 0.5};
        scenery.sound[0] = {343, 100, 0, 0, -100, 0, 0};
        scenery.sound[1] = {1586, 1060, 0.5F, 1.05F, 4, 0, 0};
        scenery.sound[2] = {1440, 911, 0.4F, 1.16F, 0, 0, 0};
        scenery.tissues = 3;
        scenery.entry = {0, 0, 0};
        scenery.aim = {0, aimDepth, 0};
        labels = labelsOn(scenery.labels);
    }
    // Tissue 2 from x = 40 mm on.
    std::vector<std::uint8_t> labelsOn(const channel::Grid& grid) const
    {
        const channel::Grid& box = scenery.labels;
        const glm::dvec3 low = channel::vec(box.origin) + 3.5 * box.spacing;
        const glm::dvec3 high = channel::vec(box.origin) + box.spacing * (glm::dvec3(channel::sizeOf(box)) - 4.5);
        std::vector<std::uint8_t> out;
        for (int z = 0; z < grid.size[2]; ++z)
            for (int y = 0; y < grid.size[1]; ++y)
                for (int x = 0; x < grid.size[0]; ++x) {
                    const glm::dvec3 p = channel::vec(grid.origin) + grid.spacing * glm::dvec3(x, y, z);
                    const bool in =
                        p.x > low.x && p.y > low.y && p.z > low.z && p.x < high.x && p.y < high.y && p.z < high.z;
                    out.push_back(!in ? 0 : p.x > 40e-3 ? 2 : 1);
                }
        return out;
    }

    channel::Scenery scenery;
    std::vector<std::uint8_t> labels;
};

// Fine labels are only around the aim: what lies further away is that of the display, with its interfaces and speckle.
TEST(Medium, BeyondTheFineLabelsAreThoseOfTheDisplay)
{
    Block block({65, 55, 30}, 2e-3, 60e-3);
    block.scenery.fine = {{21, 21, 21}, 0, {-10e-3, 50e-3, -10e-3}, 1e-3};
    const auto fine = block.labelsOn(block.scenery.fine);
    const Medium medium(block.scenery, block.labels, fine);
    EXPECT_DOUBLE_EQ(medium.spacing(), 1e-3);
    const auto voxel = [&](glm::dvec3 p) { return glm::vec3((p - medium.origin()) / medium.spacing()); };
    for (const double x : {-30e-3, 0.0, 30e-3, 50e-3})
        for (const double y : {5e-3, 30e-3, 60e-3, 90e-3})
            EXPECT_EQ(medium.label(voxel({x, y, 0})), (x > 40e-3 ? 2 : 1) | pureBit) << x << " " << y;
    EXPECT_EQ(medium.label(voxel({0, -4e-3, 0})) & compared, 0) << "air before the face";
    EXPECT_EQ(medium.label(voxel({0, 0.5, 0})), unknown);
    const Medium::Impedance border = medium.impedanceAt(voxel({40e-3, 30e-3, 0}));
    EXPECT_LT(border.slope.x, -0.01F);
    EXPECT_NEAR(border.slope.y, 0, 1e-3);
    EXPECT_LE(medium.low().y, voxel({0, 0, 0}).y);
    // Under the face, 50 mm before the fine labels, there is speckle.
    Scanner scanner(block.scenery, block.labels, fine);
    const channel::Deformation body(block.scenery, block.labels);
    BeamImage image;
    scanner.scan(linearProbe(), settingsOf(linearProbe()), poseOf({0, 0.2e-3, 0}, {0, 1, 0}, {1, 0, 0}), body, {}, image);
    const std::size_t lines = static_cast<std::size_t>(image.settings.lines);
    EXPECT_GT(std::count_if(&image.grey[200 * lines], &image.grey[600 * lines], [](std::uint8_t g) { return g > 40; }),
              static_cast<std::ptrdiff_t>(300 * lines));
}

// The cache of the speckle is that of the picture: 37 bytes for each cubic millimetre of this body would be 1.6 GB.
TEST(Scatterers, MemoryGoesWithThePictureAndNotWithTheBody)
{
    const Block block({110, 90, 110}, 4e-3, 60e-3);
    const Medium medium(block.scenery, block.labels, {});
    const channel::Deformation body(block.scenery, block.labels);
    const Transducer probe = linearProbe();
    const Beam beam(probe, settingsOf(probe));
    Scatterers scatterers;
    const auto look = [&](double x) {
        const View view(beam, poseOf({x, 0.2e-3, 0}, {0, 1, 0}, {1, 0, 0}), body, medium);
        scatterers.find(view, medium);
    };
    look(0);
    const std::size_t blocks = scatterers.blocks();
    EXPECT_GT(blocks, 3000U);
    EXPECT_LT(scatterers.memory(), 10'000'000U);
    // Wherever the probe goes it does not grow for ever, and what is found does not depend on what was before.
    for (double x = -180e-3; x < 180e-3; x += 8e-3)
        look(x);
    EXPECT_LT(scatterers.memory(), 100'000'000U);
    look(0);
    EXPECT_EQ(scatterers.blocks(), blocks);
}

// A linear probe's picture is as deep as its target needs. Without that this one, 38 mm deep in a picture of 40, was at
// the lower border.
TEST(Placement, ThePictureIsDeepEnoughForTheTarget)
{
    for (const double depth : {20e-3, 38e-3, 43e-3, 60e-3}) {
        const Block block({55, 45, 55}, 2e-3, depth);
        const Medium medium(block.scenery, block.labels, {});
        const Examination e = examinationOf(block.scenery, medium);
        const Beam beam(e.transducer, e.settings);
        const glm::dvec3 aim = channel::vec(block.scenery.aim) - e.pose.face;
        const glm::vec2 at =
            beam.place(static_cast<float>(glm::dot(aim, e.pose.lateral)), static_cast<float>(glm::dot(aim, e.pose.axial)));
        EXPECT_NEAR(glm::dot(aim, e.pose.elevation), 0, 0.5e-3);
        EXPECT_LE(at.y, e.settings.depth - 8e-3F) << depth;
        EXPECT_EQ(e.transducer.shape, depth > 45e-3 ? ProbeShape::curved : ProbeShape::linear);
        EXPECT_FLOAT_EQ(e.settings.depth, depth < 30e-3   ? 40e-3F
                                          : depth < 40e-3 ? 50e-3F
                                          : depth < 45e-3 ? 60e-3F
                                                          : 140e-3F);
    }
}

// A needle of 14 G in clear tissue, across the beams, 15 mm deep and `off` the plane: echo of its shaft, and of the
// tissue behind it against what it is without the needle [dB].
struct Seen {
    double shaft = 0, behind = 0;
};
class OffPlane {
public:
    OffPlane() : bench_({fat()}, 0.4e-3, [](glm::dvec3) { return 1; })
    {
        bench_.physics.speckle = false;
        bench_.physics.points = {{bench_.pose.face + glm::dvec3(0, 0, 22e-3), 20}};
        bench_.insert({0, 0, -1}, {0, 0, -1});
        bench_.scan();
        without_ = decibels(largest(21.7e-3, 22.3e-3));
    }
    Seen at(double off)
    {
        bench_.insert(bench_.pose.face + glm::dvec3(12e-3, off, 15e-3), {1, 0, 0});
        bench_.scan();
        return {decibels(largest(13e-3, 15e-3)), decibels(largest(21.7e-3, 22.3e-3)) - without_};
    }
    static double covered(double off)
    {
        const double sigma = static_cast<double>(Beam(linearProbe(), settingsOf(linearProbe())).elevationSigma(13.95e-3F));
        const auto phi = [&](double y) { return 0.5 * (1 + std::erf(y / sigma / std::sqrt(2.0))); };
        return phi(off + 1.05e-3) - phi(off - 1.05e-3);
    }

private:
    static channel::TissueSound fat() { return {1440, 911, 0, 1.16F, 0, 0, 0}; }
    double largest(double from, double to) const
    {
        double most = 0;
        const double face = bench_.pose.face.z;
        for (int k = bench_.sample(face + from); k < bench_.sample(face + to); ++k)
            most = std::max(most, bench_.amplitude(k, bench_.line(bench_.pose.face.x)));
        return most;
    }

    CheckBench bench_;
    double without_ = 0;
};

// Echo and shadow go by the share of the beam, Gaussian in elevation, that the shaft covers: 0.93 of it comes back, a
// fiftieth goes on. Nothing of it comes back once it has gone.
TEST(NeedleOffThePlane, FadesAsItLeavesTheBeam)
{
    OffPlane needle;
    Seen before{1e9, -1e9};
    for (double off = 0; off < 4e-3; off += 0.1e-3) {
        const Seen seen = needle.at(off);
        const double covered = OffPlane::covered(off);
        EXPECT_LE(seen.shaft, before.shaft + 1e-3) << off;
        EXPECT_GE(seen.behind, before.behind - 0.05) << off;
        if (covered > 1e-3) {
            EXPECT_NEAR(seen.shaft, decibels(0.93 * covered), 1.0) << off;
        }
        EXPECT_NEAR(seen.behind, decibels(1 - 0.98 * covered), 0.5) << off;
        EXPECT_NEAR(needle.at(-off).shaft, seen.shaft, 0.01) << "both sides are alike";
        before = seen;
    }
}

// What the score counts as in the picture stands out of fat's speckle (-46 dB), and what is twice as far away does not.
TEST(NeedleOffThePlane, IsInThePictureWhereTheScoreSaysSo)
{
    constexpr double radius = 1.05e-3, deep = 20e-3;
    for (const auto kind : {datasets::ProbeKind::linear, datasets::ProbeKind::curved}) {
        const Transducer t = kind == datasets::ProbeKind::curved ? curvedProbe() : linearProbe();
        const float sigma = Beam(t, settingsOf(t)).elevationSigma(static_cast<float>(deep));
        const double border = 1.1774 * static_cast<double>(sigma) + radius;
        const auto echo = [&](double off) {
            return decibels(0.93 * static_cast<double>(shareBetween(static_cast<float>(off - radius),
                                                                    static_cast<float>(off + radius), sigma)));
        };
        datasets::ProbeSpec spec;
        spec.kind = kind;
        const haptics::Probe probe(spec);
        const auto counted = [&](double off) {
            return probe.look({10e-3, deep, off}, {1, 0, 0}, 10e-3, radius).length > 0;
        };
        EXPECT_TRUE(counted(0.99 * border));
        EXPECT_FALSE(counted(1.01 * border));
        EXPECT_GT(echo(0.99 * border), fatEcho + 12);
        EXPECT_LT(echo(2 * border), fatEcho);
    }
}

// A needle across the picture is a spot where it goes through: no part of it that lies far off the plane is there.
TEST(NeedleOffThePlane, CrossesItInASpot)
{
    CheckBench bench({{1440, 911, 0, 1.16F, 0, 0, 0}}, 0.4e-3, [](glm::dvec3) { return 1; });
    bench.physics.speckle = false;
    bench.insert(bench.pose.face + glm::dvec3(0, 6e-3, 15e-3), {0, 1, 0});
    bench.scan();
    const int k = bench.sample(bench.pose.face.z + 13.95e-3);
    const auto most = [&](double x) {
        double out = 0;
        for (int s = k - 8; s <= k + 8; ++s)
            out = std::max(out, bench.amplitude(s, bench.line(bench.pose.face.x + x)));
        return decibels(out);
    };
    EXPECT_NEAR(most(0), decibels(0.93), 2.5) << "it covers the whole beam";
    EXPECT_LT(most(3e-3), -60);
    EXPECT_LT(most(-3e-3), -60);
}

// Another body is known by its labels and by what they do to sound.
TEST(Scanner, TellsBodiesApart)
{
    Block block({20, 20, 20}, 4e-3, 10e-3);
    const auto body = [&] { return Scanner(block.scenery, block.labels, {}).body(); };
    const std::uint64_t first = body();
    EXPECT_NE(first, 0U);
    EXPECT_EQ(body(), first);
    block.scenery.sound[1].echo += 1;
    EXPECT_NE(body(), first);
    block.scenery.sound[1].echo -= 1;
    block.labels[4210] ^= 2;
    EXPECT_NE(body(), first);
}

}  // namespace
}  // namespace palpate::ultrasound
