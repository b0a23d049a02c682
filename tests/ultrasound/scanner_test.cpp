#include <channel/deformation.h>
#include <ultrasound/display.h>
#include <ultrasound/kernels.h>
#include <ultrasound/placement.h>
#include <ultrasound/scanner.h>
#include <ultrasound/spread.h>

#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <random>
#include <vector>

namespace palpate::ultrasound {
namespace {

// A ball of fat, radius 45 mm, with a mass 20 mm below its front (towards -y), on 1 mm voxels.
struct Ball {
    static constexpr double radius = 45e-3;
    static constexpr int side = 121;

    Ball()
    {
        scenery.labels = scenery.lattice = {{side, side, side}, 0, {-60e-3, -60e-3, -60e-3}, 1e-3};
        scenery.lattice = {{61, 61, 61}, 0, {-60e-3, -60e-3, -60e-3}, 2e-3};
        scenery.sound[0] = {343, 100, 0, 0, -100, 0, 0};
        scenery.sound[1] = {1440, 911, 0.38F, 1.16F, 0, 7, 3};
        scenery.sound[2] = {1548, 1041, 1.08F, 1.16F, -7, 2, 0};
        scenery.tissues = 3;
        scenery.toolRadius = 1.05e-3;
        scenery.toolLength = 0.1;
        scenery.holeRadius = 0.8e-3;
        scenery.entry = {0, -radius, 0};
        scenery.aim = {0, -radius + 20e-3, 0};
        labels.resize(static_cast<std::size_t>(side) * side * side);
        std::size_t at = 0;
        for (int z = 0; z < side; ++z)
            for (int y = 0; y < side; ++y)
                for (int x = 0; x < side; ++x) {
                    const glm::dvec3 p = 1e-3 * glm::dvec3(x, y, z) - 60e-3;
                    const bool mass = glm::distance(p, channel::vec(scenery.aim)) < 5e-3;
                    labels[at++] = mass ? 2 : glm::length(p) < radius ? 1 : 0;
                }
    }

    channel::Scenery scenery;
    std::vector<std::uint8_t> labels;
};

struct Scanned {
    explicit Scanned(const Ball& ball)
        : scanner(ball.scenery, ball.labels, {}),
          body(ball.scenery, ball.labels),
          examination(examinationOf(ball.scenery, scanner.medium()))
    {
        examination.settings.lines = 96;
        examination.settings.samples = 500;
    }
    const std::vector<std::uint8_t>& scan()
    {
        scanner.scan(examination.transducer, examination.settings, examination.pose, body, state, image);
        return image.grey;
    }

