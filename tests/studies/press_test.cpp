#include <studies/press/press.h>

#include <haptics/simulation.h>
#include <studies/kernel/trial_path.h>

#include <tests/error_of.h>
#include <tests/folder.h>
#include <tests/studies/pressed.h>
#include <tests/studies/small_block.h>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <glm/geometric.hpp>

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>
#include <utility>

namespace palpate::studies {
namespace {

using datasets::ToolKind;
using datasets::ToolSpec;

const haptics::SessionModel& block()
{
    static const auto model = [] {
        haptics::SessionModel small = smallBlock();
        small.scene.model.level = datasets::ModelLevel::elastic;
        return haptics::buildModel(std::move(small.scene), small.tissue);
    }();
    return model;
}

PosePath read(const std::string& text)
{
    std::istringstream in(text);
    return readPosePath(in, "path.csv", Vec3(0, 1, 0));
}

std::string refusal(const std::string& text)
{
    return tests::errorOf([&] { read(text); });
}

const ToolSpec ball = toolOf(ToolKind::sphere, 5e-3, 0.0);

Pressed pressed(const PosePath& path, const PressOptions& options, std::span<const FilePoint> asked = {})
{
    return pressed(block(), path, options, asked);
}

// A ball of 5 mm goes 3 mm into the block's face y = 0 in 20 mm/s, from just above.
const char* const in3mm = "seconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.175,0,-2,0\n";

// p(t) = (10 t, 2, 3 - 5 t) mm, axis halfway between x and y at half time.
TEST(PressPath, GoesStraightAndEvenlyBetweenItsRows)
{
    const PosePath path = read(
        "\xEF\xBB\xBF# corners\r\n\r\naxis_y, z_mm ,x_mm,seconds,y_mm,axis_z,axis_x\r\n0,3,0,2,2,0,4\r\n# one more\n"
        "7,-2,10,3,2,0,0\n");
    ASSERT_EQ(path.ticks(), 1001U);
    for (const std::size_t tick : {0U, 1U, 250U, 999U, 1000U}) {
        const double t = 1e-3 * static_cast<double>(tick);
        const ToolPose pose = path.at(tick);
        EXPECT_NEAR(pose.seconds, 2.0 + t, 1e-12);
        EXPECT_LT(glm::distance(pose.position, 1e-3 * Vec3(10 * t, 2, 3 - 5 * t)), 1e-12);
        EXPECT_NEAR(glm::length(pose.axis), 1.0, 1e-12);
    }
    EXPECT_EQ(path.at(0).axis, Vec3(1, 0, 0));
    EXPECT_LT(glm::distance(path.at(500).axis, std::sqrt(0.5) * Vec3(1, 1, 0)), 1e-12);
    EXPECT_EQ(path.at(2000).position, path.poses.back().position);
}

TEST(PressPath, WithoutSecondsEveryRowIsAMillisecond)
{
    const PosePath path = read("\"x_mm\",y_mm,\"z_mm\"\n1,2,3\n2,2,3\n4,2,3\n");  // names as R writes them
    ASSERT_EQ(path.ticks(), 3U);
    EXPECT_EQ(path.at(1).position, 1e-3 * Vec3(2, 2, 3));
    EXPECT_EQ(path.at(2).position, 1e-3 * Vec3(4, 2, 3));
    EXPECT_EQ(path.at(2).axis, Vec3(0, 1, 0));
    EXPECT_EQ(read("x_mm,y_mm,z_mm\n1,2,3\n").ticks(), 1U);
}

TEST(PressPath, WhatIsWrongIsSaidWithItsLine)
{
    const std::string head = "seconds,x_mm,y_mm,z_mm\n";
    const std::string turned = "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n";
    for (const auto& [text, hint] : std::vector<std::pair<std::string, std::string>>{
             {"", "path.csv: holds no line of column names"},
             {"# nothing\n\n", "path.csv: holds no line of column names"},
             {head, "path.csv: holds no pose"},
             {"x_mm,z_mm\n1,2\n", "path.csv:1: column y_mm is missing: the columns are x_mm, y_mm"},
             {"x_mm,y_mm,z_mm,w\n", "path.csv:1: column 'w' is not known: the columns are x_mm, y_mm"},
             {"0,0,0\n", "path.csv:1: column '0' is not known"},
             {std::string("\x1b[2J\x07\0\xff_mm", 10) + ",y_mm\n", "path.csv:1: column '?[2J???_mm' is not known"},
             {head + "0,0,\x1b[31m,0\n", "path.csv:2: y_mm = '?[31m': must be a number"},
             {"x_mm,y_mm,z_mm,x_mm\n", "path.csv:1: column x_mm is there twice"},
             {"x_mm,y_mm,z_mm,axis_x\n", "path.csv:1: column axis_y is missing"},
             {head + "0,0,0,0\n\n1,2,3\n", "path.csv:4: 3 values: must be 4"},
             {head + "0,0,0,0,\n", "path.csv:2: 5 values: must be 4"},
             {head + "0,0,a,0\n", "path.csv:2: y_mm = 'a': must be a number"},
             {head + "0,0,,0\n", "path.csv:2: y_mm = '': must be a number"},
             {head + "0,0,1 mm,0\n", "path.csv:2: y_mm = '1 mm': must be a number"},
             {head + "0,0,nan,0\n", "path.csv:2: y_mm = 'nan': must be a number"},
             {head + "inf,0,0,0\n", "path.csv:2: seconds = 'inf': must be a number"},
             {head + "0,0,0,1e999\n", "path.csv:2: z_mm = '1e999': must be a number"},
             {head + "0,0,0,-10001\n", "path.csv:2: z_mm = -10001: must be -10000 to 10000 mm"},
             {head + "1,0,0,0\n1,0,0,0\n", "path.csv:3: seconds = 1: must be after 1"},
             {head + "1,0,0,0\n0.5,0,0,0\n", "path.csv:3: seconds = 0.5: must be after 1"},
             {head + "0,0,0,0\n10001,0,0,0\n", "path.csv:3: 10001 s after the first row: a path may take 10000 s"},
             {turned + "0,0,0,0,0,0\n", "path.csv:2: the axis is zero"},
             {turned + "0,0,0,0,1,0\n0,0,0,0,-1,0\n", "path.csv:3: the axis turns by half a turn"}}) {
        EXPECT_EQ(refusal(text).substr(0, hint.size()), hint);
    }
}

// "Any length but zero", also where its square is no number; R and spreadsheets write "+0" and "+1.5".
TEST(PressPath, AnAxisOfAnyLengthIsNormalisedAndPlusSignsAreRead)
{
    const PosePath path = [] {
        std::istringstream in(
            "x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n+0,+1.5,-2,3e200,4e200,0\n0,0,0,3e-200,4e-200,0\n+.5,0,0,+3,4e0,+0\n");
        return readPosePath(in, "path.csv", std::nullopt);
    }();
    for (const ToolPose& pose : path.poses) {
        EXPECT_NEAR(glm::distance(pose.axis, Vec3(0.6, 0.8, 0)), 0, 1e-15);
    }
    EXPECT_EQ(path.poses[0].position, 1e-3 * Vec3(0, 1.5, -2));
    for (const char* const text : {"+-1", "++1", "+", "+x", "+inf"}) {
        std::istringstream in(std::string("x_mm,y_mm,z_mm\n0,0,") + text + "\n");
        EXPECT_NE(tests::errorOf([&] { readPosePath(in, "path.csv", Vec3(0, 1, 0)); }).find("must be a number"),
                  std::string::npos)
            << text;
    }
}

TEST(PressPath, AFileThatIsNotThereIsRefused)
{
    const tests::Folder folder;
    EXPECT_THROW(loadPosePath(folder / "none.csv", Vec3(0, 1, 0)), std::runtime_error);
    EXPECT_THROW(loadPosePath(folder / "", Vec3(0, 1, 0)), std::runtime_error);
    EXPECT_THROW(loadPoints(folder / "none.csv"), std::runtime_error);
    // A pipe would be waited for, and a device has no end.
    ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_NE(tests::errorOf([&] { loadPosePath(folder / "pipe", Vec3(0, 1, 0)); }).find("is a named pipe"),
              std::string::npos);
    EXPECT_NE(tests::errorOf([] { loadPoints("/dev/zero"); }).find("is a device"), std::string::npos);
}

// The trial sets up its tools, its windows and its contacts by itself; where a tool would lie at rest, a path knows to some
// micrometres.
TEST(Press, ForcesAreThoseOfATrial)
{
    const auto& model = block();
    const TrialPlace place = trialPlace(*model.tissue, model.surface, model.approach.entry, model.approach.aim);
    const TrialPath trial = trialPath(*model.tissue, model.surface, place, trialTools()[0], 2e-3);
    TrialLoad load(trial);
    chainmail::Elastic elastic(*model.elastic, haptics::elasticOptions(model.scene.model.elastic), load.load().focus);
    PosePath path;
    std::vector<Vec3> forces;
    for (const TrialTick& t : schedule(trial, 20e-3)) {
        load.set(t.pose);
        elastic.relax(load.load());
        forces.push_back(elastic.toolForce(0));
        path.poses.push_back({trial.at(t.pose), Vec3(0, 1, 0), 1e-3 * static_cast<double>(path.poses.size())});
    }
    const Pressed own = pressed(path, {ball});
    ASSERT_EQ(own.samples.size(), forces.size());
    for (std::size_t i = 0; i < forces.size(); ++i) {
        EXPECT_LT(glm::distance(own.samples[i].force, forces[i]), 2e-2 * glm::length(forces.back())) << i;
    }
    EXPECT_LT(forces.back().y, -0.05);
    EXPECT_EQ(own.summary.ticks, forces.size());
    EXPECT_GT(own.summary.inContact, forces.size() / 2);
    EXPECT_FALSE(own.summary.heldFrom);
}

// A session with device "ideal" takes positions as they are: no encoder's half step lies between its force and that of the
// path (15 um of a Premium's are 5 % at a depth of half a millimetre). A capsule lies flat, its windows under its middle;
// touches with its back alone; with its middle alone, over the block's edge; and turns about its front. In the last two the
// windows, which are not wider than it is long, may lie a node apart.
TEST(Press, ForcesAreThoseOfASessionWithoutEncoder)
{
    const PosePath down = read("seconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.05,0,-4.5,0\n0.1,0,-4.5,0\n");
    const PosePath flat =
        read("seconds,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n0,10,-5.5,0,1,0,0\n0.1,10,-3,0,1,0,0\n0.2,10,-3,0,1,0,0\n");
    const PosePath back =
        read("seconds,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n0,16,-17.5,0,16,-12,0\n0.1,16,-15,0,16,-12,0\n");
    const PosePath middle =
        read("seconds,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n0,26,3,0,1,1,0\n0.1,24,5,0,1,1,0\n0.2,24,5,0,1,1,0\n");
    const PosePath turning = read(
        "seconds,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n0,10,-6.5,0,1,1,0\n0.2,10,-6.5,0,4,-1,0\n0.4,10,-6.5,0,4,-1,0\n");
    const ToolSpec finger = toolOf(ToolKind::capsule, 5e-3, 20e-3);
    struct Case {
        ToolSpec tool;
        const PosePath& path;
        double bound;
    };
    for (const auto& [tool, path, bound] : {Case{ball, down, 3e-3},
                                            {finger, flat, 3e-3},
                                            {finger, back, 3e-3},
                                            {finger, middle, 5e-3},
                                            {finger, turning, 0.015}}) {
        haptics::SessionModel small = smallBlock("[safety]\ndevice = \"ideal\"\n");
        small.scene.model.level = datasets::ModelLevel::elastic;
        small.scene.tool = tool;
        const auto model = haptics::buildModel(std::move(small.scene), small.tissue);
        haptics::Simulation session(model);
        haptics::TickRecord tick;
        for (std::size_t i = 0; i < path.ticks(); ++i) {
            const ToolPose pose = path.at(i);
            haptics::DeviceSample sample;
            sample.position = pose.position;
            sample.axis = pose.axis;
            tick = session.tick(sample);
        }
        const PressSample own = pressed(model, path, {tool}).samples.back();
        EXPECT_GT(glm::length(own.force), 0.004);
        EXPECT_LT(glm::distance(own.force, tick.tissueForce), bound * glm::length(own.force));
        EXPECT_NEAR(own.depth, tick.penetration, 2e-6);
    }
}

// A ball wider than the body, on fine cells: it touches all of the face, 10,000 points.
TEST(Press, NoPointOfALargeContactIsLeftOut)
{
    haptics::SessionModel small = smallBlock("[model.elastic]\nspacing_mm = 0.6\n");
    small.scene.model.level = datasets::ModelLevel::elastic;
    const auto model = haptics::buildModel(std::move(small.scene), small.tissue);
    const Pressed p = pressed(model, read("seconds,x_mm,y_mm,z_mm\n0,0,-100.1,0\n0.155,0,-97,0\n"),
                              {toolOf(ToolKind::sphere, 100e-3, 0.0)});
    const PressSample& s = p.samples.back();
    EXPECT_GT(s.contactArea, 700e-6);
    EXPECT_LT(std::abs(s.force.z), 0.01 * std::abs(s.force.y));
}

// Between its samples a path that is solved to convergence is not: they are in none of its figures.
TEST(Press, FiguresOfAConvergedPathAreThoseOfItsSamples)
{
    const Pressed p = pressed(read("seconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.025,0,-1,0\n0.03,0,-2,0\n"), {ball, 30, true});
    double peak = 0.0;
    for (const PressSample& s : p.samples) {
        peak = std::max(peak, glm::length(s.force));
    }
    EXPECT_EQ(p.summary.peakForce, peak);
    EXPECT_GT(p.summary.inContact, p.samples.size());
}

// Of a ball on a half-space the patch has the area pi R d (Hertz 1882), whether surface points are quartered or not; the
// layer is thin, so that it is somewhat wider.
TEST(Press, ContactAreaIsThatOfHertz)
{
    const Pressed p = pressed(read("seconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.25,0,-3,0\n"), {ball, 1, true});
    for (const double depth : {0.6e-3, 1e-3, 2e-3}) {
        const auto& s = p.samples.at(static_cast<std::size_t>(std::lround((depth + 0.5e-3) / 10e-6)));
        const double hertz = std::numbers::pi * ball.radius * depth;
        EXPECT_GT(s.contactArea, 0.7 * hertz) << depth;
        EXPECT_LT(s.contactArea, 1.5 * hertz) << depth;
    }
}

TEST(Press, TheWayOutEndsAtRest)
{
    const Pressed p = pressed(read("seconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.1,0,-3,0\n0.2,0,-6,0\n"), {ball});
    EXPECT_LT(p.samples[100].force.y, -0.02);
    EXPECT_GT(p.samples[100].contactArea, 10e-6);
    EXPECT_LT(p.samples[100].contactArea, std::numbers::pi * 25e-6);
    EXPECT_EQ(p.samples.back().force, Vec3(0.0));
    EXPECT_EQ(p.samples.back().contactArea, 0.0);
    EXPECT_EQ(p.samples.back().energy, 0.0);
}

// E(b) - E(a) = -integral of F over the way, here by the trapezoidal rule over steps of 0.1 mm; and what contacts gain as
// they grow stiffer with their area, 3 % where a ball presses on few cells.
TEST(Press, WorkOnTheToolIsTheEnergyThatTheTissueLoses)
{
    const Pressed p = pressed(read(in3mm), {ball, 5, true});
    double work = 0.0;
    for (std::size_t i = 1; i < p.samples.size(); ++i) {
        const PressSample &a = p.samples[i - 1], &b = p.samples[i];
        work += glm::dot(0.5 * (a.force + b.force), b.pose.position - a.pose.position);
        EXPECT_LE(b.residual, pressTolerance);
    }
    EXPECT_EQ(p.summary.notConverged, 0U);
    EXPECT_GT(p.samples.back().energy, 1e-5);
    EXPECT_LT(-work, 1.01 * p.samples.back().energy);
    EXPECT_GT(-work, 0.96 * p.samples.back().energy);
}

TEST(Press, FewerSamplesChangeNoForce)
{
    const PosePath path = read(in3mm);
    const Pressed all = pressed(path, {ball}), some = pressed(path, {ball, 40});
    ASSERT_EQ(all.samples.size(), 176U);
    ASSERT_EQ(some.samples.size(), 6U);
    for (std::size_t i = 0; i < 5; ++i) {
        EXPECT_EQ(some.samples[i].force, all.samples[40 * i].force);
    }
    EXPECT_EQ(some.samples.back().force, all.samples.back().force);
    EXPECT_EQ(some.summary.peakForce, all.summary.peakForce);
}

// Under the middle of the ball tissue goes with it, short of what the ball sinks in; on the base it stays.
TEST(Press, PointsMoveAsTheToolPushesThem)
{
    const std::vector<FilePoint> asked{{Vec3(0.0), "at.csv:2"}, {Vec3(0, 15.9e-3, 0), "at.csv:3"}};
    const Pressed p = pressed(read(in3mm), {ball, 1000, true}, asked);
    const auto& u = p.samples.back().displacement;
    ASSERT_EQ(u.size(), 2U);
    EXPECT_NEAR(u[0].y, 3e-3, 0.4e-3);
    EXPECT_LT(glm::length(u[1]), 0.2e-3);
    EXPECT_EQ(p.samples.front().displacement[0], Vec3(0.0));
    try {
        pressed(read(in3mm), {ball}, std::vector<FilePoint>{{Vec3(0, -2e-3, 0), "at.csv:7"}});
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_TRUE(std::string(e.what()).starts_with("at.csv:7: the point lies 2.0")) << e.what();
    }
}

// Only the half sphere at its front touches, until it is a radius deep.
TEST(Press, AnUprightCapsulePressesAsItsFrontDoes)
{
    const PressOptions rod{toolOf(ToolKind::capsule, 5e-3, 20e-3), 1000, true};
    const Pressed capsule = pressed(read(in3mm), rod), sphere = pressed(read(in3mm), {ball, 1000, true});
    const double force = glm::length(sphere.samples.back().force);
    EXPECT_LT(glm::distance(capsule.samples.back().force, sphere.samples.back().force), 2e-3 * force);
    const PosePath lying = read("seconds,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z\n0,10,-5.5,0,1,0,0\n0.175,10,-2,0,1,0,0\n");
    EXPECT_GT(glm::length(pressed(lying, rod).samples.back().force), 1.5 * force);
}

// Its tip holds one point, on springs of 8 E h in all directions.
TEST(Press, ANeedlesTipPullsAsATieOfEightModuliTimesSpacing)
{
    const auto& model = block();
    const PosePath path = read("seconds,x_mm,y_mm,z_mm\n0,0,8,0\n0.1,1,10,0\n");
    const Pressed tip = pressed(path, {toolOf(ToolKind::needle, 0.0, 0.0)});
    const Vec3 rest(0, 8e-3, 0);
    const auto& level = model.elastic->levels.front();
    const auto cell = level.nodes.offset(Index3(glm::floor((rest - level.nodes.origin) / level.nodes.spacing)));
    const double k = 8.0 * chainmail::youngsModulusOf(level.mu[cell]) * level.nodes.spacing;
    chainmail::Tie tie{rest, Vec3(0.0), Vec3(0, 1, 0), k, k};
    chainmail::ElasticLoad load{{}, {&tie, 1}, chainmail::focusAt(model.surface, rest)};
    chainmail::Elastic elastic(*model.elastic, haptics::elasticOptions(model.scene.model.elastic), load.focus);
    for (std::size_t i = 0; i < path.ticks(); ++i) {
        tie.u = path.at(i).position - rest;
        elastic.relax(load);
        EXPECT_EQ(tip.samples[i].force, elastic.tieForce(0)) << i;
    }
    EXPECT_EQ(tip.samples.front().force, Vec3(0.0));
    EXPECT_LT(glm::dot(tip.samples.back().force, path.poses.back().position - rest), 0.0);
    EXPECT_EQ(tip.samples.back().contactArea, 0.0);
}

TEST(Press, ANeedlesShaftHoldsWhatItIsIn)
{
    const PosePath path = read("seconds,x_mm,y_mm,z_mm\n0,0,10,0\n0.1,2,10,0\n");
    const auto sideways = [&](double length) {
        return -pressed(path, {toolOf(ToolKind::needle, 0.6e-3, length)}).samples.back().force.x;
    };
    EXPECT_GT(sideways(0.0), 0.0);
    EXPECT_GT(sideways(8e-3), 1.1 * sideways(4e-3));
    // It ends at the surface, 10 mm behind the tip.
    EXPECT_NEAR(sideways(20e-3), sideways(10.2e-3), 1e-9);
    // Without a radius its tip alone holds.
    const auto tip = [&](double length) {
        return pressed(path, {toolOf(ToolKind::needle, 0.0, length)}).samples.back().force;
    };
    EXPECT_EQ(tip(8e-3), tip(0.0));
}

// Wherever it goes in between the nodes; a point every 4 mm was up to a third stiffer in the middle of cells.
TEST(Press, ANeedleDoesNotFeelTheGrid)
{
    const auto along = [&](double x, double z) {
        const std::string at = fmt::format("{},10,{}", x, z), on = fmt::format("{},10.5,{}", x, z);
        const PosePath path = read("seconds,x_mm,y_mm,z_mm\n0," + at + "\n0.1," + on + "\n");
        return -pressed(path, {toolOf(ToolKind::needle, 0.6e-3, 30e-3), 1000, true}).samples.back().force.y;
    };
    const double onNodes = along(0.0, 0.0);
    EXPECT_GT(onNodes, 0.0);
    for (const auto& [x, z] : {std::pair(0.5, 0.5), {1.0, 0.0}, {1.0, 1.0}, {0.3, 0.7}}) {
        EXPECT_NEAR(along(x, z), onNodes, 0.04 * onNodes) << x << " " << z;
    }
}

// Forces are as Young's modulus, from fat to bone that gives way. A contact of 10 kN/m at most let tissue of 300 kPa sink
// into the ball, and that of 3 MPa pass through it without a force.
TEST(Press, ForcesAreInProportionToTheModulus)
{
    const auto forceOf = [](double kPa, const PosePath& path) {
        haptics::SessionModel soft = smallBlock(fmt::format("[tissue.fat]\nyoungs_kpa = {}\n", kPa));
        soft.scene.model.level = datasets::ModelLevel::elastic;
        const auto model = haptics::buildModel(std::move(soft.scene), soft.tissue);
        return -pressed(model, path, {ball, 1000, true}).samples.back().force.y;
    };
    const PosePath deep = read("seconds,x_mm,y_mm,z_mm\n0,0,-5.5,0\n0.6,0,1,0\n");
    const double fat = forceOf(3.0, deep) / 3.0;
    EXPECT_GT(fat, 0.0);
    for (const double kPa : {300.0, 30e3, 10e6}) {
        EXPECT_NEAR(forceOf(kPa, deep) / kPa, fat, 0.02 * fat) << kPa;
    }
}

TEST(Press, ANeedleThatBeginsOutsideOfTheTissueIsRefused)
{
    try {
        pressed(read("x_mm,y_mm,z_mm\n0,-1,0\n"), {toolOf(ToolKind::needle, 0.0, 0.1)});
        FAIL();
    } catch (const std::runtime_error& e) {
        EXPECT_TRUE(std::string(e.what()).starts_with("path.csv: the needle's tip is not in tissue")) << e.what();
    }
}

// It goes in from the surface, as far as a tick lets it; solved to convergence no tool is held back, and it touches
// nothing.
TEST(Press, AToolThatBeginsInsideIsHeldBackAtTheSurface)
{
    const PosePath path = read("seconds,x_mm,y_mm,z_mm\n0,0,8,0\n0.01,0,8,0\n");
    const ToolSpec small = toolOf(ToolKind::sphere, 2e-3, 0.0);
    const Pressed p = pressed(path, {small});
    ASSERT_TRUE(p.summary.heldFrom);
    EXPECT_GT(p.samples.back().behind, 5e-3);
    EXPECT_LT(p.samples.back().force.y, -0.01);
    const Pressed converged = pressed(path, {small, 1, true});
    EXPECT_EQ(converged.summary.inContact, 0U);
    EXPECT_FALSE(converged.summary.heldFrom);
    EXPECT_FALSE(pressed(path, {toolOf(ToolKind::needle, 0.0, 0.0)}).summary.heldFrom);
}

}  // namespace
}  // namespace palpate::studies