    Scanner scanner;
    channel::Deformation body;
    Examination examination;
    channel::State state;
    BeamImage image;
};

std::unique_ptr<channel::Displaced> moved(const Ball& ball, glm::dvec3 by)
{
    auto out = std::make_unique<channel::Displaced>();
    const channel::Grid& g = ball.scenery.lattice;
    for (std::uint32_t i = 0; i < 61 * 61 * 61 && out->count < channel::maxDisplaced; ++i) {
        const glm::dvec3 p = channel::vec(g.origin) + g.spacing * glm::dvec3(i % 61, i / 61 % 61, i / 61 / 61);
        if (glm::length(p) < Ball::radius + 4e-3)
            out->nodes[out->count++] = {i, {static_cast<float>(by.x), static_cast<float>(by.y), static_cast<float>(by.z)}};
    }
    return out;
}

// A body that is its own mirror image is so on the finer grid too, by whatever it is refined: twice here.
TEST(Medium, IsInTheMiddleOfItsVoxels)
{
    Ball ball;
    for (std::size_t i = 0; i < ball.labels.size(); ++i) {
        ball.labels[i] = ball.labels[i] == 2 ? 1 : ball.labels[i];
    }
    const Medium medium(ball.scenery, ball.labels, {});
    EXPECT_NEAR(ball.scenery.labels.spacing / medium.spacing(), 2.0, 1e-9);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> place(-50e-3, 50e-3);
    int differ = 0, tissue = 0;
    for (int i = 0; i < 20000; ++i) {
        const glm::dvec3 p(place(random), place(random), place(random));
        const auto at = [&](glm::dvec3 q) {
            return medium.label(glm::vec3((q - medium.origin()) / medium.spacing())) & compared;
        };
        differ += at(p) != at(-p) ? 1 : 0;
        tissue += at(p) != 0 ? 1 : 0;
    }
    EXPECT_GT(tissue, 5000);
    EXPECT_LE(differ, 20);
}

TEST(Scanner, APictureIsAFunctionOfWhatThereIsToSee)
{
    const Ball ball;
    Scanned a(ball), b(ball);
    a.state.tick = b.state.tick = 33;
    const auto first = a.scan();
    // In between something else, with another needle, shape, tick and hole.
    a.body.apply(*moved(ball, {0, 1e-3, 0}));
    a.state.tick = 66;
    a.state.phase = channel::Phase::inserted;
    a.state.tip = {0, -30e-3, 0};
    a.state.axis = {0, 1, 0};
    a.state.holes = 1;
    a.state.hole[0] = {{0, -30e-3F, 0}, {0, -20e-3F, 0}};
    EXPECT_NE(a.scan(), first);
    a.body.apply(*std::make_unique<channel::Displaced>());
    a.state = b.state;
    EXPECT_EQ(a.scan(), first);
    EXPECT_EQ(b.scan(), first);
}

TEST(Scanner, NoiseIsOfTheTick)
{
    const Ball ball;
    Scanned a(ball);
    const auto first = a.scan();
    a.state.tick = 1;
    EXPECT_NE(a.scan(), first);
}

// Tissue and probe that move together look as before.
TEST(Scanner, WhatMovesWithTheProbeStaysInThePicture)
{
    const Ball ball;
    Scanned a(ball);
    const auto first = a.scan();
    const glm::dvec3 by(0.7e-3, -0.4e-3, 1.1e-3);
    a.body.apply(*moved(ball, by));
    a.examination.pose.face += by;
    const auto second = a.scan();
    double worst = 0, sum = 0;
    for (std::size_t i = 0; i < first.size(); ++i) {
        const double d = std::abs(static_cast<double>(first[i]) - static_cast<double>(second[i]));
        worst = std::max(worst, d);
        sum += d;
    }
    EXPECT_LT(sum / static_cast<double>(first.size()), 1.0) << worst;  // grey levels of 255
}

TEST(Scanner, ACoreLeavesADarkHole)
{
    const Ball ball;
    Scanned a(ball);
    Physics physics;
    physics.noise = -300;
    physics.interfaces = false;
    physics.variation = 0;
    a.scanner.setPhysics(physics);
    a.scan();
    std::vector<float> before, after;
    a.scanner.power(before);
    // Along the elevation of the probe, across the picture, 12 mm deep: seen end on.
    const Pose& p = a.examination.pose;
    const glm::vec3 from(p.face + 12e-3 * p.axial - 6e-3 * p.elevation), to(p.face + 12e-3 * p.axial + 6e-3 * p.elevation);
    a.state.holes = 1;
    a.state.hole[0] = {{from.x, from.y, from.z}, {to.x, to.y, to.z}};
    a.scan();
    a.scanner.power(after);
    const int k = static_cast<int>(12e-3 / static_cast<double>(a.examination.settings.depth) * 500), line = 48;
    double was = 0, is = 0;
    for (int q = k - 4; q <= k + 4; ++q) {
        was += static_cast<double>(before[static_cast<std::size_t>(q * 96 + line)]);
        is += static_cast<double>(after[static_cast<std::size_t>(q * 96 + line)]);
    }
    EXPECT_LT(10 * std::log10(is / was), -6);
}

// The vector units give the same bits.
TEST(Kernels, AllGiveTheSameBits)
{
    ASSERT_GE(supportedKernels().size(), 1U);
    std::mt19937 random(1);
    std::normal_distribution<float> normal(0, 5e-3F);
    const Kernels& plain = *supportedKernels().front();
    for (const Kernels* other : supportedKernels()) {
        BlockEchoes a, b;
        for (int j = 0; j < perBlock; ++j) {
            a.l[j] = b.l[j] = normal(random);
            a.y[j] = b.y[j] = 0.1F * normal(random);
            a.z[j] = b.z[j] = 20e-3F + normal(random);
        }
        for (const float radius : {0.0F, 50e-3F}) {
            const BlockScale scale{radius, 1.2e4F, 5e3F, 95.5F, 2.5e4F, 1e5F, 1.2e-3F, 2e3F};
            BlockEchoes x = a, y = b;
            plain.echoes(scale, x);
            other->echoes(scale, y);
            for (int j = 0; j < perBlock; ++j) {
                EXPECT_EQ(x.l[j], y.l[j]);
                EXPECT_EQ(x.z[j], y.z[j]);
                EXPECT_EQ(x.cosine[j], y.cosine[j]);
                EXPECT_EQ(x.sine[j], y.sine[j]);
            }
        }
        std::vector<float> re(192), im(192);
        for (std::size_t i = 0; i < re.size(); ++i) {
            re[i] = normal(random);
            im[i] = normal(random);
        }
        std::vector<std::uint8_t> g(192), h(192);
        plain.compress(re.data(), im.data(), 70, 4.25F, 192, g.data());
        other->compress(re.data(), im.data(), 70, 4.25F, 192, h.data());
        EXPECT_EQ(g, h) << other->name;
    }
}

// grey = 255 / range (10 log10 |IQ|^2 + gain)
TEST(Kernels, GreyIsLinearInDecibels)
{
    for (float dB = -118; dB < -60; dB += 1) {
        const float amplitude = std::pow(10.0F, dB / 20), zero = 0;
        std::uint8_t grey = 0;
        kernels().compress(&amplitude, &zero, 120, 255.0F / 60, 1, &grey);
        EXPECT_NEAR(grey, std::floor(255.0F / 60 * (dB + 120)), 1) << dB;
    }
}

// A slider adds its decibels in the middle of its layer, and half way to the next half of them.
TEST(Beam, SlidersAddTheirGain)
{
    const Transducer probe = linearProbe();
    Settings plain = settingsOf(probe), turned = plain;
    turned.tgc[2] = 8;
    const auto more = [&](float fraction) {
        const float z = fraction * plain.depth;
        return gainAt(Beam(probe, turned), z) - gainAt(Beam(probe, plain), z);
    };
    EXPECT_NEAR(more(2.5F / 8), 8, 1e-3);
    EXPECT_NEAR(more(2.0F / 8), 4, 1e-3);
    EXPECT_NEAR(more(1.5F / 8), 0, 1e-3);
    EXPECT_NEAR(more(5.0F / 8), 0, 1e-3);
}

TEST(Beam, PlaceAndPointAreInverse)
{
    for (const Transducer& probe : {linearProbe(), curvedProbe()}) {
        const Beam beam(probe, settingsOf(probe));
        for (const float l : {-0.4F, 0.0F, 0.3F})
            for (const float z : {1e-3F, 20e-3F, 39e-3F}) {
                const float along = beam.curved() ? l : l * 40e-3F;
                const glm::vec3 p = beam.point(along, 0, z);
                EXPECT_NEAR(beam.place(p.x, p.z).x, along, 1e-5);
                EXPECT_NEAR(beam.place(p.x, p.z).y, z, 1e-6);
            }
    }
}

TEST(Layout, PixelAndPointAreInverse)
{
    for (const Transducer& probe : {linearProbe(), curvedProbe()})
        for (const bool mirrored : {false, true}) {
            const Layout layout(Beam(probe, settingsOf(probe)), 800, 600, mirrored);
            const glm::vec2 p = layout.point(123, 456), q = layout.pixel(p.x, p.y);
            EXPECT_NEAR(q.x, 123.5, 1e-3);
            EXPECT_NEAR(q.y, 456.5, 1e-3);
        }
}

TEST(Layout, WithoutMarginsThePictureReachesTheBordersThatLimitIt)
{
    for (const Transducer& probe : {linearProbe(), curvedProbe()}) {
        const Beam beam(probe, settingsOf(probe));
        const Layout wide(beam, 6400, 64, false, {0, 0}), high(beam, 64, 6400, false, {0, 0});
        EXPECT_NEAR(wide.pixel(0, beam.top()).y, 0, 1e-3);
        EXPECT_NEAR(wide.pixel(0, beam.settings().depth).y, 64, 1e-3);
        EXPECT_NEAR(high.pixel(beam.halfWidth(), 0).x, 0, 1e-3);
        EXPECT_NEAR(high.pixel(-beam.halfWidth(), 0).x, 64, 1e-3);
    }
}

// Of 64 pixels the usual margins leave none.
TEST(ScanConverter, WithoutMarginsASmallPictureIsFull)
{
    BeamImage image;
    image.settings = settingsOf(image.transducer);
    image.grey.assign(static_cast<std::size_t>(image.settings.lines) * static_cast<std::size_t>(image.settings.samples),
                      99);
    Pixels small, framed;
    ScanConverter({0, 0}).convert(image, 64, 64, small);
    ScanConverter().convert(image, 64, 64, framed);
    // The face is 38 mm wide and the picture 40 mm deep: 95 % of the columns.
    EXPECT_NEAR(static_cast<double>(std::ranges::count(small.grey, 99)) / (64 * 64), 0.95, 0.04);
    EXPECT_LT(std::ranges::count(framed.grey, 99), 10);
}

// The picture's plane holds the line, the aim is in the picture, and the face lies on the skin.
TEST(Placement, PutsTheProbeBesideTheNeedle)
{
    const Ball ball;
    Scanned a(ball);
    const Pose& p = a.examination.pose;
    EXPECT_EQ(a.examination.transducer.shape, ProbeShape::linear);
    const glm::dvec3 line = glm::normalize(channel::vec(ball.scenery.aim) - channel::vec(ball.scenery.entry));
    const glm::dvec3 aim = channel::vec(ball.scenery.aim) - p.face;
    EXPECT_NEAR(glm::dot(line, p.elevation), 0, 1e-6);
    EXPECT_NEAR(glm::dot(aim, p.elevation), 0, 0.5e-3);
    EXPECT_LT(std::abs(glm::dot(aim, p.lateral)), 0.5 * static_cast<double>(a.examination.transducer.width));
    EXPECT_GT(glm::dot(aim, p.axial), 0);
    EXPECT_LT(glm::dot(aim, p.axial), static_cast<double>(a.examination.settings.depth));
    // A plane that touches a ball does so 45 mm from its middle, and here with 0.3 mm of gel.
    EXPECT_NEAR(glm::length(p.face), Ball::radius + 0.3e-3, 1.2e-3);
    EXPECT_NEAR(glm::dot(glm::normalize(p.face), p.axial), -1, 0.02);
    // The needle comes from the marked side.
    EXPECT_GT(glm::dot(channel::vec(ball.scenery.entry) - p.face, p.lateral), 0);
}

TEST(Placement, AProbeThatIsMovedStaysOnTheSkin)
{
    const Ball ball;
    Scanned a(ball);
    const Pose to = movedOnSkin(a.scanner.medium(), a.examination, {5e-3, 0, 0, 0});
    EXPECT_NEAR(glm::dot(to.face - a.examination.pose.face, a.examination.pose.lateral), 5e-3, 1e-6);
    EXPECT_NEAR(glm::dot(to.axial, a.examination.pose.axial), 1, 1e-9);
    // Far off the ball there is no skin.
    const Pose off = movedOnSkin(a.scanner.medium(), a.examination, {0.2, 0, 0, 0});
    EXPECT_EQ(glm::distance(off.face, a.examination.pose.face), 0);
}

}  // namespace
}  // namespace palpate::ultrasound
